"""How daemons and clients of one computer find each other: a directory with one small file for each daemon.

A daemon holds a lock on `lock_file` of its namespace as long as it runs and writes its `Registration` beside it. The
file of a daemon that was killed stays behind: nobody holds its lock, and it is taken as none.

All users of the computer may add files to the directory: whatever is no registration there is passed over.
"""

from __future__ import annotations

import json
import os
import re
import stat
from dataclasses import asdict, dataclass
from pathlib import Path

from ual.errors import InvalidArgumentError

RUNTIME_DIR_VARIABLE = "UAL_RUNTIME_DIR"
LOOPBACK = "127.0.0.1"

_DEFAULT_PORT = 50051
_PORT_BEFORE_FIRST = 50050
_LAST_PORT = 65535
_READABLE = 0o644
_OWN = 0o600
_LONGEST_FILE = 4096
_AS_IT_LIES = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
"""To open a file that anybody may have laid there: no link is followed, no pipe waited for."""


def runtime_dir() -> Path:
    """Where the daemons of this computer register: ``$UAL_RUNTIME_DIR``, else ``ual`` in the directory of temporary
    files.
    """
    configured = os.environ.get(RUNTIME_DIR_VARIABLE)
    if configured:
        return Path(configured)
    from tempfile import gettempdir  # with a dozen modules: 1 MiB

    return Path(gettempdir()) / "ual"


def registry_file(ns: str) -> Path:
    """Where the daemon of a namespace says who and where it is."""
    return runtime_dir() / f"{ns}.json"


def lock_file(ns: str) -> Path:
    """What the daemon of a namespace holds locked (flock) as long as it runs."""
    return runtime_dir() / f"{ns}.lock"


def default_port(ns: str) -> int:
    """50050 + N for a namespace that ends in ``_N``, 50051 without a number."""
    _, number = split_number(ns)
    return _PORT_BEFORE_FIRST + number if number is not None and has_own_port(ns) else _DEFAULT_PORT


def has_own_port(ns: str) -> bool:
    """Whether a namespace has a port that no other one has by default."""
    _, number = split_number(ns)
    return number is not None and _PORT_BEFORE_FIRST + number <= _LAST_PORT


def split_number(ns: str) -> tuple[str, int | None]:
    """``uav_7`` as ``uav`` and 7; None where a namespace has no number."""
    match = re.fullmatch(r"(.*)_(\d+)", ns)
    return (ns, None) if match is None else (match[1], int(match[2]))


def default_address(ns: str) -> str:
    """Where the daemon of a namespace listens if nobody said otherwise."""
    return f"{LOOPBACK}:{default_port(ns)}"


@dataclass(frozen=True, slots=True)
class Registration:
    """One daemon: `address` is ``host:port`` or ``unix:/path``, `started_s` UTC since 1970."""

    ns: str
    pid: int
    address: str
    backend: str
    started_s: float

    def write(self) -> None:
        """Registers the daemon; a reader sees the old file or the new one, never half of one."""
        file = registry_file(self.ns)
        # A new file of a name that nobody can know before: others may write in this directory, too.
        unfinished = file.with_name(f"{self.ns}.{os.urandom(8).hex()}.tmp")
        handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, _OWN)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                os.fchmod(handle, _READABLE)
                stream.write(json.dumps(asdict(self)) + "\n")
            unfinished.replace(file)
        except OSError:
            unfinished.unlink(missing_ok=True)
            raise

    @classmethod
    def read(cls, file: Path) -> Registration | None:
        """What a file says; None where there is none, or it is none of ours."""
        try:
            values = json.loads(_read_small(file))
            found = cls(
                ns=str(values["ns"]),
                pid=int(values["pid"]),
                address=str(values["address"]),
                backend=str(values["backend"]),
                started_s=float(values["started_s"]),
            )
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return None
        # It speaks for the namespace whose file it is, in words that can be shown.
        is_ours = found.ns == file.stem and (found.ns + found.address + found.backend).isprintable()
        return found if is_ours else None

    def is_alive(self) -> bool:
        """Whether its daemon runs: by the lock, and by its pid only where the lock cannot be looked at."""
        is_locked = _is_locked(lock_file(self.ns))
        return self._has_process() if is_locked is None else is_locked

    def _has_process(self) -> bool:
        if self.pid <= 0:
            return False
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            # Another user's process is one all the same; a number that can be no process is not.
            return self.pid < 2**31
        return True


def _read_small(file: Path) -> bytes:
    handle = os.open(file, _AS_IT_LIES)
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise ValueError("no regular file")
        text = os.read(handle, _LONGEST_FILE + 1)
    finally:
        os.close(handle)
    if len(text) > _LONGEST_FILE:
        raise ValueError("longer than any registration")
    return text


def _is_locked(file: Path) -> bool | None:
    """Whether a daemon holds this lock; None where that cannot be seen.

    It is tried for a moment, shared, so that clients do not see each other; a daemon that starts at that moment tries
    again (`ual_daemon.program.namespace`).
    """
    import fcntl  # not everywhere where a client that was given an address works

    try:
        handle = os.open(file, _AS_IT_LIES)
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
    """The daemons that run on this computer, in the order of their names and numbers."""
    found = (Registration.read(file) for file in runtime_dir().glob("*.json"))
    return sorted((each for each in found if each is not None and each.is_alive()), key=_natural)


def registered(ns: str) -> Registration | None:
    """The daemon of a namespace, if one runs on this computer."""
    registration = Registration.read(registry_file(ns))
    return registration if registration is not None and registration.is_alive() else None


def only() -> Registration | None:
    """The daemon of this computer, if there is one. Raises `InvalidArgumentError` if there are several."""
    daemons = list_daemons()
    if len(daemons) > 1:
        names = ", ".join(each.ns for each in daemons)
        raise InvalidArgumentError(f"ns: several UAVs are here, say which one: {names}", {"field": "ns"})
    return daemons[0] if daemons else None


def find(ns: str = "") -> str:
    """The address of the daemon of a namespace: where it registered, else where it would listen by default.

    Without a namespace it is the only daemon of this computer. Raises `InvalidArgumentError` if there are several.
    """
    registration = registered(ns) if ns else only()
    return default_address(ns) if registration is None else registration.address


def _natural(registration: Registration) -> tuple[str, int, str]:
    match = re.fullmatch(r"(.*?)(\d+)", registration.ns)
    return (registration.ns, 0, "") if match is None else (match[1], int(match[2]), registration.ns)
