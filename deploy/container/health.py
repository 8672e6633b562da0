#!/opt/ual/bin/python -IS
"""Exit status 0 if the daemons that are registered here serve (grpc.health.v1): all of them, or that of UAL_NS.

A container runs this again and again beside a flight, so it starts with the fewest modules and speaks HTTP/2 by itself:
a tenth of the processor that `grpc` takes to be imported. The one request is always the same.
"""

from __future__ import annotations

import _socket  # what `socket` wraps: to load that takes as long as Python itself does
import fcntl
import os
import sys
import time

LIMIT_S = 3.0
"""Of an answer as a whole, however its bytes come."""
LONGEST_FRAME = 1 << 14
"""Bytes, as RFC 9113 (4.2) has it where nothing else was agreed."""
LONGEST_FILE = 4096
UNTRUSTED = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
"""Flags for a file that any user may have put there."""
DATA, HEADERS, SETTINGS, PING, GO_AWAY = 0, 1, 4, 6, 7
ACKNOWLEDGED, END_OF_STREAM, END_OF_HEADERS = 1, 1, 4
STREAM = 1
STATUS = {b"": "UNKNOWN", b"\x08\x00": "UNKNOWN", b"\x08\x01": "SERVING", b"\x08\x02": "NOT_SERVING"}
"""HealthCheckResponse on the wire, field 1."""


def frame(kind: int, flags: int, stream: int, payload: bytes) -> bytes:
    """Returns a frame of HTTP/2: RFC 9113, 4.1."""
    return len(payload).to_bytes(3, "big") + bytes((kind, flags)) + stream.to_bytes(4, "big") + payload


def field(name: bytes, value: bytes) -> bytes:
    """Returns a header field as a literal: RFC 7541, 6.2.2."""
    return bytes((0, len(name))) + name + bytes((len(value),)) + value


REQUEST = (
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
    + frame(SETTINGS, 0, 0, b"")
    + frame(
        HEADERS,
        END_OF_HEADERS,
        STREAM,
        field(b":method", b"POST")
        + field(b":scheme", b"http")
        + field(b":path", b"/grpc.health.v1.Health/Check")
        + field(b":authority", b"localhost")
        + field(b"content-type", b"application/grpc")
        + field(b"te", b"trailers"),
    )
    # A message of gRPC: not compressed, of no bytes.
    + frame(DATA, END_OF_STREAM, STREAM, bytes(5))
)


def received(connection: _socket.socket, count: int, end_s: float) -> bytes:
    """Returns so many bytes, which come until `end_s` by `time.monotonic`.

    Raises:
        OSError: The connection has ended, or they did not come in time.

    """
    parts = bytearray()
    while len(parts) < count:
        left_s = end_s - time.monotonic()
        if left_s <= 0.0:
            raise TimeoutError("timed out")
        connection.settimeout(left_s)
        part = connection.recv(count - len(parts))
        if not part:
            raise ConnectionError("it ended the connection")
        parts += part
    return bytes(parts)


def connected(address: str) -> _socket.socket:
    """Returns a connection to an address.

    Raises:
        OSError: There is none.

    """
    if address.startswith("unix:"):
        connection = _socket.socket(_socket.AF_UNIX)
        where: str | tuple[object, ...] = address.removeprefix("unix:")
    else:
        host, _, port = address.rpartition(":")
        # As bytes: text would load the codec of international names.
        found = _socket.getaddrinfo(host.strip("[]").encode(), int(port), type=_socket.SOCK_STREAM)
        family, kind, protocol, _, where = found[0]
        connection = _socket.socket(family, kind, protocol)
    connection.settimeout(LIMIT_S)
    try:
        connection.connect(where)
    except OSError:
        connection.close()
        raise
    return connection


def status(address: str) -> str:
    """Returns what the daemon at an address says of itself.

    Raises:
        OSError: It does not answer.

    """
    end_s = time.monotonic() + LIMIT_S
    connection = connected(address)
    try:
        connection.sendall(REQUEST)
        answer = bytearray()
        while True:
            head = received(connection, 9, end_s)
            length, kind, flags = int.from_bytes(head[:3], "big"), head[3], head[4]
            if length > LONGEST_FRAME:
                raise ConnectionError("it does not speak HTTP/2: TLS? Give it a `--listen unix:PATH` more")
            payload = received(connection, length, end_s)
            if kind == SETTINGS and not flags & ACKNOWLEDGED:
                connection.sendall(frame(SETTINGS, ACKNOWLEDGED, 0, b""))
            elif kind == PING and not flags & ACKNOWLEDGED:
                connection.sendall(frame(PING, ACKNOWLEDGED, 0, payload))
            elif kind == DATA:
                answer += payload
                if len(answer) >= 5 and len(answer) == 5 + int.from_bytes(answer[1:5], "big"):
                    return STATUS.get(bytes(answer[5:]), "UNKNOWN")
            elif kind == GO_AWAY or (kind == HEADERS and flags & END_OF_STREAM):
                raise ConnectionError("it refuses the call")
    finally:
        connection.close()


def is_running(ns: str, directory: str) -> bool:
    """Returns whether a daemon holds the lock of a namespace, as in `ual.discovery`."""
    try:
        handle = os.open(f"{directory}/{ns}.lock", UNTRUSTED)
    except OSError:
        return True  # only an answer can tell
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def registered(file: str, user: str) -> tuple[str, int] | None:
    """Returns the address and the process in a registration, None where the file is none.

    `user` is the number in its name, of whom it has to be; empty: anybody.
    """
    try:
        handle = os.open(file, UNTRUSTED)
    except OSError:
        return None
    try:
        text = os.read(handle, LONGEST_FILE).decode("utf-8", "replace")
        owner = os.fstat(handle).st_uid
    except OSError:
        return None
    finally:
        os.close(handle)
    _, found, rest = text.partition('"address": "')
    address, closed, _ = rest.partition('"')
    if not (found and closed and address.isprintable() and "\\" not in address) or user not in ("", str(owner)):
        return None
    pid = text.partition('"pid": ')[2].partition(",")[0]
    return address, int(pid) if pid.isdecimal() else 0


def has_process(pid: int) -> bool:
    """Returns whether a process is there, whoever has it."""
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return pid > 0


def address_of(ns: str, files: list[str], directory: str) -> str | None:
    """Returns where the daemon of a namespace is, as in `ual.discovery`: one that was killed may have left a file."""
    told = [registered(f"{directory}/{each}", each.removesuffix(".json").partition(".")[2]) for each in files]
    found = [each for each in told if each is not None]
    if len(found) > 1:
        found.sort(key=lambda each: not has_process(each[1]))
    return found[0][0] if found and is_running(ns, directory) else None


def is_serving(address: str) -> bool:
    """Returns whether the daemon at an address says that it serves."""
    try:
        said = status(address)
    except (OSError, ValueError) as error:
        said = str(error)
    if said != "SERVING":
        print(f"{address}: {said}", file=sys.stderr)
    return said == "SERVING"


def main() -> None:
    """Asks the daemons."""
    directory, ns = os.environ.get("UAL_RUNTIME_DIR") or "/tmp/ual", os.environ.get("UAL_NS")  # noqa: S108
    try:
        files = os.listdir(directory)  # noqa: PTH208  # pathlib takes as long to load as all else here
    except OSError:
        files = []
    names: dict[str, list[str]] = {}
    for each in sorted(files):
        # ``uav_1.json``, and ``uav_1.10001.json`` where another user's file has that name.
        if each.endswith(".json") and ns in (None, each.partition(".")[0]):
            names.setdefault(each.partition(".")[0], []).append(each)
    found = [address_of(each, names[each], directory) for each in names]
    verdicts = [is_serving(address) for address in found if address is not None]
    if not verdicts:
        sys.exit("no daemon is registered")
    sys.exit(0 if all(verdicts) else 1)


if __name__ == "__main__":
    main()
