"""The links with real sockets and a pseudo-terminal, opened, broken and healed; time is moved by hand."""

import builtins
import contextlib
import errno
import fcntl
import itertools
import logging
import os
import socket
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from typing_extensions import override

from tests.conftest import open_terminal
from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.endless_link import EndlessLink
from tests.waiting import until
from ual_daemon.backends.hosts import Host
from ual_daemon.backends.mavlink.links import LinkConnection, make_link
from ual_daemon.backends.mavlink.links.base import READ_BATCH_BYTES, Chunk, LinkError
from ual_daemon.backends.mavlink.links.connection import LONGEST_RECONNECT_PAUSE_S, PEER_SILENCE_S
from ual_daemon.backends.mavlink.links.endpoints import Endpoint, SerialEndpoint, parse_url
from ual_daemon.settings import ConfigError

T = TypeVar("T")
PATIENCE_S = 20.0
HERE = "127.0.0.1"


PATIENCE = "ual_daemon.backends.hosts._LOOKUP_TIMEOUT_S"


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names are resolved at the first try, however busy the computer."""
    monkeypatch.setattr(PATIENCE, PATIENCE_S)


class Run:
    """A connection whose time is moved by hand; its polls are real."""

    def __init__(self, url: str, endpoint: Endpoint | None = None) -> None:
        self.now_s = 0.0
        self.got = b""
        self.connection = LinkConnection(make_link(endpoint or parse_url(url)), url)

    def step(self, passed_s: float = 0.0) -> bytes:
        """One step of the thread that receives. Returns what came."""
        self.now_s += passed_s
        self.connection.tick(self.now_s)
        data = b"".join(data for data, _ in self.connection.receive(0.01, self.now_s))
        self.connection.tick(self.now_s)
        self.got += data
        return data

    def until(self, condition: Callable[[], T], passed_s: float = 0.0) -> T:
        return until(condition, seen=lambda: self.got, between=lambda: self.step(passed_s))

    @property
    def connections_count(self) -> int:
        return self.connection.connections_count


@contextlib.contextmanager
def running(url: str) -> Iterator[Run]:
    run = Run(url)
    with contextlib.closing(run.connection):
        yield run


def listener(port: int = 0) -> socket.socket:
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind((HERE, port))
    sock.listen()
    sock.settimeout(PATIENCE_S)
    return sock


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with listener() as sock:
        yield sock


def url_of(server: socket.socket) -> str:
    return f"tcp://{HERE}:{server.getsockname()[1]}"


# --- TCP, we connect --------------------------------------------------------------------------------------------------


def test_tcp_carries_bytes_both_directions(server: socket.socket) -> None:
    with running(url_of(server)) as run:
        run.step()
        peer, _ = server.accept()
        with peer:
            run.until(lambda: run.connections_count)
            assert run.connection.send(b"there")
            assert peer.recv(100) == b"there"
            peer.sendall(b"and back")
            run.until(lambda: run.got == b"and back")


def test_a_server_that_is_not_there_yet_is_reported_once_and_found(caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()
    with caplog.at_level(logging.INFO), running(f"tcp://{HERE}:{port}") as run:
        for _ in range(20):
            run.step(1.0)
        assert run.connection.trouble == (f"cannot connect to TCP {HERE}:{port}: nobody listens there; trying again")
        assert run.connections_count == 0
        with listener(port):
            run.until(lambda: run.connections_count, passed_s=0.5)
            assert run.connection.trouble == ""
            run.connection.on_received(run.now_s + 0.1)
            assert run.connection.trouble == ""
    warnings = [record.message for record in caplog.records if record.levelno >= logging.WARNING]
    assert warnings == [f"cannot connect to TCP {HERE}:{port}: nobody listens there; trying again"]
    assert caplog.records[-1].message == f"the link tcp://{HERE}:{port} works again"


def test_a_server_that_restarts_is_connected_to_again(server: socket.socket) -> None:
    with running(url_of(server)) as run:
        for count in (1, 2, 3):
            run.until(lambda count=count: run.connections_count == count, passed_s=0.1)  # type: ignore[misc]
            peer, _ = server.accept()
            peer.sendall(b"x")
            run.until(lambda: run.got.endswith(b"x"))
            run.got = b""
            if count == 2:  # dies without a word: the reset comes as an error
                peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            peer.close()
            run.until(lambda: "connecting anew" in run.connection.trouble)
            assert not run.connection.send(b"lost")


def test_a_half_open_connection_shows_by_its_silence(server: socket.socket) -> None:
    with running(url_of(server)) as run:
        run.until(lambda: run.connections_count == 1)
        with server.accept()[0]:  # stays open and says nothing
            run.step(PEER_SILENCE_S - 0.1)
            run.connection.on_received(run.now_s)
            run.step(PEER_SILENCE_S - 0.1)
            assert run.connection.trouble == ""
            run.step(0.2)
            assert run.connection.trouble == f"nothing came from {url_of(server)} for 5 s; connecting anew"
            run.until(lambda: run.connections_count == 2, passed_s=0.1)


def fill(run: Run) -> int:
    """Sends to a peer that reads nothing, until nothing leaves any more. Returns the number of bytes taken."""
    frames = itertools.takewhile(lambda _: run.connection.send(b"f" * 64), itertools.repeat(64))
    return sum(frames)


def read_all(peer: socket.socket) -> int:
    """Reads until the connection ends, and returns how many bytes came."""
    peer.settimeout(PATIENCE_S)
    total = 0
    with contextlib.suppress(ConnectionResetError):
        while data := peer.recv(65536):
            total += len(data)
    return total


@contextlib.contextmanager
def stalled(kind: str) -> Iterator[tuple[Run, socket.socket]]:
    """A connection whose other end reads nothing, opened by us (tcp), or by it (tcpin)."""
    if kind == "tcpin":
        port = free_port()
        with running(f"tcpin://{HERE}:{port}") as run, socket.socket() as peer:
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            run.step()
            peer.connect((HERE, port))
            run.until(lambda: run.connections_count == 1)
            yield run, peer
        return
    with listener() as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        with running(url_of(server)) as run:
            run.until(lambda: run.connections_count == 1)
            with server.accept()[0] as peer:
                yield run, peer


@pytest.mark.parametrize("kind", ["tcp", "tcpin"])
def test_what_a_stalled_connection_holds_is_not_delivered_once_it_is_abandoned(kind: str) -> None:
    """It may be a landing, over the mode of a pilot who has taken over since."""
    with stalled(kind) as (run, peer):
        sent = fill(run)
        run.step(PEER_SILENCE_S + 0.1)
        assert read_all(peer) < sent


@pytest.mark.skipif(not hasattr(socket, "TCP_USER_TIMEOUT"), reason="only Linux ends such a connection by itself")
@pytest.mark.parametrize("kind", ["tcp", "tcpin"])
def test_the_system_ends_a_connection_that_takes_nothing(kind: str) -> None:
    with stalled(kind) as (run, peer):
        sent = fill(run)
        run.until(lambda: not run.connection.peer or "connecting anew" in run.connection.trouble)
        assert read_all(peer) < sent


def test_what_is_sent_before_a_link_is_closed_is_delivered(server: socket.socket) -> None:
    """The usual rates are restored last."""
    with running(url_of(server)) as run:
        run.until(lambda: run.connections_count == 1)
        peer, _ = server.accept()
        assert run.connection.send(b"the last")
    with peer:
        assert read_all(peer) == len(b"the last")


def test_the_pause_between_attempts_grows_and_is_short_again_after_it_went_well() -> None:
    port = free_port()
    with running(f"tcp://{HERE}:{port}") as run:
        attempts: list[float] = []
        opened = run.connection._link.open

        def open_and_note() -> None:
            attempts.append(run.now_s)
            opened()

        run.connection._link.open = open_and_note  # type: ignore[method-assign]
        for _ in range(300):
            run.step(0.05)
        pauses = [after - before for before, after in itertools.pairwise(attempts)]
        assert pauses[0] < 0.4
        assert all(after >= before - 0.1 for before, after in itertools.pairwise(pauses))
        assert pauses[-1] == pytest.approx(LONGEST_RECONNECT_PAUSE_S, abs=0.3)
        run.connection.on_received(run.now_s)
        attempts.clear()
        for _ in range(100):
            run.step(0.05)
        assert attempts[1] - attempts[0] < 0.4


def test_a_host_that_nobody_knows_is_reported() -> None:
    with running("tcp://no-such-host.invalid:5760") as run:
        run.step()
        assert run.connection.trouble.startswith("cannot find the host no-such-host.invalid: ")


def test_a_name_that_is_no_name_is_reported() -> None:
    with running("tcp://a..b:5760") as run:
        run.until(lambda: run.connection.trouble)
        assert run.connection.trouble == "cannot find the host a..b: that is no host name; trying again"


def test_a_slow_name_service_holds_nothing_up(monkeypatch: pytest.MonkeyPatch, server: socket.socket) -> None:
    answer = threading.Event()
    look_up = socket.getaddrinfo

    def slowly(_: str, *rest: Any, **named: Any) -> Any:
        assert answer.wait(PATIENCE_S)
        return look_up(HERE, *rest, **named)

    monkeypatch.setattr(socket, "getaddrinfo", slowly)
    monkeypatch.setattr(PATIENCE, 0.02)
    with running(f"tcp://uav.example:{server.getsockname()[1]}") as run:
        run.until(lambda: run.connection.trouble == "looking for the host uav.example")
        answer.set()
        run.until(lambda: run.connections_count == 1, passed_s=0.5)


def test_a_name_service_that_times_out_is_queried_again(monkeypatch: pytest.MonkeyPatch, server: socket.socket) -> None:
    def times_out(*_: Any, **__: Any) -> Any:
        raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

    look_up = socket.getaddrinfo

    def answers(_: str, *args: Any, **kwargs: Any) -> Any:
        return look_up(HERE, *args, **kwargs)

    monkeypatch.setattr(socket, "getaddrinfo", answers)
    with running(f"tcp://uav.example:{server.getsockname()[1]}") as run:
        with monkeypatch.context() as patch:
            patch.setattr(socket, "getaddrinfo", times_out)
            run.until(lambda: "Connection timed out; trying again" in run.connection.trouble, passed_s=0.5)
        run.until(lambda: run.connections_count == 1, passed_s=0.5)


@pytest.mark.parametrize("scheme", ["tcp", "udpin"])
def test_a_system_that_has_no_socket_left_is_reported_and_tried_again(
    scheme: str, monkeypatch: pytest.MonkeyPatch, server: socket.socket
) -> None:
    port = server.getsockname()[1] if scheme == "tcp" else free_port()
    make = socket.socket

    def none_left(*_: Any) -> Any:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with running(f"{scheme}://{HERE}:{port}") as run:
        monkeypatch.setattr(socket, "socket", none_left)
        run.until(lambda: run.connection.trouble)
        assert run.connection.trouble == f"{scheme}://{HERE}:{port}: Too many open files; trying again"
        monkeypatch.setattr(socket, "socket", make)
        run.until(lambda: "Too many" not in run.connection.trouble, passed_s=0.5)


def test_who_does_not_read_gets_no_old_setpoints_and_whole_frames_only(server: socket.socket) -> None:
    setpoint, command = b"s" * 70, b"c" * 40
    with running(url_of(server)) as run:
        run.step()
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        peer, _ = server.accept()
        with peer:
            run.until(lambda: run.connections_count)
            sent = 0
            begin_s = time.monotonic()
            for _ in range(20_000):
                sent += 70 * run.connection.send(setpoint, is_perishable=True)
            for _ in range(20_000):
                sent += 40 * run.connection.send(command)
            assert time.monotonic() - begin_s < PATIENCE_S
            assert not run.connection.send(setpoint, is_perishable=True)
            peer.settimeout(0.5)
            got = b""
            with contextlib.suppress(TimeoutError):
                while chunk := peer.recv(65536):
                    got += chunk
                    run.connection.send(b"", is_perishable=False)  # flushes what was begun
            assert len(got) == sent
            assert got.replace(setpoint, b"").replace(command, b"") == b""


# --- TCP, they connect ------------------------------------------------------------------------------------------------


def connect(port: int) -> socket.socket:
    return socket.create_connection((HERE, port), PATIENCE_S)


def test_tcpin_lets_one_connect_and_after_it_the_next() -> None:
    port = free_port()
    with running(f"tcpin://{HERE}:{port}") as run:
        run.step()
        for count in (1, 2):
            with connect(port) as peer:
                run.until(lambda count=count: run.connections_count == count)  # type: ignore[misc]
                peer.sendall(b"hello")
                run.until(lambda: run.got == b"hello")
                assert run.connection.send(b"you")
                assert peer.recv(10) == b"you"
                run.got = b""
            run.until(lambda: run.connection.peer is None)
            assert not run.connection.send(b"nobody")


def test_a_second_one_is_refused_while_the_first_sends_and_let_in_when_it_is_silent() -> None:
    port = free_port()
    with running(f"tcpin://{HERE}:{port}") as run:
        run.step()
        with connect(port) as first:
            run.until(lambda: run.connections_count == 1)
            with connect(port) as second:
                run.step(1.0)
                run.step()
                assert second.recv(10) == b""
            first.sendall(b"x")
            run.until(lambda: run.got == b"x")
            with connect(port) as third:
                run.now_s += 2.0
                run.until(lambda: run.connections_count == 2)
                assert run.connection.send(b"hello")
                assert third.recv(10) == b"hello"


def test_a_silent_one_is_hung_up_on() -> None:
    port = free_port()
    with running(f"tcpin://{HERE}:{port}") as run:
        run.step()
        with connect(port) as peer:
            run.until(lambda: run.connections_count == 1)
            run.step(PEER_SILENCE_S + 0.1)
            with pytest.raises(ConnectionResetError):
                peer.recv(10)
        assert run.connection.peer is None
        with connect(port):
            run.until(lambda: run.connections_count == 2)


def test_a_taken_tcp_port_is_reported_and_taken_when_it_is_free() -> None:
    with listener() as other:
        port = other.getsockname()[1]
        run_of_port = running(f"tcpin://{HERE}:{port}")
        with run_of_port as run:
            run.step()
            assert run.connection.trouble == (
                f"cannot listen at TCP {HERE}:{port}: Address already in use; trying again "
                "(does another program use this port?)"
            )
            other.close()
            run.until(lambda: run.connection._is_open, passed_s=0.5)
            with connect(port):
                run.until(lambda: run.connections_count == 1)


# --- Serial lines -----------------------------------------------------------------------------------------------------


class LinkStub:
    """A pseudo-terminal at a fixed path, that can be plugged in and out."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.device = -1

    def plug(self) -> None:
        self.device, theirs = open_terminal()
        self.path.symlink_to(os.ttyname(theirs))
        os.close(theirs)

    def unplug(self) -> None:
        os.close(self.device)
        self.path.unlink()


@pytest.fixture
def serial_link_stub(tmp_path: Path) -> LinkStub:
    return LinkStub(tmp_path / "ttyACM0")


@contextlib.contextmanager
def running_serial(serial_link_stub: LinkStub) -> Iterator[Run]:
    run = Run("serial", SerialEndpoint(str(serial_link_stub.path), 57600))
    with contextlib.closing(run.connection):
        yield run


def test_a_serial_link_carries_bytes_as_they_are(serial_link_stub: LinkStub) -> None:
    serial_link_stub.plug()
    everything = bytes(range(256))
    with running_serial(serial_link_stub) as run:
        run.step()
        os.write(serial_link_stub.device, everything)
        run.until(lambda: run.got == everything)
        assert run.connection.send(everything)
        got = b""
        while len(got) < 256:
            got += os.read(serial_link_stub.device, 1000)
        assert got == everything
    serial_link_stub.unplug()


def test_a_device_that_comes_goes_and_comes_again(serial_link_stub: LinkStub, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING), running_serial(serial_link_stub) as run:
        for _ in range(5):
            run.step(1.0)
        missing = f"cannot open {serial_link_stub.path}: there is no such device (is it plugged in?); trying again"
        assert run.connection.trouble == missing
        for count in (1, 2):
            serial_link_stub.plug()
            run.until(lambda count=count: run.connections_count == count, passed_s=0.5)  # type: ignore[misc]
            os.write(serial_link_stub.device, b"hello")
            run.until(lambda: run.got == b"hello")
            run.connection.on_received(run.now_s + 0.1)
            run.got = b""
            serial_link_stub.unplug()
            run.until(lambda: run.connection.trouble)
            run.step(1.0)
            run.step(5.0)
    gone = f"{serial_link_stub.path} is gone (unplugged?); opening it anew"
    assert [record.message for record in caplog.records] == [missing, gone, missing, gone, missing]


def test_what_was_received_before_it_broke_does_not_tell_that_it_works_again(serial_link_stub: LinkStub) -> None:
    serial_link_stub.plug()
    with running_serial(serial_link_stub) as run:
        run.until(lambda: run.connections_count == 1)
        heard_s = run.now_s + 0.5
        run.now_s += 1.0
        serial_link_stub.unplug()
        run.until(lambda: run.connection.trouble)
        trouble = run.connection.trouble
        run.connection.on_received(heard_s)  # the last message, which the caller notes only now
        assert run.connection.trouble == trouble


def test_a_row_that_is_unplugged_while_it_is_opened_is_reported(
    serial_link_stub: LinkStub, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: Any) -> Any:
        raise termios.error(errno.EIO, os.strerror(errno.EIO))

    serial_link_stub.plug()
    with running_serial(serial_link_stub) as run:
        with monkeypatch.context() as patch:
            patch.setattr(termios, "tcflush", gone)
            run.until(lambda: run.connection.trouble.endswith("Input/output error; trying again"))
        run.until(lambda: run.connections_count == 1, passed_s=0.5)
    serial_link_stub.unplug()


def test_a_row_that_another_program_uses_is_reported(serial_link_stub: LinkStub) -> None:
    serial_link_stub.plug()
    other = os.open(serial_link_stub.path, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX)
    with running_serial(serial_link_stub) as run:
        run.step()
        assert run.connection.trouble == f"cannot open {serial_link_stub.path}: another program uses it; trying again"
        os.close(other)
        run.until(lambda: run.connections_count, passed_s=1.0)
    serial_link_stub.unplug()


def test_a_row_that_nobody_reads_holds_nothing_up_and_sends_whole_frames(serial_link_stub: LinkStub) -> None:
    serial_link_stub.plug()
    frame = b"0123456789" * 5
    with running_serial(serial_link_stub) as run:
        run.step()
        taken = sum(run.connection.send(frame) for _ in range(5000))
        assert 0 < taken < 5000
        os.set_blocking(serial_link_stub.device, False)
        got = b""
        for _ in range(200):
            with contextlib.suppress(BlockingIOError):
                got += os.read(serial_link_stub.device, 65536)
            run.connection.send(b"")
        assert got == frame * taken
    serial_link_stub.unplug()


def test_what_cannot_be_opened_as_a_row_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"")
    connection = LinkConnection(make_link(SerialEndpoint(str(path), 57600)), "serial")
    with contextlib.closing(connection):
        connection.tick(0.0)
        assert connection.trouble.startswith(f"cannot open {path}: ")
        assert "\n" not in connection.trouble


def test_without_pyserial_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name == "serial":
            raise ImportError(name)
        return original(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ConfigError, match=r"pip install 'ual-daemon\[serial\]'"):
        make_link(parse_url("/dev/ttyACM0:57600"))


# --- Waiting ----------------------------------------------------------------------------------------------------------


def test_waking_ends_the_wait() -> None:
    with running(f"udpin://{HERE}:{free_port()}") as run:
        run.step()
        run.connection.wake()
        begin_s = time.monotonic()
        assert run.connection.receive(PATIENCE_S, 0.0) == []
        assert time.monotonic() - begin_s < PATIENCE_S / 2


def test_a_flood_of_datagrams_is_received_in_bounded_batches_and_none_is_lost_to_the_bound() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HERE, 0))
        port = taken.getsockname()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, running(f"udpin://{HERE}:{port}") as run:
        run.step()
        for size, sent in ((1400, 30), (10, 300), (0, 100)):
            for _ in range(sent):
                sender.sendto(b"x" * size, (HERE, port))
            batches = []
            while batch := run.connection.receive(0.1, 0.0):
                batches.append(batch)
            assert sum(map(len, batches)) == sent
            for batch in batches:
                assert len(batch) <= 64
                assert sum(len(data) for data, _ in batch) <= READ_BATCH_BYTES + size


def test_a_flood_on_a_stream_is_received_in_bounded_pieces() -> None:
    with socket.create_server((HERE, 0)) as server, running(f"tcpout://{HERE}:{server.getsockname()[1]}") as run:
        run.until(lambda: run.connections_count)
        peer, _ = server.accept()
        with peer:
            peer.sendall(b"x" * 100_000)
            pieces: list[bytes] = []
            run.until(lambda: pieces.append(run.step()) or len(run.got) == 100_000)  # type: ignore[func-returns-value]
            assert max(map(len, pieces)) <= READ_BATCH_BYTES


class Endless(EndlessLink):
    """Garbage without an end."""

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        self.batches_count += 1
        assert self.batches_count < 10_000, "it never ends"
        return [(b"\xfd\xff\x00" * 1000, None)]


def test_discarding_what_has_arrived_ends_though_there_is_always_more() -> None:
    link = Endless()
    with contextlib.closing(LinkConnection(link, "test")) as connection:
        connection.discard(0.0)
        assert 100 < link.batches_count <= 1000


def test_a_numeric_address_is_not_looked_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Host, "_resolve", lambda *_: pytest.fail("looked up"))
    for name in ("127.0.0.1", "::1"):
        _, address = Host(name, 14540, socket.SOCK_DGRAM, LinkError).address()
        assert address[:2] == (name, 14540)
