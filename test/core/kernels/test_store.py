"""What is kept of compiled kernels: used where it is sound and private, else compiled anew."""
from __future__ import annotations

from collections.abc import Callable, Iterator
import multiprocessing
from multiprocessing.forkserver import ensure_running
from multiprocessing.process import BaseProcess
import os
from pathlib import Path
import random
import shutil
import sys
import tempfile
from typing import NamedTuple

from kernel_start import drop_root, fill_the_disk, have_no_home, mask_nothing, NOBODY, nothing, run
import pytest

pytestmark = pytest.mark.slow
FORKS = multiprocessing.get_context('forkserver')


class Start(NamedTuple):
    """What a start of the program gave: how many signatures came from disk, and stderr."""

    kept: int
    stderr: str

    @property
    def warnings(self) -> list[str]:
        return [line for line in self.stderr.splitlines() if 'compiled code' in line]


class Launch(NamedTuple):
    """A process that uses a kernel, and the folder of its output."""

    process: BaseProcess
    output: Path

    def end(self) -> Start:
        """Wait for its end; whatever the cache holds, the kernel works."""
        self.process.join(120)
        said = {path.name: path.read_text() for path in self.output.iterdir()}
        shutil.rmtree(self.output)
        stdout, stderr = said.pop('stdout'), said.pop('stderr')
        assert self.process.exitcode == 0, stderr
        *values, kept = stdout.split()
        assert values == ['42', '2.5'] and not said  # nothing else is in the current folder
        return Start(int(kept), stderr)


def launch(cache: Path | None, first: Callable[[], object] = nothing) -> Launch:
    output = Path(tempfile.mkdtemp())
    output.chmod(0o777)
    process = FORKS.Process(target=run, args=(cache, first, output))
    process.start()
    return Launch(process, output)


def start(cache: Path | None, first: Callable[[], object] = nothing) -> Start:
    """Run a process that uses a kernel, after something else, to its end."""
    return launch(cache, first).end()


def files(cache: Path) -> list[Path]:
    return [path for path in cache.rglob('*') if path.is_file()]


@pytest.fixture(scope='module', autouse=True)
def fork_server() -> None:
    """Start the process from which all others are forked, with numba ready to compile."""
    FORKS.set_forkserver_preload(['warm_numba'])
    with pytest.MonkeyPatch.context() as patch:
        # Python 3.11 does not give it the path of this process.
        patch.setenv('PYTHONPATH', os.pathsep.join(sys.path))
        ensure_running()


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
        said = start(tmp_path / 'cache', fill_the_disk)
        assert said.kept == 0 and len(said.stderr.splitlines()) == 1
        assert 'cannot be kept' in said.stderr and 'File too large' in said.stderr
    assert files(tmp_path / 'cache') == []
    assert start(tmp_path / 'cache') == (0, '')


def test_processes_that_fill_it_together(tmp_path: Path) -> None:
    """None of them fails, and what they leave is right."""
    for process in [launch(tmp_path / 'cache') for _ in range(4)]:
        assert process.end().stderr == ''
    assert start(tmp_path / 'cache') == (2, '')


def test_a_cache_that_can_only_be_read(cache: Path) -> None:
    """As in an image: another user made it, and it is used without a word."""
    for path in (cache, *cache.rglob('*')):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert start(cache, drop_root) == (2, '')
    assert start(cache, drop_root) == (2, '')
    next(iter(sorted(path for path in files(cache) if path.suffix in ('.kernel',)))
         ).unlink()
    incomplete = start(cache, drop_root)
    assert incomplete.kept == 1 and len(incomplete.warnings) == 1
    assert 'Permission denied' in incomplete.stderr


def test_folders_are_private_whatever_the_umask(tmp_path: Path) -> None:
    start(tmp_path / 'a' / 'cache', mask_nothing)
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
def test_a_user_without_a_home() -> None:
    said = start(None, have_no_home)
    assert said.kept == 0
    assert 'cannot be kept' in said.stderr and 'no home folder' in said.stderr
