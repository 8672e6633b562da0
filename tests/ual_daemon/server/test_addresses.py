from __future__ import annotations

import asyncio
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from ual_daemon.server.addresses import Address, ListenError, bind, parse
from ual_daemon.server.transport import selection
from ual_daemon.server.transport.selection import Choice
from ual_daemon.settings import ConfigError


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("127.0.0.1:50051", Address("127.0.0.1", 50051)),
        ("localhost:0", Address("localhost", 0)),
        ("[::1]:50051", Address("::1", 50051)),
        ("uav-1.lan:65535", Address("uav-1.lan", 65535)),
        ("unix:/run/ual.sock", Address("/run/ual.sock", 0, is_unix=True)),
        ("unix:///run/ual.sock", Address("/run/ual.sock", 0, is_unix=True)),
        ("unix:ual.sock", Address("ual.sock", 0, is_unix=True)),
    ],
)
def test_addresses_are_read(text: str, address: Address) -> None:
    assert parse(text) == address
    assert parse(str(address)) == address


@pytest.mark.parametrize("text", ["", "50051", ":50051", "127.0.0.1", "h:65536", "h:-1", "::1:50051", "a b:1", "unix:"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(text)
    assert caught.value.key == "listen"


def test_a_unix_path_too_long_for_the_system_is_refused() -> None:
    with pytest.raises(ConfigError, match="1 to 107 bytes"):
        parse("unix:/" + "x" * 107)


@pytest.mark.parametrize(
    ("text", "is_local"),
    [
        ("127.0.0.1:1", True),
        ("127.1.2.3:1", True),
        ("[::1]:1", True),
        ("localhost:1", True),
        ("unix:/x", True),
        ("0.0.0.0:1", False),
        ("[::]:1", False),
        ("192.168.1.5:1", False),
        ("localhost.example:1", False),
    ],
)
def test_only_loopback_and_unix_are_local(text: str, is_local: bool) -> None:
    assert parse(text).is_local is is_local


def try_to_bind(choice: Choice, address: Address) -> Address:
    async def run() -> Address:
        transport = await selection.choose(choice)
        server = transport.server([("grpc.so_reuseport", 0)], lambda _: None)
        try:
            bound = bind(server, address, None)
            await server.start()
            return bound
        finally:
            assert await server.stop(30.0)
            transport.close()

    return asyncio.run(run())


def test_any_port_becomes_the_one_it_got(transport: Choice) -> None:
    assert try_to_bind(transport, Address("127.0.0.1", 0)).port > 0


def test_a_port_in_use_says_by_whom(transport: Choice) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            ListenError, match=rf"cannot listen on 127\.0\.0\.1:{port}: the port is in use by pid {os.getpid()} \("
        ):
            try_to_bind(transport, Address("127.0.0.1", port))


def test_a_holder_whose_command_has_several_rows_is_named_in_one(transport: Choice) -> None:
    program = (
        "import socket\ns = socket.create_server(('127.0.0.1', 0))\nprint(s.getsockname()[1], flush=True)\ns.accept()"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        port = int(holder.stdout.readline())
        with pytest.raises(ListenError, match=rf"by pid {holder.pid} \(") as refused:
            try_to_bind(transport, Address("127.0.0.1", port))
        holder.kill()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("address", "why"),
    [
        (Address("192.0.2.1", 50051), "Cannot assign requested address"),
        (Address("no-such-host.invalid", 50051), "there is no host 'no-such-host.invalid'"),
        (Address("/no/such/directory/ual.sock", 0, is_unix=True), "No such file or directory"),
    ],
)
def test_an_address_that_is_not_here_says_why(transport: Choice, address: Address, why: str) -> None:
    with pytest.raises(ListenError, match=f"cannot listen on .*: {why}"):
        try_to_bind(transport, address)


def test_a_unix_socket_in_use_is_not_taken_over(transport: Choice, tmp_path: Path) -> None:
    path = tmp_path / "ual.sock"
    with socket.socket(socket.AF_UNIX) as taken:
        taken.bind(str(path))
        taken.listen()
        with pytest.raises(ListenError, match="another program listens there"):
            try_to_bind(transport, Address(str(path), 0, is_unix=True))
    # Now it is what a killed daemon leaves.
    assert stat.S_ISSOCK(path.stat().st_mode)
    try_to_bind(transport, Address(str(path), 0, is_unix=True))


def test_a_file_instead_of_a_unix_socket_stays(transport: Choice, tmp_path: Path) -> None:
    path = tmp_path / "ual.sock"
    path.write_text("precious")
    with pytest.raises(ListenError, match="there is a file that is no socket"):
        try_to_bind(transport, Address(str(path), 0, is_unix=True))
    assert path.read_text() == "precious"
