"""A file that is read again when it has changed, without a restart."""

from __future__ import annotations

import logging
import os
import shlex
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from ual.shared import bounded_file
from ual_daemon import logs
from ual_daemon.settings import ConfigError

T = TypeVar("T")

_log = logging.getLogger(__name__)

_POLL_S = 0.2
"""Seconds between two checks whether the file has changed."""
_SETTLING_TIME_S = 1.0
"""Seconds for which a changed file must not have changed again before it is read. Before, it may be half-written: cut
at the end of a line it would look whole.
"""


class _Signature(NamedTuple):
    """The properties by which a file that has changed is recognized."""

    changed_ns: int
    inode: int
    size: int
    mode: int


class WatchedFile(Generic[T]):
    """The content of a file, read by `parse`, which raises ValueError. Any thread may call.

    A file that other users of this computer could change (with `is_secret`: could read) is refused. A change that
    cannot be read is logged, and what was read last stays. So does a file that may still be written.

    Raises:
        ConfigError: The file cannot be read, others could, or it is wrong. `setting` is the key that names it.

    """

    def __init__(
        self,
        path: Path,
        setting: str,
        parse: Callable[[bytes], T],
        *,
        is_secret: bool,
        period_s: float = _POLL_S,
        settled_s: float = _SETTLING_TIME_S,
    ) -> None:
        self._path = path
        self._setting = setting
        self._parse = parse
        self._forbidden = (stat.S_IRWXO | stat.S_IWGRP) if is_secret else (stat.S_IWOTH | stat.S_IWGRP)
        self._period_s = period_s
        self._settled_s = settled_s
        self._signature = self._seen = self._read_signature()
        self._seen_s = time.monotonic()
        self._value = self._read()
        self._next_check_s = time.monotonic() + period_s

    @property
    def value(self) -> T:
        """Content of the file now."""
        now_s = time.monotonic()
        if now_s >= self._next_check_s:
            self._next_check_s = now_s + self._period_s
            signature = self._read_signature()
            if signature != self._signature and self._has_settled(signature, now_s):
                self._signature = signature
                self._read_again()
        return self._value

    def _has_settled(self, signature: _Signature | None, now_s: float) -> bool:
        if signature != self._seen:
            self._seen, self._seen_s = signature, now_s
        if signature is None or now_s - self._seen_s >= self._settled_s:
            return True
        return abs(time.time() - signature.changed_ns * 1e-9) >= self._settled_s

    def _read_again(self) -> None:
        try:
            self._value = self._read()
        except ConfigError as error:
            logs.event(_log, logging.ERROR, "not_read_again", setting=self._setting, why=error.message)
        else:
            logs.event(_log, logging.INFO, "read_again", setting=self._setting, file=self._path)

    def _read_signature(self) -> _Signature | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return _Signature(found.st_mtime_ns, found.st_ino, found.st_size, found.st_mode)

    def _read(self) -> T:
        try:
            require_owned(self._path, self._forbidden, self._setting)
            return self._parse(bounded_file.read(self._path))
        except OSError as error:
            raise ConfigError(f"{self._path} cannot be read: {error.strerror}", self._setting) from None
        except ValueError as error:
            raise ConfigError(f"{self._path}: {error}", self._setting) from None


def require_owned(path: Path, forbidden: int, setting: str) -> None:
    """Refuses a file that belongs to another user than root or ours, or whose mode has one of the forbidden bits.

    Raises:
        ConfigError: It is such a file; the message says what to run.
        OSError: It cannot be looked at.

    """
    found = path.stat()
    if found.st_uid not in (0, os.geteuid()):
        raise ConfigError(f"{path} belongs to another user of this computer, who can change it", setting)
    if found.st_mode & forbidden:
        can = "read or change" if forbidden & stat.S_IROTH else "change"
        mode = "go-w,o-rwx" if forbidden & stat.S_IROTH else "go-w"
        raise ConfigError(
            f"other users of this computer can {can} {path}: run `chmod {mode} {shlex.quote(str(path))}`", setting
        )
