"""
Compiled kernels on disk: a file for each kernel and signature.

numba's own cache has an index for each function, which processes that start together overwrite
with each other's, and it ends the program where a file of it is damaged or cannot be written.
Here a file is written whole or not at all, and ends with a digest of its content: a damaged one is
removed, and its kernel compiled anew.

The files are machine code: whoever writes one can run code here. So they are kept in a private
folder alone.
"""
from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import hashlib
import logging
import os
from pathlib import Path
import re
import shutil
import tempfile
import time

from qflsd_ros.core import private_folder

DIGEST = hashlib.sha256
DIGEST_SIZE = DIGEST().digest_size
NAME_SIZE = 16  # hexadecimal digits in the name of a folder: 64 bits, so that no two are the same
# s without use after which the kernels of another version are removed: 30 days, in which whoever
# works on several checkouts uses each of them.  Chosen, not tuned.
UNUSED = 30 * 86400.0
FOLDER_NAME = re.compile(f'[0-9a-f]{{{NAME_SIZE}}}')


class DamagedError(Exception):
    """A file holds something else than what was written."""


class NotKeptError(Exception):
    """A kernel is not in the store, and must not be compiled."""


class Store:
    """
    Files in a private folder; an error in reading or writing is logged once and raises nothing.

    Attributes
    ----------
    is_final
        Whether a kernel that is not here raises NotKeptError, and is not compiled.

    """

    def __init__(self, locate: Callable[[], Path]) -> None:
        """Take a function that returns the folder, which is made when it is first needed."""
        self.is_final = False
        self._locate = locate
        self._folder: Path | None = None
        self._is_open = False
        self._warned: set[str] = set()

    @property
    def folder(self) -> Path | None:
        """Return the folder, or None where there is no private one."""
        if not self._is_open:
            self._is_open = True
            try:
                folder = self._locate()
                private_folder.make(folder)
                self._folder = folder
                with suppress(OSError):     # that of another user, or of an image
                    os.utime(folder)
            except OSError as error:
                self._warn_unkept(error.filename, error)
        return self._folder

    @property
    def is_failing(self) -> bool:
        """Return whether a file could not be written."""
        return 'unkept' in self._warned

    def read(self, name: str) -> bytes | None:
        """Return the content of a file, or None where there is no sound one."""
        if self.folder is None:
            return None
        path = self.folder / name
        try:
            return self._content(path)
        except FileNotFoundError:
            return None
        except (OSError, DamagedError) as error:
            self._warn('damaged', 'compiled code is damaged, it is compiled anew: %s', error)
            self._discard(path)
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all."""
        if self.folder is None:
            return
        try:
            handle, part = tempfile.mkstemp(dir=self.folder)  # mode 0600 whatever the umask
            try:
                with open(handle, 'wb') as file:
                    file.write(content + DIGEST(content).digest())
                os.replace(part, self.folder / name)
            except BaseException:
                os.unlink(part)
                raise
        except OSError as error:
            self._warn_unkept(self.folder, error)

    def remove_unused(self) -> list[Path]:
        """
        Remove the folders of other versions that are not in use; return those that are gone.

        Others may be in use: several checkouts of one user keep their kernels side by side.  A
        process that uses a folder sets its time of modification.  A folder of another user stays,
        and so does whatever has another name than ours have.
        """
        if self.folder is None:
            return []
        others = [path for path in sorted(self.folder.parent.iterdir())
                  if path != self.folder and FOLDER_NAME.fullmatch(path.name)
                  and path.is_dir() and not path.is_symlink()
                  and path.stat().st_uid == os.geteuid()
                  and time.time() - path.stat().st_mtime > UNUSED]
        for path in others:
            shutil.rmtree(path, ignore_errors=True)
        return [path for path in others if not path.exists()]

    def warn_unusable(self, error: ValueError) -> None:
        """Say that what was kept cannot be loaded, as of an unknown version of numba."""
        self._warn('unusable', 'compiled code cannot be loaded (%s): every start compiles anew, '
                   'for about a minute. It was written by a version of numba with which this '
                   'package was not tested: install another one.', error)

    @staticmethod
    def _content(path: Path) -> bytes:
        private_folder.check(path)
        data = path.read_bytes()
        content, digest = data[:-DIGEST_SIZE], data[-DIGEST_SIZE:]
        if DIGEST(content).digest() != digest:
            raise DamagedError(f'{path} has not the content that was written')
        return content

    @staticmethod
    def _discard(path: Path) -> None:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()

    def _warn_unkept(self, place: object, error: OSError) -> None:
        self._warn('unkept', 'compiled code cannot be kept in %s (%s): every start compiles anew, '
                   'for about a minute. Set NUMBA_CACHE_DIR to a folder that you, and only '
                   'you, can write to.', place, error.strerror)

    def _warn(self, kind: str, text: str, *values: object) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
            logging.getLogger(__name__).warning(text, *values)
