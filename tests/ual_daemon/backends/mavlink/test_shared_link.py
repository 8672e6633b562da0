"""Several vehicles behind one link: a port to which they send, and a router to which one connects."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial

import pytest
from pymavlink.dialects.v20 import all as mavlink
from typing_extensions import override

from tests.ports import free_port
from tests.simulators import ArduPilot, Autopilot, Px4
from tests.simulators.ports import Port, TcpPort, UdpPort
from tests.simulators.runner import flying
from tests.ual_daemon.backends.mavlink.fakes import heartbeat, packer, position
from tests.waiting import until
from ual.geometry import Vector3
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.link_watch import LinkWatchState
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.links import make_link
from ual_daemon.backends.mavlink.links.base import READ_BATCH_BYTES
from ual_daemon.backends.mavlink.links.endpoints import parse_url
from ual_daemon.backends.mavlink.wire import shared_link
from ual_daemon.backends.mavlink.wire.shared_link import QUEUE_BYTES, SharedLink, VehicleLink
from ual_daemon.backends.values import VelocitySetpoint
from ual_daemon.settings import ConfigError

HERE = "127.0.0.1"
SETPOINT = VelocitySetpoint(Vector3(1.0, 0.0, 0.0))
OWN_ID = 191
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
KINDS: dict[int, type[Px4 | ArduPilot]] = {1: Px4, 2: ArduPilot, 3: Px4}
"""The autopilots by system id."""


class Router:
    """One connection for all autopilots. What comes through it goes to each of them, as on a radio."""

    def __init__(self) -> None:
        self.inboxes: list[list[bytes]] = []
        self.lock = threading.Lock()
        self._tcp: TcpPort | None = TcpPort()
        self.address = self._tcp.address

    def end(self) -> None:
        """Nobody listens any more."""
        with self.lock:
            if self._tcp is not None:
                self._tcp.close()
            self._tcp = None

    def begin(self) -> None:
        with self.lock:
            self._tcp = TcpPort(self.address)

    def take(self, now_s: float) -> None:
        """Takes what came, for all."""
        with self.lock:
            for data in [] if self._tcp is None else self._tcp.receive(now_s):
                for inbox in self.inboxes:
                    inbox.append(data)

    def send(self, data: bytes, now_s: float) -> None:
        with self.lock:
            if self._tcp is not None:
                self._tcp.send(data, now_s)


class RoutedPort(Port):
    """An autopilot's link to the router."""

    is_stream = True

    def __init__(self, router: Router) -> None:
        self._router = router
        self._inbox: list[bytes] = []
        router.inboxes.append(self._inbox)

    @override
    def receive(self, now_s: float) -> list[bytes]:
        self._router.take(now_s)
        with self._router.lock:
            found = list(self._inbox)
            self._inbox.clear()
        return found

    @override
    def send(self, data: bytes, now_s: float) -> None:
        self._router.send(data, now_s)


class World:
    """Three autopilots behind one link, and a backend for each of them. `end(i)` ends one autopilot."""

    def __init__(self, url: str, ports: Sequence[Port], stack: ExitStack, router: Router | None = None) -> None:
        self.router = router
        self.autopilots: list[Autopilot] = [
            kind(port, system_id=number) for (number, kind), port in zip(KINDS.items(), ports, strict=True)
        ]
        self._running = [stack.enter_context(ExitStack()) for _ in self.autopilots]
        for each, running in zip(self.autopilots, self._running, strict=True):
            running.enter_context(flying(each))
        urls = MavlinkBackend.vehicle_urls(f"{url}?system_id=1,2,3")
        self.backends = fleet(urls)
        for backend in self.backends:
            backend.open(lambda _: None)
            stack.callback(backend.close)

    def end(self, index: int) -> None:
        self._running[index].close()

    def states(self) -> list[LinkWatchState]:
        return [each.link_statistics().state for each in self.backends]

    def wait_until_all_are(self, *states: LinkWatchState) -> None:
        until(lambda: set(self.states()) <= set(states), "the state of all links", seen=self.states)


def fleet(urls: Sequence[str]) -> list[MavlinkBackend]:
    options = [BackendOptions(f"uav_{i + 1}", url) for i, url in enumerate(urls)]
    made = MavlinkBackend.fleet(options, [Vector3()] * len(options))
    return [each for each in made if isinstance(each, MavlinkBackend)]


@contextmanager
def world_over(kind: str) -> Iterator[World]:
    with ExitStack() as stack:
        if kind == "tcp":
            router = Router()
            ports: list[Port] = [RoutedPort(router) for _ in KINDS]
            stack.callback(router.end)
            yield World(f"tcp://{HERE}:{router.address[1]}", ports, stack, router)
        else:
            port = free_port()
            ports = [UdpPort((HERE, 0), (HERE, port)) for _ in KINDS]
            yield World(f"udpin://{HERE}:{port}", ports, stack)


@pytest.fixture(params=["udp", "tcp"])
def world(request: pytest.FixtureRequest) -> Iterator[World]:
    with world_over(request.param) as world:
        world.wait_until_all_are(LinkWatchState.CONNECTED)
        yield world


def test_each_finds_its_own_and_commands_and_setpoints_go_nowhere_else(world: World) -> None:
    autopilots, backends = world.autopilots, world.backends
    until(lambda: all(each.info().autopilot for each in backends), "the autopilots")
    assert [each.info().autopilot for each in backends] == ["PX4", "ArduPilot", "PX4"]
    for autopilot, backend in zip(autopilots, backends, strict=True):
        until(autopilot.setpoints_s.copy, "a setpoint", between=partial(backend.send, SETPOINT))
    # UAL speaks as a component of the system that it flies: another vehicle's setpoints would have its system's id.
    assert [set(each.setpoint_senders) for each in autopilots] == [{(number, OWN_ID)} for number in KINDS]
    until(
        lambda: ARM in {each[1] for each in list(autopilots[2].commands)},
        "the command to arm",
        between=backends[2].arm,
    )
    assert not any(ARM in {each[1] for each in list(other.commands)} for other in autopilots[:2])


def test_one_that_falls_silent_is_lost_and_the_others_are_not(world: World) -> None:
    world.end(1)
    lost, up = LinkWatchState.LOST, LinkWatchState.CONNECTED
    until(lambda: world.states() == [up, lost, up], "the loss", seen=world.states)
    assert [each.link_statistics().lost_count for each in world.backends] == [0, 1, 0]


def test_a_link_that_is_lost_is_lost_for_all_and_comes_back_for_all() -> None:
    with world_over("tcp") as world:
        world.wait_until_all_are(LinkWatchState.CONNECTED)
        router = world.router
        assert router is not None
        router.end()
        until(lambda: all(each.snapshot().link.trouble for each in world.backends), "the trouble of all")
        troubles = {each.snapshot().link.trouble for each in world.backends}
        assert all(f"{HERE}:{router.address[1]}" in each for each in troubles)
        world.wait_until_all_are(LinkWatchState.LOST)
        router.begin()
        world.wait_until_all_are(LinkWatchState.CONNECTED)
        until(lambda: not any(each.snapshot().link.trouble for each in world.backends), "the end of the trouble")


# --- The parts of a link ----------------------------------------------------------------------------------------------


class LinkStub:
    """A shared port, the parts of it for two systems, and a sender to it."""

    def __init__(self) -> None:
        self.port = free_port()
        endpoint = parse_url(f"udpin://{HERE}:{self.port}")
        self.shared = SharedLink(lambda: make_link(endpoint), str(endpoint), MonotonicClock())
        self.links = [self.shared.vehicle(7), self.shared.vehicle(8)]
        for each in self.links:
            each.open()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def say(self, data: bytes) -> None:
        self._socket.sendto(data, (HERE, self.port))

    def say_until(self, data: bytes, found: Callable[[], object]) -> None:
        """Says it until something is true: the port opens on a thread."""
        until(found, "an answer", between=lambda: self.say(data))

    def close(self) -> None:
        for each in self.links:
            each.close()
        self._socket.close()


@pytest.fixture
def serial_link_stub() -> Iterator[LinkStub]:
    serial_link_stub = LinkStub()
    yield serial_link_stub
    serial_link_stub.close()


def got(link: VehicleLink) -> bytes:
    return b"".join(data for data, _ in link.receive(0.0))


def test_a_datagram_of_several_systems_is_taken_apart(serial_link_stub: LinkStub) -> None:
    own, other, strange = packer(7)(position(1.0)), packer(8)(position(2.0)), packer(9)(position(3.0))
    heard = packer(9)(heartbeat())
    received = [b"", b""]

    def has_come() -> bool:
        received[:] = [before + got(link) for before, link in zip(received, serial_link_stub.links, strict=True)]
        return all(heard in each for each in received)

    serial_link_stub.say_until(own + strange + other + heard, has_come)
    assert own in received[0]
    assert received[0].replace(own, b"").replace(heard, b"") == b""
    assert received[1].replace(other, b"").replace(heard, b"") == b""


def test_the_port_is_free_once_the_last_has_left(serial_link_stub: LinkStub) -> None:
    serial_link_stub.say_until(packer(7)(heartbeat()), lambda: got(serial_link_stub.links[0]))
    serial_link_stub.links[0].close()
    serial_link_stub.say_until(packer(8)(heartbeat()), lambda: got(serial_link_stub.links[1]))
    serial_link_stub.links[1].close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HERE, serial_link_stub.port))


def test_what_nobody_takes_does_not_pile_up() -> None:
    serial_link_stub = LinkStub()
    try:
        link, frame = serial_link_stub.links[0], packer(7)(position(1.0))
        for _ in range(2 * QUEUE_BYTES // len(frame)):
            link.put((frame, None))
        taken = 0
        while found := link.receive(0.0):
            size = sum(len(data) for data, _ in found)
            assert size < READ_BATCH_BYTES + len(frame)
            taken += size
        assert QUEUE_BYTES - len(frame) < taken <= QUEUE_BYTES
        link.put((frame, None))
        assert got(link) == frame
    finally:
        serial_link_stub.close()


def test_a_defect_in_reading_ends_nothing(serial_link_stub: LinkStub, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = packer(7)(heartbeat())
    serial_link_stub.say_until(frame, lambda: got(serial_link_stub.links[0]))
    with monkeypatch.context() as patch:
        patch.setattr(shared_link, "pieces", lambda _: 1 / 0)
        serial_link_stub.say_until(frame, lambda: serial_link_stub.links[0].trouble)
    serial_link_stub.say_until(
        frame, lambda: serial_link_stub.links[0].connections_count > 1 and got(serial_link_stub.links[0])
    )


# --- Which vehicles ---------------------------------------------------------------------------------------------------


def test_vehicles_on_one_link_must_be_distinguished() -> None:
    with pytest.raises(ConfigError, match=r"udp://:14550: other vehicles are on this link, so say which"):
        fleet(["udp://:14550?system_id=1", "udp://:14550"])
    key = MavlinkBackend.vehicle_key
    assert key("udp://:14550?system_id=1") == key("udpin://0.0.0.0:14550?system_id=1")
    assert key("udp://:14550?system_id=1") != key("udp://:14550?system_id=2")
    assert key("nonsense") == "nonsense"


def test_vehicles_on_links_of_their_own_need_no_ids() -> None:
    first, second = fleet(["udpout://127.0.0.1:1", "udpout://127.0.0.1:2?system_id=4"])
    assert isinstance(first, Backend)
    assert second.url == "udpout://127.0.0.1:2?system_id=4"


def test_two_system_ids_for_one_vehicle_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"mavlink.system_id: it is 3, but the URL names 2"):
        MavlinkBackend(BackendOptions("uav_1", "udp://:14550?system_id=2", {"system_id": 3}))
    with pytest.raises(ConfigError, match="names 2 vehicles: give it as --fleet-url"):
        MavlinkBackend(BackendOptions("uav_1", "udp://:14550?system_id=2,3"))
    with pytest.raises(ConfigError, match="needs a --fleet-url for each"):
        MavlinkBackend.fleet([BackendOptions("uav_1")], [Vector3()])
