"""One daemon for each namespace on a computer, and where clients find it.

The directory (`ual._discovery.runtime_dir`) is shared by all users of the computer, as ``/tmp`` is: everyone may add
files, only their owner may change or remove them. So no link in it is followed, and nothing written through a file
that another user may have laid there.
"""

from __future__ import annotations

import fcntl
import os
import stat
import time
from contextlib import suppress
from pathlib import Path

from typing_extensions import Self

from ual import _discovery
from ual._discovery import Registration

_STICKY_FOR_ALL = 0o1777
_READABLE = 0o644
_LOOK_S = 0.005
"""Between two tries to take a lock at which clients look, ..."""
_LOOKS_LIMIT_S = 1.0
"""... and for how long. (To wait for a lock has no limit, and a client that is stopped while it looks holds it on.)"""


class NamespaceError(Exception):
    """The namespace cannot be had; the message says why, and who has it."""


class Namespace:
    """A namespace, held from when this is made until `release`, or until the process ends, however that happens.

    Raises `NamespaceError` where another daemon holds it.
    """

    def __init__(self, ns: str) -> None:
        self._ns = ns
        self._is_registered = False
        path = _discovery.lock_file(ns)
        try:
            _make_directory(path.parent)
            self._lock = _open_lock(path)
        except OSError as error:
            raise NamespaceError(f"cannot open {path}: {error.strerror}") from None
        if not _take(self._lock):
            holder = _holder(ns, self._lock)
            os.close(self._lock)
            raise NamespaceError(f"{ns} is flown by {holder} already: stop that, or choose another --ns")
        with suppress(OSError):  # what a killed daemon left must not be taken for ours, now that the lock is held
            _discovery.registry_file(ns).unlink()
        with suppress(OSError):  # another user's file: it can be locked, but not written
            os.truncate(self._lock, 0)
            os.pwrite(self._lock, f"{os.getpid()}\n".encode(), 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()

    def register(self, address: str, backend: str) -> None:
        """Lets clients find the daemon: `address` is ``host:port`` or ``unix:/path``. Raises `NamespaceError`."""
        try:
            Registration(self._ns, os.getpid(), address, backend, time.time()).write()
        except OSError as error:
            raise NamespaceError(f"cannot write {_discovery.registry_file(self._ns)}: {error.strerror}") from None
        self._is_registered = True

    def release(self) -> None:
        """Gives the namespace back. The lock file stays: removing it would let two daemons lock two files."""
        if self._is_registered:
            _discovery.registry_file(self._ns).unlink(missing_ok=True)
        os.close(self._lock)


def _make_directory(directory: Path) -> None:
    directory.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        directory.mkdir()
        directory.chmod(_STICKY_FOR_ALL)  # what mkdir gives is cut by the umask
    found = directory.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise NamespaceError(f"{directory} is no directory: remove it, or set {_discovery.RUNTIME_DIR_VARIABLE}")
    if found.st_mode & stat.S_IWOTH and not found.st_mode & stat.S_ISVTX:
        raise NamespaceError(
            f"{directory}: users may remove each other's files there: `chmod +t` it, "
            f"or set {_discovery.RUNTIME_DIR_VARIABLE}"
        )


def _open_lock(path: Path) -> int:
    """The lock file, made if it is not there. Another user's is opened for reading, which is enough to lock it."""
    flags = os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
    while True:
        try:
            return os.open(path, os.O_RDWR | flags)
        except PermissionError:
            return os.open(path, os.O_RDONLY | flags)
        except FileNotFoundError:
            # Not O_CREAT alone: Linux refuses that for another user's file in a shared directory.
            with suppress(FileExistsError):
                lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | flags)
                os.fchmod(lock, _READABLE)
                return lock


def _take(lock: int) -> bool:
    """Takes a lock; False where another daemon holds it.

    A client that looks whether a daemon holds it takes it shared for a moment (`ual._discovery`). A daemon never does.
    """
    end_s = time.monotonic() + _LOOKS_LIMIT_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pass
        else:
            return True
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        fcntl.flock(lock, fcntl.LOCK_UN)  # so that of two daemons that start together one gets it
        if time.monotonic() > end_s:
            return False
        time.sleep(_LOOK_S)


def _holder(ns: str, lock: int) -> str:
    """Who holds a namespace, as well as it can be told."""
    registration = _discovery.registered(ns)
    if registration is not None:
        return f"pid {registration.pid} at {registration.address}"
    written = os.pread(lock, 20, 0).decode(errors="replace").strip()
    return f"pid {written}, which is still starting," if written.isdecimal() else "a daemon that is still starting"
