"""The addresses that the daemon listens on."""

from __future__ import annotations

import errno
import os
import re
import socket
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ual.credentials import is_this_computer
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:  # the addresses decide how gRPC is to be imported
    from ual_daemon.server.transport.base import MakeCredentials, TransportServer

_LONGEST_UNIX_PATH_BYTES = 107


class ListenError(Exception):
    """The server cannot listen on an address; the message says on which and why."""


@dataclass(frozen=True, slots=True)
class Address:
    """``HOST:PORT`` (IPv6 in brackets), or ``unix:PATH``, for which `port` is 0 and `host` the path."""

    host: str
    port: int
    is_unix: bool = False

    def __str__(self) -> str:
        if self.is_unix:
            return f"unix:{self.host}"
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def is_local(self) -> bool:
        """Whether only this computer can reach it."""
        return is_this_computer(str(self))


def parse(text: str) -> Address:
    """Returns the address that the text stands for.

    Raises:
        ConfigError: It stands for none.

    """
    if text.startswith("unix:"):
        path = text.removeprefix("unix://" if text.startswith("unix:///") else "unix:")
        if not path or len(os.fsencode(path)) > _LONGEST_UNIX_PATH_BYTES:
            raise ConfigError(
                f"{text!r}: the path of a unix socket has 1 to {_LONGEST_UNIX_PATH_BYTES} bytes", "listen"
            )
        return Address(path, 0, is_unix=True)
    match = re.fullmatch(r"(?:\[([0-9A-Fa-f:.]+)\]|([^\s:/\[\]]+)):([0-9]{1,5})", text)
    if match is None or int(match[3]) > 65535:
        raise ConfigError(f"{text!r} is no address: expected HOST:PORT or unix:PATH", "listen")
    return Address(match[1] or match[2], int(match[3]))


def is_local(template: str) -> bool:
    """Returns whether only this computer can reach an address, in which ``{port}`` and ``{ns}`` may still stand."""
    try:
        return parse(template.replace("{port}", "0").replace("{ns}", "uav")).is_local
    except ConfigError:
        return False  # it will be refused


def bind(server: TransportServer, address: Address, credentials: MakeCredentials | None) -> Address:
    """Makes the server listen, with TLS where there are credentials. Returns the address with the port it got.

    Raises:
        ListenError: The address cannot be had. The message names the program that has it, where the system shows it.

    """
    if address.is_unix:
        _check_unix_path(address)
    try:
        port = server.listen(str(address), None if address.is_unix else credentials)
    except RuntimeError as error:
        raise ListenError(f"cannot listen on {address}: {_why(address) or error}") from None
    return address if address.is_unix else Address(address.host, port)


def _check_unix_path(address: Address) -> None:
    """Refuses a path where another program listens, whose socket gRPC would replace, or where there is no socket."""
    path = Path(address.host)
    try:
        if not stat.S_ISSOCK(path.lstat().st_mode):
            raise ListenError(f"cannot listen on {address}: there is a file that is no socket")
    except FileNotFoundError:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return  # a killed daemon left it
    raise ListenError(f"cannot listen on {address}: another program listens there")


def _why(address: Address) -> str | None:
    """Returns the system's own error for the address, which gRPC does not pass on."""
    try:
        if address.is_unix:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                probe.bind(address.host)
                Path(address.host).unlink()
            return None
        family, kind, protocol, _, name = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as gRPC does
            probe.bind(name)
            probe.listen()
    except socket.gaierror:
        return f"there is no host {address.host!r}"
    except OSError as error:
        if error.errno == errno.EADDRINUSE and not address.is_unix:
            who = _holder(address.port)
            return f"the port is in use{f' by {who}' if who else ''}; free it, or choose another with --listen"
        return os.strerror(error.errno or 0)
    return None


def _holder(port: int) -> str | None:
    """Returns the program that listens on a TCP port, where the system shows it (Linux: our own, or all to root)."""
    sockets = {f"socket:[{inode}]" for inode in _listening_inodes(port)}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if any(str(link.readlink()) in sockets for link in (process / "fd").iterdir()):
                words = os.fsdecode((process / "cmdline").read_bytes()).replace("\0", " ").split()
                return f"pid {process.name} ({' '.join(words):.120})"
        except OSError:
            continue  # another user's, or gone meanwhile
    return None


def _listening_inodes(port: int) -> Iterator[str]:
    listening = "0A"
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        try:
            lines = Path(table).read_text().splitlines()[1:]
        except OSError:
            continue
        for fields in map(str.split, lines):
            if fields[3] == listening and int(fields[1].rpartition(":")[2], 16) == port:
                yield fields[9]
