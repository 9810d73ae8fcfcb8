"""Compiled kernels work in a process that has not imported numba."""
from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import pytest
from qflsd_ros.core.kernels import machine_code
from qflsd_ros.core.kernels.store import DIGEST, DIGEST_SIZE

pytestmark = [pytest.mark.slow, pytest.mark.skipif(
    not machine_code.is_supported(), reason='numba loads the kernels of this processor')]
FOLDER = Path(__file__).parent
KERNELS = """
import sys
from typing import NamedTuple
import numpy as np
from qflsd_ros.core import compilation
from qflsd_ros.core.compilation import compiled, inlined, summed

class Pair(NamedTuple):
    values: np.ndarray
    factor: float

@inlined
def scaled(value, factor):
    return value * factor + np.sin(value)

@compiled
def weigh(pair, counts, out):
    for i in range(len(out)):
        out[i] = scaled(pair.values[i], pair.factor) + np.hypot(counts[i], 1)
    return len(out), out[0] > 0, out[-1]

@summed
def total(values):
    found = 0.0
    for value in values:
        found += value
    return found

@compiled
def nothing(values):
    values[:] = 7

@compiled
def divide(a, b):
    return a // b

def use():
    values, out = np.linspace(-1, 1, 9), np.empty(9)
    print(weigh(Pair(values, 2.5), np.arange(9, dtype=np.uint16), out), out.tolist())
    print(weigh(Pair(values.astype(np.float32), 2.5), np.arange(9), out), out.tolist())
    print(total(values), total(np.arange(8.0)[::2]), nothing(out), out.tolist(), divide(7, 2))
"""


def run(cache: Path, more: str) -> str:
    return subprocess.run(
        [sys.executable, '-c', f'from kernels import *\n{more}'], check=True, text=True,
        cwd=cache, capture_output=True, timeout=300,
        env=os.environ | {'NUMBA_CACHE_DIR': str(cache)}).stdout


@pytest.fixture(scope='module')
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('cache')
    folder.chmod(0o700)
    (folder / 'kernels.py').write_text(KERNELS)
    return folder


@pytest.fixture(scope='module')
def compiled(cache: Path) -> str:
    """Give what the kernels return in the process that compiles them."""
    return run(cache, 'use()\nassert "numba" in sys.modules')


def test_they_give_the_same_without_numba(cache: Path, compiled: str) -> None:
    assert run(cache, 'compilation.STORE.is_final = True\n'
               'use()\nassert "numba" not in sys.modules') == compiled
    assert len(compiled.splitlines()) == 3


def test_they_give_the_same_beside_numba(cache: Path, compiled: str) -> None:
    """As where a process loads some kernels and has to compile others."""
    new = '@compiled\ndef twice(x):\n    return 2 * total(x)\n'
    (cache / 'others.py').write_text(f'from kernels import *\n{new}')
    for before, after in (('', 'print(twice(np.ones(3)))'), ('import numba\n', '')):
        said = run(cache, f'{before}use()\nfrom others import *\n{after}')
        assert said.startswith(compiled)
    assert said == compiled and len(list(cache.rglob('total-*.part'))) == 1


def test_arguments_that_cannot_be_converted(cache: Path, compiled: str) -> None:
    """An error of Python, as numba has it, and no crash."""
    said = run(cache, """
import contextlib
for wrong in ((), (1,), (1, 2, 3), (1, 2 ** 70)):
    try:
        print('no error', divide(*wrong))
    except (TypeError, OverflowError) as error:
        print(type(error).__name__)
""")
    assert said.split() == ['TypeError', 'TypeError', 'TypeError', 'OverflowError']


def test_an_object_file_with_other_relocations(cache: Path, compiled: str) -> None:
    """As of another version of LLVM: it is refused, not run, and the kernel compiled anew."""
    path, = cache.rglob('divide-*.kernel')
    content = bytearray(path.read_bytes())
    place = content.index(machine_code.ADDRESS.to_bytes(4, 'little'), _relocations(content))
    content[place] = 2
    with pytest.raises(ValueError, match='relocations'):
        machine_code.load(bytes(content), 'divide')
    path.write_bytes(content[:-DIGEST_SIZE] + DIGEST(content[:-DIGEST_SIZE]).digest())
    said = run(cache, """
import logging
logging.basicConfig(format='%(message)s', stream=sys.stdout)
print(divide(7, 2), "numba" in sys.modules)
""")
    assert 'cannot be loaded (divide: the object file has other relocations' in said
    assert said.endswith('3 True\n')


def _relocations(content: bytes) -> int:
    """Return where the relocations of an object file begin."""
    header = machine_code.np.frombuffer(content, machine_code.HEADER, 1)[0]
    sections = machine_code.np.frombuffer(content, machine_code.SECTION, header['number'],
                                          header['sections'])
    [first] = [int(section['offset']) for section in sections
               if section['type'] == machine_code.RELA and section['size'] > 48]
    return first
