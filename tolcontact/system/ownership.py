"""Folders that no other user can write to. Whoever can write to a cache of machine code can run code as its reader.

On POSIX systems owners and modes tell who can. Windows has access lists instead, which Python does not read. By default they
give other users no access to the user's profile folder, so there a folder is private if it lies in the profile.
"""

import os
import stat
from pathlib import Path

from tolcontact.system.files import IS_POSIX, is_link

try:
    import grp
    import pwd
except ImportError:  # on Windows
    grp = pwd = None  # type: ignore[assignment]

_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def is_private(folder: Path) -> bool:
    """Return whether a path is a folder, and no link, of this user, that no other user (but root) can write to or replace.

    Raises OSError if it does not exist.
    """
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or is_link(status) or not is_own(status):
        return False
    place = folder.parent.resolve().joinpath(folder.name)
    if not IS_POSIX:
        return place.is_relative_to(_profile())
    return all(_is_safe(parent.stat()) for parent in place.parents)


def is_own(status: os.stat_result) -> bool:
    """Return whether a file or folder belongs to this user, and others cannot write to it; on Windows, its folder decides."""
    return not IS_POSIX or (status.st_uid == os.geteuid() and not status.st_mode & _OTHERS)


def _profile() -> Path:
    """Return the user's profile folder."""
    try:
        return Path.home().resolve()
    except RuntimeError as error:
        raise OSError("this user has no profile folder") from error


def _is_safe(status: os.stat_result) -> bool:
    """Return whether others cannot rename what is in a folder and belongs to this user."""
    if status.st_uid not in (0, os.geteuid()):
        return False
    writers = status.st_mode & _OTHERS
    return not writers or bool(status.st_mode & stat.S_ISVTX) or (writers == stat.S_IWGRP and _is_own_group(status.st_gid))


def _is_own_group(number: int) -> bool:
    """Return whether a group is the one that many systems make for each user, with nobody else in it."""
    try:
        group, name = grp.getgrgid(number), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
    return group.gr_name == name and set(group.gr_mem) <= {name}
