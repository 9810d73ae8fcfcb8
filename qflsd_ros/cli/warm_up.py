"""
The command ``warm_up``: compiles all kernels when the package is installed.

Otherwise the first start of a node, or of ``detect``, compiles them.  It needs no ROS.
"""
from __future__ import annotations

import argparse
import sys
import time

from qflsd_ros.core import compilation, Tracker
from qflsd_ros.core.attitude import tracker as attitude_tracker
from qflsd_ros.core.geometry import triangulation
from qflsd_ros.core.kernels.store import NotKeptError
from qflsd_ros.core.lens import estimation
from qflsd_ros.sources.scene.scene import Scene, SceneFrames

FAILED = 1              # exit code
SMALL = (64, 48)        # px, width and height: compiles the same kernels, and takes no time


def load_kernels() -> None:
    """Load or compile the kernels of all nodes, of ``detect`` and of the mapping of lines."""
    Tracker().warm_up()
    estimation.warm_up()
    attitude_tracker.warm_up()
    triangulation.warm_up()
    for colour in (False, True):
        SceneFrames(Scene(*SMALL, colour=colour)).warm_up()


def main() -> int:
    """Compile or check as the command line says; return the exit code."""
    parser = argparse.ArgumentParser(prog='warm_up', description=(
        'Compile all kernels of qflsd_ros, so that no start of a node has to. Those of other '
        'versions that nothing has used for 30 days are removed. They are kept in '
        '~/.cache/qflsd_ros, or below NUMBA_CACHE_DIR.'))
    parser.add_argument('--check', action='store_true', help='compile nothing; the exit code is '
                        '0 if all kernels are there for this processor, and otherwise 1')
    return _check() if parser.parse_args().check else _compile()


def _check() -> int:
    compilation.STORE.is_final = True
    try:
        load_kernels()
    except NotKeptError as error:
        print(f'warm_up: the kernel {error} is not compiled for this version and processor, or '
              f'not readable, in {_place()}: warm_up compiles it', file=sys.stderr)
        return FAILED
    print(f'all kernels are compiled, in {_place()}')
    return 0


def _compile() -> int:
    begin = time.monotonic()
    print(f'loading or compiling kernels in {_place()}; compiling takes about a minute',
          flush=True)
    if compilation.STORE.folder is None:    # it has logged why
        print('warm_up: compiled kernels cannot be kept: nothing is compiled', file=sys.stderr)
        return FAILED
    load_kernels()
    if compilation.STORE.is_failing:
        print('warm_up: the compiled kernels could not all be kept', file=sys.stderr)
        return FAILED
    count = compilation.progress('qflsd_ros').compiled
    print(f'compiled {count} kernels in {time.monotonic() - begin:.0f} s; the others were there')
    for path in compilation.STORE.remove_unused():
        print(f'removed {path}, of another version that was not used any more')
    return 0


def _place() -> str:
    return str(compilation.STORE.folder or 'no folder')


if __name__ == '__main__':
    sys.exit(main())
