"""Files are whole, their own, and nowhere else, whoever else writes."""
from __future__ import annotations

import os
from pathlib import Path
import stat
import subprocess
import sys

import pytest
from qflsd_ros.cli.output.writing import private_room, publish, write_whole

NAMES = 200


# As a process does that has the number of all others: in a container.
WRITE_ALL = """
import os, sys
from pathlib import Path
from qflsd_ros.cli.output.writing import private_room, write_whole
folder, run, names = Path(sys.argv[1]), *map(int, sys.argv[2:])
os.getpid = lambda: 1
with private_room(folder) as room:
    for number in range(names):
        write_whole(folder, f'{run}_{number}', f'{run} {number} '.encode() * 1000, room)
"""


def test_processes_of_the_same_number_share_a_folder(tmp_path: Path) -> None:
    processes = [subprocess.Popen([sys.executable, '-c', WRITE_ALL, str(tmp_path), str(run),
                                   str(NAMES)]) for run in range(3)]
    assert [process.wait(120) for process in processes] == [0, 0, 0]
    assert len(list(tmp_path.iterdir())) == 3 * NAMES
    for run in range(3):
        for number in range(NAMES):
            content = (tmp_path / f'{run}_{number}').read_bytes()
            assert content == f'{run} {number} '.encode() * 1000


def test_the_room_is_private_and_goes(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), private_room(tmp_path) as room:
        assert stat.S_IMODE(room.stat().st_mode) == 0o700 and room.parent == tmp_path
        (room / 'left').write_text('over')
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_rights_are_those_of_any_file(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with private_room(tmp_path) as room:
            write_whole(tmp_path, 'a', b'x', room)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'a').stat().st_mode) == 0o640


def test_what_is_in_the_way_is_an_error_or_replaced(tmp_path: Path) -> None:
    """A file is replaced, a link as well; a folder and a link to one are not gone through."""
    folder, elsewhere = tmp_path / 'out', tmp_path / 'elsewhere'
    for path in (folder, elsewhere, folder / 'd'):
        path.mkdir()
    (folder / 'file').write_text('old')
    (elsewhere / 'victim').write_text('mine')
    (folder / 'link').symlink_to(elsewhere / 'victim')
    (folder / 'sub').symlink_to(elsewhere)
    with private_room(folder) as room:
        for name in ('file', 'link', 'new/a'):
            write_whole(folder, name, b'new', room)
            assert (folder / name).read_text() == 'new' and not (folder / name).is_symlink()
        for name in ('d', 'sub/victim', 'file/a'):
            with pytest.raises(OSError):
                write_whole(folder, name, b'new', room)
        assert not list(room.iterdir())
        (room / 'bag').mkdir()
        publish(room / 'bag', folder, 'bag')
    assert (elsewhere / 'victim').read_text() == 'mine'
    assert sorted(path.name for path in folder.iterdir()) == [
        'bag', 'd', 'file', 'link', 'new', 'sub']
