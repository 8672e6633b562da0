"""Ensures that each namespace has only one daemon on a computer, and registers it for clients.

All users of the computer share the directory (`ual.discovery.runtime_dir`), like ``/tmp``: everyone may add files, and
only their owner may change or remove them. For safety no link in it is followed, and nothing is written to a file that
another user may have put there.

Files may be removed (a cleaner of ``/tmp``): so a namespace is held by the name of a socket, too, where the system has
names that are no files (Linux). `Namespace.keep` writes the files again.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import logging
import os
import socket
import stat
import sys
import time
from contextlib import suppress
from pathlib import Path

from typing_extensions import Self

from ual import discovery
from ual.discovery import Registration
from ual.shared import output_file
from ual.shared.pauses import GrowingPauses
from ual_daemon import logs

_log = logging.getLogger(__name__)

_LOCK_DIRECTORY_PERMISSIONS = 0o1777
_LOCK_PERMISSIONS = 0o644
_RETRY_S = 0.005
_RETRY_LIMIT_S = 1.0
"""Seconds for which to try to take a lock that clients may hold for a moment. Blocking `flock` has no time limit, and a
client that is stopped at that moment would keep the lock.
"""


class NamespaceError(Exception):
    """The namespace is not available; the message says why, and names the holder."""


class Namespace:
    """A namespace, held from the construction until `release`, or until the process ends in any way.

    Raises:
        NamespaceError: Another daemon holds it, or the lock file cannot be opened.
    """

    def __init__(self, ns: str) -> None:
        self._ns = ns
        self._registration: Registration | None = None
        self._registered: Path | None = None
        self._written: tuple[int, int, int] | None = None  # its identity
        self._failure = ""
        self._pauses = GrowingPauses()
        path = discovery.lock_file(ns)
        try:
            _make_directory(path.parent)
            self._lock = _open_lock(path)
        except OSError as error:
            raise NamespaceError(f"cannot open {path}: {error.strerror}") from None
        if not _take(self._lock):
            holder = _holder(ns, self._lock)
            os.close(self._lock)
            raise NamespaceError(f"{ns} is already flown by {holder}: stop that daemon, or choose another --ns")
        try:
            self._name = _take_name(path)
        except NamespaceError:
            os.close(self._lock)
            raise
        with suppress(OSError):  # the registration of a killed daemon must not be taken for this one's
            discovery.registry_file(ns).unlink()
        _write_pid(self._lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.release()

    def register(self, address: str, backend: str) -> None:
        """Registers the daemon for clients; `address` is ``host:port`` or ``unix:/path``.

        Raises:
            NamespaceError: The registration cannot be written.
        """
        self._registration = Registration(self._ns, os.getpid(), address, backend, time.time())
        try:
            self._write()
        except OSError as error:
            raise NamespaceError(f"cannot write {error.filename}: {error.strerror}") from None

    def keep(self, now_s: float) -> None:
        """Locks and writes again what is gone, with growing pauses. To be called about each second."""
        if not self._pauses.is_due(now_s):
            return
        before = self._failure
        try:
            has_changed = self._keep()
        except (OSError, NamespaceError) as error:
            self._failure = str(error)
            self._pauses.failed(now_s)
            if not before:
                logs.event(_log, logging.ERROR, "registration_lost", ns=self._ns, why=self._failure)
            return
        self._failure = ""
        if has_changed:
            logs.event(_log, logging.WARNING, "registered_again", ns=self._ns, file=self._registered)

    def _keep(self) -> bool:
        has_changed = False
        path = discovery.lock_file(self._ns)
        if output_file.loss_of(path, self._lock):
            _make_directory(path.parent)
            lock = _open_lock(path)
            if not _take(lock):
                holder = _holder(self._ns, lock)
                os.close(lock)
                raise NamespaceError(f"{path} was removed, and {holder} has the new one")
            os.close(self._lock)
            self._lock, has_changed = lock, True
            _write_pid(lock)
        if self._registered is not None and output_file.identity_of(self._registered) != self._written:
            self._write()
            has_changed = True
        return has_changed

    def _write(self) -> None:
        assert self._registration is not None
        self._registered = self._registration.write()
        self._written = output_file.identity_of(self._registered)

    def release(self) -> None:
        """Frees the namespace. Keeps the lock file: if it were removed, two daemons could lock two different files."""
        if self._registered is not None:
            with suppress(OSError):  # it is ignored from here on
                self._registered.unlink()
        os.close(self._lock)
        if self._name is not None:
            self._name.close()


def _write_pid(lock: int) -> None:
    with suppress(OSError):  # another user's file can be locked, but not written
        os.truncate(lock, 0)
        os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)


def _take_name(path: Path) -> socket.socket | None:
    """Takes the name of a socket that stands for a lock file, also while that is gone; None where there is none.

    The name holds the directory that the directory is in: two containers in one network may have a ``/tmp`` each.
    """
    if sys.platform != "linux":
        return None
    around = path.parent.parent.stat()
    text = f"{around.st_dev} {around.st_ino} {path.parent.name}/{path.name}"
    taken = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        taken.bind(f"\0ual/{hashlib.sha256(text.encode()).hexdigest()}")
    except OSError as error:
        taken.close()
        if error.errno != errno.EADDRINUSE:
            return None  # a system may forbid such names: the file holds it
        ns, registration = path.stem, discovery.registered(path.stem)
        where = (
            f" at {registration.address}" if registration is not None else f", whose files in {path.parent} are gone"
        )
        raise NamespaceError(
            f"{ns} is already flown by a daemon{where}: stop that daemon, or choose another --ns"
        ) from None
    return taken


def _make_directory(directory: Path) -> None:
    directory.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        directory.mkdir()
        directory.chmod(_LOCK_DIRECTORY_PERMISSIONS)  # the umask limits the mode that mkdir gives
    found = directory.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise NamespaceError(f"{directory} is not a directory: remove it, or set {discovery.RUNTIME_DIR_VARIABLE}")
    if found.st_mode & stat.S_IWOTH and not found.st_mode & stat.S_ISVTX:
        raise NamespaceError(
            f"{directory}: users may remove each other's files there: `chmod +t` it, "
            f"or set {discovery.RUNTIME_DIR_VARIABLE}"
        )


def _open_lock(path: Path) -> int:
    """Opens the lock file, and makes it if it is missing. Opens another user's for reading, which is enough to lock."""
    flags = os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
    while True:
        try:
            return os.open(path, os.O_RDWR | flags)
        except PermissionError:
            return os.open(path, os.O_RDONLY | flags)
        except FileNotFoundError:
            # With O_EXCL, because Linux refuses O_CREAT alone for another user's file in a shared directory.
            with suppress(FileExistsError):
                lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | flags)
                os.fchmod(lock, _LOCK_PERMISSIONS)
                return lock


def _take(lock: int) -> bool:
    """Takes a lock. Returns False if another daemon holds it.

    A client that tests the lock takes it for a moment, shared (`ual.discovery`). Only daemons take it exclusively. So
    if a shared lock is possible, no daemon holds it, and it is worth trying again.
    """
    end_s = time.monotonic() + _RETRY_LIMIT_S
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
        fcntl.flock(lock, fcntl.LOCK_UN)  # else two daemons that start together would block each other
        if time.monotonic() > end_s:
            return False
        time.sleep(_RETRY_S)


def _holder(ns: str, lock: int) -> str:
    """Returns the holder of a namespace, as text, as far as it is known.

    The system says which process has the lock. What the files say is only believed of that process: a file of another
    user cannot be written, and so may name a process that ended long ago.
    """
    pid = _locking_pid(lock)
    registration = discovery.registered(ns)
    if registration is not None and pid in (None, registration.pid) and _is_running(registration.pid):
        return f"pid {registration.pid} at {registration.address}"
    written = os.pread(lock, 20, 0).decode(errors="replace").strip()
    if pid is None:
        return "a daemon that is still starting, or another process that has its lock"
    if written == str(pid):
        return f"pid {pid}, which is still starting"
    return f"pid {pid} of {_user(pid)}, which has the lock {discovery.lock_file(ns)}"


def _locking_pid(lock: int) -> int | None:
    """Returns the process that has a lock, if the system says so."""
    file = os.fstat(lock)
    inode = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
    with suppress(OSError, ValueError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            words = line.split()  # 1: FLOCK ADVISORY WRITE 4711 08:01:1234 0 EOF
            if words[1:2] == ["FLOCK"] and words[5:6] == [inode]:
                return int(words[4])
    return None


def _is_running(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists() or not Path("/proc/self").exists()


def _user(pid: int) -> str:
    try:
        return f"user {Path(f'/proc/{pid}').owner()}"
    except (OSError, KeyError):
        return "another user"
