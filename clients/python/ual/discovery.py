"""Discovery of daemons by clients of the same computer: a directory with one small file for each daemon.

A daemon locks the `lock_file` of its namespace while it runs, and writes its `Registration` beside it. A daemon that
was killed leaves its registration behind, but the lock is free: such a registration is ignored.

All users of the computer may add files to the directory: any file that is not a registration is ignored.
"""

from __future__ import annotations

import json
import os
import re
import stat
from dataclasses import asdict, dataclass
from pathlib import Path

from ual.errors import InvalidArgumentError
from ual.shared import environment, whole_file

RUNTIME_DIR_VARIABLE = "UAL_RUNTIME_DIR"
LOOPBACK = "127.0.0.1"

_DEFAULT_PORT = 50051
_NUMBERED_PORT_OFFSET = 50050
LAST_PORT = 65535
_LONGEST_FILE_BYTES = 4096
_UNTRUSTED = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
"""Flags to open a file that any user may have put there: does not follow a link, and does not wait for a pipe."""


def runtime_dir() -> Path:
    """Returns where the daemons of this computer register: ``$UAL_RUNTIME_DIR``, else ``ual`` in the directory of
    temporary files.
    """
    configured = environment.value(RUNTIME_DIR_VARIABLE)
    if configured:
        return Path(configured)
    from tempfile import gettempdir  # imported late: it loads a dozen modules, 1 MiB

    return Path(gettempdir()) / "ual"


def registry_file(ns: str) -> Path:
    """Returns the file with the registration of the namespace's daemon."""
    return runtime_dir() / f"{ns}.json"


def lock_file(ns: str) -> Path:
    """Returns the file that the namespace's daemon locks (flock) while it runs."""
    return runtime_dir() / f"{ns}.lock"


def home_file(ns: str) -> Path:
    """Returns the file in which the namespace's daemon keeps home (`ual_daemon.frames.home_file`)."""
    return runtime_dir() / f"{ns}.home"


HOME = "home"
"""Prefix of a daemon's health check about that file, while it cannot be written."""


def default_port(ns: str) -> int:
    """Returns 50050 + N for a namespace that ends in ``_N``, 50051 for one without a number."""
    _, number = split_number(ns)
    return _NUMBERED_PORT_OFFSET + number if number is not None and has_own_port(ns) else _DEFAULT_PORT


def has_own_port(ns: str) -> bool:
    """Returns whether the namespace has a default port that no other namespace has."""
    _, number = split_number(ns)
    return number is not None and _NUMBERED_PORT_OFFSET + number <= LAST_PORT


def split_number(ns: str) -> tuple[str, int | None]:
    """Splits ``uav_7`` into ``uav`` and 7. The number is None if the namespace has none."""
    match = re.fullmatch(r"(.*)_(\d+)", ns)
    return (ns, None) if match is None else (match[1], int(match[2]))


def default_address(ns: str) -> str:
    """Returns where the daemon of a namespace listens by default."""
    return f"{LOOPBACK}:{default_port(ns)}"


@dataclass(frozen=True, slots=True)
class Registration:
    """One daemon: `address` is ``host:port`` or ``unix:/path``, `started_s` UTC since 1970."""

    ns: str
    pid: int
    address: str
    backend: str
    started_s: float

    def write(self) -> Path:
        """Registers the daemon. A reader sees the old file or the new one, never a part of one.

        Returns:
            The file: one that also names the user, where another user's file has the name of the namespace.

        Raises:
            OSError: The file cannot be written.
        """
        text = json.dumps(asdict(self)) + "\n"
        for file in (registry_file(self.ns), _file_of_user(self.ns, os.getuid())):
            try:
                whole_file.replace(file, text, whole_file.READABLE_PERMISSIONS)
            except PermissionError as error:  # a daemon of another user was killed: only that user may remove its file
                refusal = error
            else:
                return file
        raise refusal

    @classmethod
    def read(cls, file: Path) -> Registration | None:
        """Reads a file. Returns None if there is no file or it is not a registration."""
        try:
            text, user = _read_small(file)
            values = json.loads(text)
            found = cls(
                ns=str(values["ns"]),
                pid=int(values["pid"]),
                address=str(values["address"]),
                backend=str(values["backend"]),
                started_s=float(values["started_s"]),
            )
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return None
        # The file's name must be that of the namespace, or of its owner; all text must be safe to print.
        is_named = file in (registry_file(found.ns), _file_of_user(found.ns, user))
        is_valid = is_named and (found.ns + found.address + found.backend).isprintable()
        return found if is_valid else None

    def is_alive(self) -> bool:
        """Returns whether its daemon runs: judged by the lock, and by its pid only if the lock file cannot be
        opened.
        """
        is_locked = _is_locked(lock_file(self.ns))
        return self.has_process() if is_locked is None else is_locked

    def has_process(self) -> bool:
        """Returns whether the process is there that it names."""
        if self.pid <= 0:
            return False
        if os.name == "nt":  # there `os.kill` would end it; a call will tell
            return True
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            # PermissionError: the process is another user's. OverflowError: the number is too large for a pid.
            return self.pid < 2**31
        return True


def _file_of_user(ns: str, user: int) -> Path:
    return runtime_dir() / f"{ns}.{user}.json"


def _read_small(file: Path) -> tuple[bytes, int]:
    """Returns the content of a file, and whose it is."""
    handle = os.open(file, _UNTRUSTED)
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("not a regular file")
        text = os.read(handle, _LONGEST_FILE_BYTES + 1)
    finally:
        os.close(handle)
    if len(text) > _LONGEST_FILE_BYTES:
        raise ValueError("longer than any registration")
    return text, found.st_uid


def _is_locked(file: Path) -> bool | None:
    """Returns whether a daemon holds this lock. Returns None if that cannot be found out.

    Takes the lock for a moment, shared, so that several clients can do this at once. A daemon that starts at that
    moment tries again (`ual_daemon.program.namespace`).
    """
    try:
        import fcntl  # imported late: not every system has it, and a client with a given address does not need it
    except ImportError:
        return None
    try:
        handle = os.open(file, _UNTRUSTED)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return None
    else:
        return False
    finally:
        os.close(handle)


def list_daemons() -> list[Registration]:
    """Returns the daemons that run on this computer, sorted by name and number."""
    found = (Registration.read(file) for file in runtime_dir().glob("*.json"))
    names = {each.ns for each in found if each is not None}
    return sorted((each for each in map(registered, names) if each is not None), key=_by_name)


def registered(ns: str) -> Registration | None:
    """Returns the daemon of a namespace, if one runs on this computer."""
    files = (registry_file(ns), *sorted(runtime_dir().glob(f"{ns}.*.json")))
    found = [each for each in map(Registration.read, files) if each is not None and each.ns == ns]
    if len(found) > 1:  # one was left by a killed daemon of another user
        found.sort(key=lambda each: not each.has_process())
    return found[0] if found and found[0].is_alive() else None


def only() -> Registration | None:
    """Returns the daemon of this computer, if one runs.

    Raises:
        InvalidArgumentError: Several daemons run.
    """
    daemons = list_daemons()
    if len(daemons) > 1:
        names = ", ".join(each.ns for each in daemons)
        raise InvalidArgumentError(f"ns: several UAVs run on this computer, choose one: {names}", {"field": "ns"})
    return daemons[0] if daemons else None


def find(ns: str = "") -> str:
    """Returns the address of a namespace's daemon: where it registered, else where it would listen by default.

    Without a namespace this is the only daemon of this computer.

    Raises:
        InvalidArgumentError: No namespace is given, and several daemons run.
    """
    registration = registered(ns) if ns else only()
    return default_address(ns) if registration is None else registration.address


def _by_name(registration: Registration) -> tuple[str, int, str]:
    return natural_order(registration.ns)


def natural_order(ns: str) -> tuple[str, int, str]:
    """Returns the key by which names are sorted: ``uav_2`` before ``uav_10``."""
    match = re.fullmatch(r"(.*?)(\d+)", ns)
    return (ns, 0, "") if match is None else (match[1], int(match[2]), ns)
