"""Corrections from a caster of pygnssutils and from a TCP port, by `ual rtcm` and a daemon, to simulated autopilots."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from queue import Queue

import pytest
from click.testing import CliRunner, Result
from pygnssutils import socket_server
from typing_extensions import Self

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.rtcm import message, messages
from tests.simulators import flying
from tests.simulators.satellite_receiver import SatelliteReceiver
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.corrections import CorrectionsStatus
from ual.errors import ResourceExhaustedError
from ual.types import State
from ual_tools.main import cli

UAL = "from ual_tools.main import main; main()"
SENT = messages([25, 180, 360, 540, 720, 333, 179, 181, 700, 19])


@pytest.fixture(params=["px4", "ardupilot"])
def vehicle(request: pytest.FixtureRequest) -> Iterator[Vehicle]:
    vehicle = vehicle_of(request.param)
    with flying(vehicle.autopilot):
        yield vehicle


@pytest.fixture
def daemon(vehicle: Vehicle, start_daemon: StartDaemon) -> DaemonProcess:
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_DISARMED)
    return daemon


class Running:
    """`ual rtcm`, until it is interrupted as by Ctrl-C."""

    def __init__(self, daemon: DaemonProcess, *words: str, **environment: str) -> None:
        command = [sys.executable, "-c", UAL, "--address", daemon.address, "--json", "rtcm", "--status", "0.1", *words]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | environment
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self.process:  # closes its outputs
            self.process.kill()

    def reported(self) -> str:
        """Returns the next text line."""
        assert self.process.stderr is not None
        return self.process.stderr.readline()

    def interrupt(self) -> tuple[list[dict[str, object]], str]:
        """Returns the printed objects, and text lines."""
        self.process.send_signal(signal.SIGINT)
        out, told = self.process.communicate(timeout=LIMIT_S)
        return [json.loads(line) for line in out.splitlines()], told


@contextmanager
def caster(password: str = "secret") -> Iterator[tuple[int, Queue[bytes]]]:
    """A caster of pygnssutils: its port, and the queue out of which it sends."""
    queue: Queue[bytes] = Queue()
    server = socket_server.SocketServer(
        None, 1, 5, queue, ("127.0.0.1", 0), socket_server.ClientHandler, ntripuser="ann", ntrippassword=password
    )
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server.server_address[1], queue
    finally:
        server.shutdown()
        server.server_close()
        queue.put(b"")  # its thread waits for one


def has_age(uav: ual.Uav) -> bool:
    gps = uav.telemetry().gps
    return gps is not None and gps.corrections_age_s is not None


def repeating(put: Callable[[], object], condition: Callable[[], object]) -> None:
    """Puts something again and again until a condition holds: what is sent before somebody listens is lost."""
    until(lambda: condition() or put(), "the first message", between=lambda: threading.Event().wait(0.1))


def test_what_a_caster_sends_reaches_the_receiver_whole_and_in_order(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    receiver, beacon = vehicle.autopilot.receiver, message(60, 99)
    with ExitStack() as stack, caster() as (port, queue):
        url = f"ntrip://ann@127.0.0.1:{port}/pygnssutils"
        running = stack.enter_context(Running(daemon, "--ntrip", url, UAL_NTRIP_PASSWORD="secret"))
        repeating(lambda: queue.put(beacon), lambda: receiver.messages)
        for each in SENT:
            queue.put(each)
        until(lambda: SENT[-1] in receiver.messages, "the messages", seen=lambda: list(map(len, receiver.messages)))
        printed, told = running.interrupt()
    beacons_count = receiver.messages.count(beacon)
    assert receiver.messages == [beacon] * beacons_count + SENT
    assert b"".join(receiver.pieces) == b"".join(receiver.messages)
    assert f"corrections come from 127.0.0.1:{port}/pygnssutils" in told
    assert "secret" not in told
    assert printed[-1]["done"] == "rtcm"
    with ual.Uav(address=daemon.address) as uav:
        until(lambda: has_age(uav), "their age")
        status = uav.corrections.status()
    assert status.bytes_count == sum(map(len, receiver.messages))
    assert (status.dropped_count, status.too_long_count, status.skipped_bytes_count) == (0, 0, 0)


@pytest.mark.parametrize("vehicle", ["px4"], indirect=True)
def test_a_caster_that_refuses_is_reported_and_a_wrong_mount_point_ends_it(daemon: DaemonProcess) -> None:
    with caster() as (port, _):
        wrong = ual_rtcm(daemon, "--ntrip", f"ntrip://ann:secret@127.0.0.1:{port}/NOWHERE")
        assert (wrong.exit_code, "has no mount point NOWHERE (it has pygnssutils)" in wrong.output) == (1, True)
        with Running(daemon, "--ntrip", f"ntrip://ann:wrong@127.0.0.1:{port}/pygnssutils") as running:
            told = running.reported()
    assert "401 Unauthorized" in told
    assert "trying again in" in told


class Caster:
    """A caster of our own that wants to know where the UAV is, and keeps what it is told."""

    TABLE = b"STR;NEAR;x;RTCM 3.3;1005;2;GPS;x;ESP;37.4;-6.0;1;0;x;none;B;N;0;\r\nENDSOURCETABLE\r\n"

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.requests: list[str] = []
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)  # to close it would not end `accept`
        self._thread.join()
        self._listening.close()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listening.accept()
            except OSError:
                return
            with connection:
                request = connection.recv(4096).decode()
                self.requests.append(request)
                is_table = request.startswith("GET / ")
                kind = b"gnss/sourcetable" if is_table else b"gnss/data"
                connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: " + kind + b"\r\n\r\n")
                connection.sendall(self.TABLE if is_table else b"")


def test_a_caster_that_wants_to_know_learns_where_the_uav_is(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    with closing(Caster()) as near, ual.Uav(address=daemon.address) as uav:
        place = until(lambda: uav.telemetry().position_geo, "its place on Earth")
        with Running(daemon, "--ntrip", f"ntrip://127.0.0.1:{near.port}/NEAR"):
            until(lambda: len(near.requests) > 1, "the request")
    [line] = [each for each in near.requests[1].splitlines() if each.startswith("Ntrip-GGA: $GPGGA")]
    fields = line.split(",")
    degrees, minutes = int(fields[2][:2]), float(fields[2][2:])
    assert place is not None
    sign = 1.0 if fields[3] == "N" else -1.0
    assert sign * (degrees + minutes / 60.0) == pytest.approx(place.latitude_deg, abs=1e-4)
    assert float(fields[9]) == pytest.approx(place.altitude_amsl_m or 0.0, abs=1.0)
    del vehicle


def ual_rtcm(daemon: DaemonProcess, *words: str) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, "rtcm", *words])


def is_received(receiver: SatelliteReceiver, sent: list[bytes]) -> bool:
    return receiver.messages == sent


@pytest.mark.parametrize("vehicle", ["px4"], indirect=True)
def test_a_base_at_a_tcp_port_that_closes_is_connected_to_again(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    receiver = vehicle.autopilot.receiver
    with ExitStack() as stack, closing(socket.create_server(("127.0.0.1", 0))) as base:
        port = base.getsockname()[1]
        running = stack.enter_context(Running(daemon, "--tcp", f"127.0.0.1:{port}"))
        for sent in (SENT[:1], SENT[:2]):
            connection, _ = base.accept()
            connection.sendall(sent[-1] + sent[-1][:10])
            until(partial(is_received, receiver, sent), "the message")
            connection.close()
        _, told = running.interrupt()
    assert receiver.messages == SENT[:2]
    assert f"127.0.0.1:{port}: the other end has closed it; trying again in 1 s" in told


@pytest.mark.parametrize("vehicle", ["ardupilot"], indirect=True)
def test_both_clients_stream_and_a_second_one_hears_who_sends(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    receiver, first, second = vehicle.autopilot.receiver, SENT[1], SENT[2]

    async def from_base(refused: list[ResourceExhaustedError]) -> AsyncIterator[bytes]:
        yield first
        with ual.Uav(address=daemon.address) as other:
            until(lambda: other.corrections.status().sender == "the caster", "its turn")
            with pytest.raises(ResourceExhaustedError, match="the caster sends them already") as error:
                other.corrections.stream(iter([second]), "a serial base")
        refused.append(error.value)
        yield second

    async def send() -> tuple[CorrectionsStatus, list[ResourceExhaustedError]]:
        refused: list[ResourceExhaustedError] = []
        async with ual.aio.Uav(address=daemon.address) as uav:
            return await uav.corrections.stream(from_base(refused), "the caster"), refused

    status, [refused] = asyncio.run(send())
    assert refused.metadata["held_by"] == "the caster"
    assert status.sender == ""
    with ual.Uav(address=daemon.address) as uav, uav.lease("another program"):
        uav.corrections.stream([SENT[3][:100], SENT[3][100:]])
        until(partial(is_received, receiver, [first, second, SENT[3]]), "the messages", seen=uav.corrections.status)
        assert uav.corrections.status().messages_count == 3


def test_what_the_source_of_a_program_raises_is_raised_to_it(start_daemon: StartDaemon) -> None:
    def unplugged() -> Iterator[bytes]:
        yield message(50)
        raise OSError("unplugged")

    async def unplugged_too() -> AsyncIterator[bytes]:
        for each in unplugged():
            yield each

    async def send(address: str) -> None:
        async with ual.aio.Uav(address=address) as uav:
            await uav.corrections.stream(unplugged_too())

    daemon = start_daemon()
    with ual.Uav(address=daemon.address) as uav:
        with pytest.raises(OSError, match="unplugged"):
            uav.corrections.stream(unplugged())
        with pytest.raises(OSError, match="unplugged"):
            asyncio.run(send(daemon.address))
        until(lambda: uav.corrections.status().sender == "", "the end")
        assert uav.corrections.status().messages_count == 2  # a light UAV counts them
        until(lambda: has_age(uav), "their age")


def test_wrong_words_are_refused(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    for words, why in (
        ((), "give one of --serial, --tcp and --ntrip"),
        (("--tcp", "h:1", "--serial", "x"), "give one of"),
        (("--tcp", "host"), "is not HOST:PORT"),
        (("--tcp", "host:0"), "is not HOST:PORT"),
        (("--serial", "/dev/x:fast"), "is not PORT or PORT:BAUD"),
        (("--ntrip", "http://u:secret@h/m"), "no address of a mount point"),
        (("--ntrip", "ntrip://u:secret@h:99999/m"), "no address of a mount point"),
        (("--ntrip", "ntrip://u:secret@h"), "no address of a mount point"),
    ):
        refused = ual_rtcm(daemon, *words)
        assert refused.exit_code in (1, 2), words
        assert why in refused.output, words
        assert "secret" not in refused.output


def test_without_the_extra_it_is_named(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    daemon = start_daemon()
    monkeypatch.setitem(sys.modules, "serial", None)
    assert "pip install 'ual-tools[rtk]'" in ual_rtcm(daemon, "--serial", "/dev/x").output
