"""Compiling all kernels when the package is installed, and checking that they are there."""
from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.slow
TIMEOUT = 400.0  # s; generous: the machine may be busy while all kernels are compiled
# What nodes and ``detect`` do, with everything switched on.
USE = """
from qflsd_ros.core import compilation, Parameters
from qflsd_ros.ros.attitude import CameraAttitude
from qflsd_ros.ros.finding import FrameSequence
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene
settings = Settings(attitude=True)
for colour in (False, True):
    image = Scene(320, 240, colour=colour, noise=0.0).image(0)
sequence, attitude = FrameSequence(), CameraAttitude()
for number in range(12):
    gray = Scene(320, 240, lam=-0.3).image(number)
    seen = sequence.find(gray, Parameters(detect_every=1 + number // 6), settings)
    lens = sequence.lens.estimate(settings) or seen.model
    attitude.follow(seen.arcs, gray.shape, settings, lens, None)
assert len(seen.arcs)
print(compilation.progress('qflsd_ros').compiled)
"""


# The command on a disk that is full: no file grows beyond 1000 bytes.
SMALL_FILES = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
from qflsd_ros.cli.warm_up import main
sys.exit(main())
"""


def run(cache: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], text=True, timeout=TIMEOUT,
                          capture_output=True, env=os.environ | {'NUMBA_CACHE_DIR': str(cache)})


def warm_up(cache: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run(cache, '-m', 'qflsd_ros.cli.warm_up', *arguments)


def kernels(cache: Path) -> list[Path]:
    return sorted(path for path in cache.rglob('*.kernel') if path.name != 'old.kernel')


@contextmanager
def without_a_kernel(cache: Path) -> Iterator[Path]:
    """Remove a kernel of the scene for a while."""
    path = next(path for path in kernels(cache) if path.name.startswith('_mix'))
    content = path.read_bytes()
    path.unlink()
    try:
        yield path
    finally:
        path.write_bytes(content)
        path.chmod(0o600)


@pytest.fixture(scope='module')
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Give a cache that ``warm_up`` has filled; there were other folders in it before."""
    cache = tmp_path_factory.mktemp('cache')
    cache.chmod(0o700)
    for name, days in (('0123456789abcdef', 40), ('123456789abcdef0', 3), ('notes', 40)):
        folder = cache / 'qflsd_ros' / name
        folder.mkdir(0o700, parents=True)
        (folder / 'old.kernel').write_text('')
        os.utime(folder, 2 * (time.time() - days * 86400,))
    said = warm_up(cache)
    assert said.returncode == 0, said.stderr
    assert str(cache / 'qflsd_ros') in said.stdout
    yield cache


def test_all_kernels_are_compiled(cache: Path) -> None:
    """Neither images of the scene, nor tracks, lens and attitude compile any more."""
    said = run(cache, '-c', USE)
    assert said.stdout.strip() == '0', said.stderr


def test_old_caches_are_removed(cache: Path) -> None:
    """Those of other checkouts that are in use stay, and a user's folder of another name."""
    names = {path.name for path in (cache / 'qflsd_ros').iterdir()}
    assert {'notes', '123456789abcdef0'} < names and len(names) == 3


def test_use_of_a_cache_is_noted(cache: Path) -> None:
    """Else a version in use would be removed after a while."""
    folder, = {path.parent for path in kernels(cache)}
    os.utime(folder, (0, 0))
    warm_up(cache, '--check')
    assert time.time() - folder.stat().st_mtime < 3600


def test_a_check_of_a_complete_cache(cache: Path) -> None:
    before = kernels(cache)
    said = warm_up(cache, '--check')
    assert (said.returncode, said.stderr) == (0, '')
    assert str(before[0].parent) in said.stdout
    assert kernels(cache) == before


def test_a_check_of_an_empty_cache(tmp_path: Path) -> None:
    """It says so in one line, and compiles nothing."""
    tmp_path.chmod(0o700)
    said = warm_up(tmp_path, '--check')
    assert (said.returncode, said.stdout) == (1, '')
    line, = said.stderr.splitlines()
    assert str(tmp_path) in line and 'is not compiled' in line
    assert not kernels(tmp_path)


def test_a_check_finds_a_missing_kernel(cache: Path) -> None:
    """One of the scene alone: all kernels are checked, not those of the detector only."""
    with without_a_kernel(cache) as path:
        said = warm_up(cache, '--check')
        assert said.returncode == 1 and 'scene' in said.stderr
        assert not path.exists()


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    """Nobody waits for a compilation in vain."""
    (tmp_path / 'file').touch()     # in the place of the folder, where root may not write either
    said = warm_up(tmp_path / 'file')
    assert said.returncode == 1 and 'cannot be kept: nothing is compiled' in said.stderr
    assert 'no folder' in said.stdout and str(tmp_path) in said.stderr


def test_a_kernel_that_cannot_be_kept(cache: Path) -> None:
    """As on a full disk."""
    with without_a_kernel(cache) as path:
        said = run(cache, '-c', SMALL_FILES)
        assert said.returncode == 1 and 'could not all be kept' in said.stderr
        assert not path.exists()
