"""Take away from this Python, on Linux, what Windows does not have. It is imported at the start of every process.

Libraries keep what their parts for Linux need: `fcntl`, `os.uname`, `os.getuid`, `os.O_NONBLOCK`. An open file can neither be
replaced nor removed under its name, as on Windows; only files of this process count. No path has more than 259 letters, and the
netCDF library opens ASCII paths only. Short names are links in the folder `SHORT_NAMES`; without it, drives have none.
"""

import asyncio  # noqa: F401  (its parts for Linux, and those of psutil, need what is taken away below)
import builtins
import ctypes
import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import psutil  # noqa: F401

FLAGS = "O_NOFOLLOW O_CLOEXEC O_DIRECTORY O_NOCTTY O_SYNC"
USERS = "geteuid getegid getgid getgroups getpgid getpgrp setpgid setsid setuid setgid chown lchown fchown fchmod"
SYSTEM = "sysconf sysconf_names confstr sched_getaffinity getloadavg fork forkpty mkfifo mknod nice killpg wait3 wait4"
SIGNALS = "SIGXCPU SIGHUP SIGUSR1 SIGUSR2 SIGALRM SIGCHLD SIGPIPE alarm pause setitimer siginterrupt sigpending sigwait"
THREADS = "pthread_kill pthread_sigmask SIG_BLOCK SIG_SETMASK SIG_UNBLOCK"
AWAY = {os: (FLAGS, USERS, SYSTEM), signal: (SIGNALS, THREADS)}

for module, texts in AWAY.items():
    for name in " ".join(texts).split():
        delattr(module, name)
for name in ("resource", "grp", "pwd", "termios", "pty", "tty"):
    sys.modules[name] = None
os.supports_fd.discard(os.utime)
os.process_cpu_count = os.cpu_count  # from Python 3.13 on, where no process can be kept to some processors

import_, replace, unlink, stat = builtins.__import__, os.replace, os.unlink, os.stat


def imported(name, variables=None, *arguments, **options):
    if name == "fcntl" and (variables or {}).get("__name__", "").startswith("tolcontact"):
        raise ImportError(name)
    module = import_(name, variables, *arguments, **options)
    if name == "netCDF4" and module.Dataset.__module__ != __name__:
        module.Dataset = type("Dataset", (module.Dataset,), {"__module__": __name__, "__new__": new_dataset})
    return module


def new_dataset(kind, path, *arguments, **options):
    if not str(path).isascii():
        raise PermissionError(13, "Permission denied", str(path))
    return kind.__base__.__new__(kind)


def short_path(path, buffer, size):
    """Give the short name of a path."""
    folder = os.environ.get("SHORT_NAMES")
    link = Path(folder or "", f"{abs(hash(path))}~1")
    if folder and not link.is_symlink():
        link.symlink_to(path.removeprefix("\\\\?\\"))
    buffer.value = str(link) if folder else path


def status(path, **options):
    if isinstance(path, str | os.PathLike) and len(os.fspath(path)) > 259:
        error = FileNotFoundError(2, "The system cannot find the path specified", str(path))
        error.winerror = 3
        raise error
    return stat(path, **options)


def refuse_open(*paths):
    """Raise PermissionError if this process has one of these files open."""
    targets = {os.path.realpath(link) for link in Path("/proc/self/fd").iterdir()}
    for path in paths:
        if os.path.realpath(path) in targets:
            raise PermissionError(13, "The process cannot access the file because it is being used by another process", path)


def replaced(source, target, **options):
    if not options:
        refuse_open(source, target)
    replace(source, target, **options)


def unlinked(path, **options):
    if not options:
        refuse_open(path)
    unlink(path, **options)


ctypes.windll = SimpleNamespace(kernel32=SimpleNamespace(GetShortPathNameW=short_path))
builtins.__import__, os.replace, os.unlink, os.remove, os.stat = imported, replaced, unlinked, unlinked, status
