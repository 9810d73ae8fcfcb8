"""
Files that are written completely or not at all, also in folders that other users may write to.

An unfinished file lies in a private folder with a random name, where no other user can place
links or files. The folder is removed at the end, with everything that is left in it.
"""
from __future__ import annotations

from contextlib import contextmanager, suppress
import os
from pathlib import Path
import secrets
import shutil
import tempfile
from typing import Iterator

from qflsd_ros.cli.interruption import held


@contextmanager
def private_room(folder: Path) -> Iterator[Path]:
    """Create a private folder in another one and remove it afterwards; OSError if it cannot."""
    room = None
    try:
        with held():
            room = Path(tempfile.mkdtemp('.part', '.', folder))
        yield room
    finally:
        if room is not None:
            with held():
                shutil.rmtree(room, ignore_errors=True)


def write_whole(folder: Path, name: str, content: bytes, room: Path) -> None:
    """
    Write a file under a temporary name, then rename it, so that it is never seen incomplete.

    Parameters
    ----------
    folder
        Folder of the file.
    name
        Name of the file in that folder, or ``FOLDER/FILE``. A link at this place is replaced, not
        followed.
    content
        Content of the file.
    room
        A :func:`private_room` in the folder.

    Raises
    ------
    OSError
        The file cannot be written.

    """
    partial = room / secrets.token_hex(8)   # several processes share the room
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
        with open(os.open(partial, flags, 0o666), 'wb') as file:
            file.write(content)
        publish(partial, folder, name)
    finally:
        partial.unlink(missing_ok=True)


def publish(whole: Path, folder: Path, name: str) -> None:
    """Move a complete file or folder to its place; ``folder`` and ``name`` as in write_whole."""
    above, _, last = name.rpartition('/')
    with _opened(folder, 0) as place:
        if not above:
            os.rename(whole, last, dst_dir_fd=place)
            return
        with suppress(FileExistsError):
            os.mkdir(above, dir_fd=place)
        with _opened(above, os.O_NOFOLLOW, place) as place:
            os.rename(whole, last, dst_dir_fd=place)


@contextmanager
def _opened(folder: Path | str, flags: int, place: int | None = None) -> Iterator[int]:
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | flags, dir_fd=place)
    try:
        yield number
    finally:
        os.close(number)
