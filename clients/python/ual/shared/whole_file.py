"""Files that are written whole: a reader sees the old content or the new one, and a fault leaves the old one.

A disk may be full, be taken away, or refuse in the middle of a file. Nothing is left then that looks like a file.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL
_NEW |= getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
OWNER_PERMISSIONS = 0o600
"""Permissions of a file that only its owner may read."""
READABLE_PERMISSIONS = 0o644
_UMASKED_PERMISSIONS = 0o666
_LONGEST_NAME_CHARACTERS = 60
"""In characters: with its ending, the name beside the file must not be longer than a file system takes."""
_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK)
"""Errors of file systems without hard links (FAT)."""


def write(path: Path, data: bytes | str, mode: int | None = None, *, is_durable: bool = True) -> None:
    """Writes a file in one step, in place of one that is there; a link stays one.

    Args:
        path: The file. One that is no regular file, as a terminal or a pipe, is written to as it is.
        data: Text is written as UTF-8.
        mode: Its permissions; None: those of the file before, else what the umask leaves.
        is_durable: It is on the disk once this returns, so that a loss of power does not bring the old one back.

    Raises:
        OSError: It cannot be written; what was there stays.

    """
    content = data.encode() if isinstance(data, str) else data
    target = _target(path)
    if target is None:
        path.write_bytes(content)
        return
    _replace(target, content, _mode_before(target) if mode is None else mode, is_durable=is_durable)


def replace(path: Path, data: bytes | str, mode: int, *, is_durable: bool = False) -> None:
    """Writes a file in a directory into which other users may write, too: whatever is there is replaced, also a link.

    Raises:
        OSError: It cannot be written; what was there stays.

    """
    _replace(path, data.encode() if isinstance(data, str) else data, mode, is_durable=is_durable)


def create(path: Path, data: bytes, mode: int = OWNER_PERMISSIONS) -> None:
    """Writes a file that must not be there yet. It is on the disk once this returns.

    Raises:
        OSError: It is there, or cannot be written; then it is not there.

    """
    temporary = _temporary_path(path)
    with _or_nothing(temporary, path):
        _write_new(temporary, data, mode, is_durable=True)
        _name_new(temporary, path)
        _sync(path.parent)


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Has a file written by its name, whole: yields the name to write to, which ends as the file's does.

    Raises:
        OSError: It cannot be written; what was there stays.

    """
    target = _target(path)
    if target is None:
        yield path
        return
    temporary = _temporary_path(target, target.suffix)
    with _or_nothing(temporary, path):
        _write_new(temporary, b"", _mode_before(target), is_durable=False)
        yield temporary
        _sync(temporary)
        temporary.replace(target)


def _target(path: Path) -> Path | None:
    """Returns the file itself, where `path` may be a link; None where it is no regular file."""
    try:
        is_regular = stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        is_regular = True
    return path.resolve() if is_regular else None


def _mode_before(path: Path) -> int | None:
    with suppress(OSError):
        return stat.S_IMODE(path.stat().st_mode)
    return None


def _replace(path: Path, data: bytes, mode: int | None, *, is_durable: bool) -> None:
    temporary = _temporary_path(path)
    with _or_nothing(temporary, path):
        _write_new(temporary, data, mode, is_durable=is_durable)
        temporary.replace(path)
        if is_durable:
            _sync(path.parent)


def _temporary_path(path: Path, ending: str = ".tmp") -> Path:
    """Returns a name that cannot be guessed: other users may write in this directory, too."""
    return path.with_name(f".{path.name[:_LONGEST_NAME_CHARACTERS]}.{os.urandom(8).hex()}{ending}")


@contextmanager
def _or_nothing(temporary: Path, path: Path) -> Iterator[None]:
    """Leaves nothing beside a file. Faults name the file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _write_new(path: Path, data: bytes, mode: int | None, *, is_durable: bool) -> None:
    handle = os.open(path, _NEW, _UMASKED_PERMISSIONS if mode is None else OWNER_PERMISSIONS)
    try:
        if mode is not None and hasattr(os, "fchmod"):
            os.fchmod(handle, mode)
        written = 0
        while written < len(data):
            written += os.write(handle, data[written:])
        if is_durable:
            os.fsync(handle)
    finally:
        os.close(handle)


def _name_new(temporary: Path, path: Path) -> None:
    """Gives a file its name, which no other may have."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if path.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        temporary.rename(path)


def _sync(path: Path) -> None:
    """Waits until a file, or the names of a directory, are on the disk, where the system can say so."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
