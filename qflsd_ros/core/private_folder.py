"""Folders that nobody but their owner or root can fill, for files that are as trusted as code."""
from __future__ import annotations

import errno
import grp
import os
from pathlib import Path
import pwd
import stat

ROOT_USER = 0           # the number of root (POSIX)


def make(folder: Path) -> None:
    """
    Make a folder, with mode 0700 whatever the umask; one that is there is checked.

    Raises
    ------
    OSError
        It cannot be made, or another user could put files into it or another folder into its
        place: ``filename`` is the folder or the parent that lets him, ``strerror`` the reason.

    """
    for part in (*reversed(folder.parents), folder):
        if not part.exists():
            part.mkdir(0o700, exist_ok=True)
        check(part, is_parent=part != folder)


def check(path: Path, is_parent: bool = False) -> None:
    """
    Check that none but the current user and root can change what a path holds.

    In a parent with the sticky bit, such as /tmp, others can add entries, but not replace ours.
    Raises PermissionError.
    """
    status = path.lstat()
    if status.st_uid not in (ROOT_USER, os.geteuid()):
        raise PermissionError(errno.EPERM, f'belongs to user {status.st_uid}', str(path))
    if stat.S_ISLNK(status.st_mode):
        target = path.parent / os.readlink(path)
        for part in (*reversed(target.parents), target):
            check(part, is_parent or part != target)
    elif _written_by_others(status) and not (is_parent and status.st_mode & stat.S_ISVTX):
        raise PermissionError(errno.EPERM, 'its group or others can write to it', str(path))


def _written_by_others(status: os.stat_result) -> bool:
    by_group = status.st_mode & stat.S_IWGRP and not _is_private_group(status)
    return bool(by_group or status.st_mode & stat.S_IWOTH)


def _is_private_group(status: os.stat_result) -> bool:
    """Return whether the group is the owner's alone: Linux users mostly have one of their name."""
    try:
        group, owner = grp.getgrgid(status.st_gid), pwd.getpwuid(status.st_uid)
    except KeyError:
        return False
    return group.gr_name == owner.pw_name and set(group.gr_mem) <= {owner.pw_name}
