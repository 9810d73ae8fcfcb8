"""
Files that are whole or not there, in folders that others may write into, too.

What is not whole yet lies in a private folder of a random name, which nobody else can plant
anything in, and which goes in the end with whatever has been left there.
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
    """Give a private folder within another one, for as long as it takes; OSError if it cannot."""
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
    Write a file so that nobody ever sees half of it.

    Parameters
    ----------
    folder
        Where it goes.
    name
        Of the file in that folder, or ``FOLDER/FILE``; links that lie there are not followed but
        replaced.
    content
        All of it.
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
    """Give a file or folder its place at once; ``folder`` and ``name`` as of write_whole."""
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
