"""What is kept of compiled kernels: used where it is sound and private, else compiled anew."""
from __future__ import annotations

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import random
import shutil
import subprocess
import sys
import tempfile
from typing import NamedTuple

import pytest

NOBODY = 54321  # a user who has no name and no home
# Prints what the kernel gives for integers and for floats, and how many of both were kept.
PROGRAM = """
import os, resource, sys
import numba
from qflsd_ros.core.compilation import compiled

@compiled
def twice(x):
    return 2 * x

{}
print(twice(21), twice(1.25), sum(twice.stats.cache_hits.values()))
"""
# Root may write anywhere. What numba imports late, it does here: another user may not read it.
DROP_ROOT = ('numba.njit(lambda x: x + 1)(1); '
             f'os.geteuid() or os.setresuid(*[{NOBODY}] * 3)')
# No file may grow beyond 1000 bytes: writing fails in the midst of it, as on a full disk.
FULL_DISK = 'resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))'
UMASK_0 = 'os.umask(0)'


class Start(NamedTuple):
    """What a start of the program gave: how many signatures came from disk, and stderr."""

    kept: int
    stderr: str

    @property
    def warnings(self) -> list[str]:
        return [line for line in self.stderr.splitlines() if 'compiled code' in line]


def launch(cache: Path, first: str = '') -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, '-c', PROGRAM.format(first)], text=True,
                            env=os.environ | {'NUMBA_CACHE_DIR': str(cache)},
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def start(cache: Path, first: str = '') -> Start:
    """Run the program, after a statement; whatever the cache holds, the kernel works."""
    stdout, stderr = (process := launch(cache, first)).communicate(timeout=120)
    assert process.returncode == 0, stderr
    *values, kept = stdout.split()
    assert values == ['42', '2.5']
    return Start(int(kept), stderr)


def files(cache: Path) -> list[Path]:
    return [path for path in cache.rglob('*') if path.is_file()]


@pytest.fixture(scope='module')
def original() -> Iterator[Path]:
    """Give a cache that is filled, in a folder that every user may read."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        Path(folder, 'original').mkdir()
        assert start(cache := Path(folder, 'original', 'cache')) == (0, '')
        yield cache


@pytest.fixture
def cache(original: Path) -> Iterator[Path]:
    """Give a copy of it."""
    folder = shutil.copytree(original.parent, original.parents[1] / 'copy')
    yield folder / 'cache'
    shutil.rmtree(folder)


def test_what_is_kept_is_used(cache: Path) -> None:
    assert start(cache) == (2, '')


def to_length(length: float) -> Callable[[Path], None]:
    def truncate(path: Path) -> None:
        os.truncate(path, int(path.stat().st_size * length))
    return truncate


def randomise(path: Path) -> None:
    path.write_bytes(random.Random(0).randbytes(path.stat().st_size))


def turn_a_bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def become_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / 'file').write_text('')


@pytest.mark.parametrize('damage', [
    to_length(0), to_length(0.01), to_length(0.5), to_length(0.99), randomise, turn_a_bit,
    become_a_folder])
def test_a_damaged_file_is_discarded(cache: Path, damage: Callable[[Path], None]) -> None:
    """One line says so, the kernel is compiled and kept, and all is well from then on."""
    for path in files(cache):
        damage(path)
    kept, stderr = first = start(cache)
    assert kept == 0 and len(first.warnings) == len(stderr.splitlines()) == 1, stderr
    assert 'damaged' in stderr and str(cache) in stderr
    assert start(cache) == (2, '')


def test_a_full_disk(tmp_path: Path) -> None:
    """It compiles, says once why nothing is kept, and leaves no part of a file."""
    for _ in range(2):
        said = start(tmp_path / 'cache', FULL_DISK)
        assert said.kept == 0 and len(said.stderr.splitlines()) == 1
        assert 'cannot be kept' in said.stderr and 'File too large' in said.stderr
    assert files(tmp_path / 'cache') == []
    assert start(tmp_path / 'cache') == (0, '')


def test_processes_that_fill_it_together(tmp_path: Path) -> None:
    """None of them fails, and what they leave is right."""
    processes = [launch(tmp_path / 'cache') for _ in range(4)]
    for process in processes:
        stdout, stderr = process.communicate(timeout=120)
        assert (process.returncode, stdout.split()[:2], stderr) == (0, ['42', '2.5'], '')
    assert start(tmp_path / 'cache') == (2, '')


def test_a_cache_that_can_only_be_read(cache: Path) -> None:
    """As in an image: another user made it, and it is used without a word."""
    for path in (cache, *cache.rglob('*')):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert start(cache, DROP_ROOT) == (2, '')
    assert start(cache, DROP_ROOT) == (2, '')
    next(iter(sorted(path for path in files(cache) if path.suffix in ('.kernel', '.nbc')))
         ).unlink()
    incomplete = start(cache, DROP_ROOT)
    assert incomplete.kept == 1 and len(incomplete.warnings) == 1
    assert 'Permission denied' in incomplete.stderr


def test_folders_are_private_whatever_the_umask(tmp_path: Path) -> None:
    start(tmp_path / 'a' / 'cache', UMASK_0)
    made = list(tmp_path.rglob('*'))
    assert len(made) > 4
    assert {path.stat().st_mode & 0o777 for path in made} == {0o700, 0o600}


def check_refused(cache: Path, reason: str) -> None:
    """Check that nothing of a cache is used and that one line says why."""
    said = start(cache)
    assert said.kept == 0 and len(said.warnings) == len(said.stderr.splitlines()) == 1
    assert 'cannot be kept' in said.stderr and reason in said.stderr, said.stderr


@pytest.mark.parametrize('depth', [0, 1, 2])
def test_a_folder_that_others_can_write_to(cache: Path, depth: int) -> None:
    """Whether the one with the kernels or one above it: others could put a program there."""
    folder = [*files(cache)[0].parents][depth]
    folder.chmod(0o777)
    check_refused(cache, f'{folder} (its group or others can write to it)')
    folder.chmod(0o1777)    # others can add files to it, but not replace folders in it
    if depth:
        assert start(cache) == (2, '')
    else:
        check_refused(cache, f'{folder} (its group or others can write to it)')


def test_a_file_that_others_can_write_to(cache: Path) -> None:
    for path in files(cache):
        path.chmod(0o666)
    said = start(cache)
    assert said.kept == 0 and 'can write to it' in said.stderr
    assert start(cache) == (2, '')


@pytest.mark.skipif(os.geteuid() != 0, reason='none but root can give files away')
@pytest.mark.parametrize('depth', [0, 1, 2])
def test_a_folder_of_another_user(cache: Path, depth: int) -> None:
    """Root, too, runs nothing that another user has put there."""
    folder = [*files(cache)[0].parents][depth]
    os.chown(folder, NOBODY, NOBODY)
    check_refused(cache, f'{folder} (belongs to user {NOBODY})')


@pytest.mark.skipif(os.geteuid() != 0, reason='none but root can give files away')
def test_a_link_that_another_user_has_set(cache: Path) -> None:
    """He could set it elsewhere at any time; one of our own is followed."""
    link = cache.with_name('link')
    link.symlink_to(cache)
    assert start(link) == (2, '')
    os.chown(link, NOBODY, NOBODY, follow_symlinks=False)
    check_refused(link, f'{link} (belongs to user {NOBODY})')


def test_a_link_into_a_folder_that_others_can_write_to(cache: Path) -> None:
    shared = cache.with_name('shared')
    shared.mkdir()
    shutil.move(cache, shared / 'cache')
    shared.chmod(0o777)
    cache.symlink_to(shared / 'cache')
    check_refused(cache, f'{shared} (its group or others can write to it)')


@pytest.mark.skipif(os.geteuid() != 0, reason='none but root can become a user without a name')
def test_a_user_without_a_home(tmp_path: Path) -> None:
    """Nothing is then put into the current folder."""
    tmp_path.chmod(0o777)
    first = f'{DROP_ROOT}; [os.environ.pop(name, 0) for name in ("HOME", "XDG_CACHE_HOME")]'
    result = subprocess.run(
        [sys.executable, '-c', PROGRAM.format(first)], cwd=tmp_path, text=True,
        env=os.environ | {'NUMBA_CACHE_DIR': ''}, capture_output=True)
    assert result.returncode == 0 and result.stdout.split()[2] == '0', result.stderr
    assert 'cannot be kept' in result.stderr and 'no home folder' in result.stderr
    assert not list(tmp_path.iterdir())
