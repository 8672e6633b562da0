"""The thread that receives, on a clock moved by hand, under a flood that never ends."""

import itertools

import pytest
from typing_extensions import override

from tests.ual_daemon.backends.mavlink.endless_link import EndlessLink
from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, UTC_S, attitude, heartbeat, packer, position
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.loop import TICK_S
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.links import Address, Chunk, LinkConnection
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.receive_loop import ReceiveLoop
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Snapshot

BATCH_S = 0.01
"""Seconds that a batch takes, on a slow computer."""
BATCHES_COUNT = 500
_POSCTL, _OFFBOARD = 3 << 16, 6 << 16


class Clock(MonotonicClock):
    """Moved by hand."""

    time_s = 0.0

    @override
    def now_s(self) -> float:
        return self.time_s

    @override
    def utc_s(self) -> float:
        return UTC_S + self.time_s


class Flood(EndlessLink):
    """A batch of garbage, with few messages of the autopilot between."""

    is_stream = False
    connections_count = 1
    peer = ADDRESS

    def __init__(self, clock: Clock, garbage: bytes, *, moves: bool) -> None:
        super().__init__()
        self.loop: ReceiveLoop
        self.called_s: list[tuple[float, float]] = []
        self._clock = clock
        self._garbage = garbage
        self._moves = moves
        self._pack = packer()

    @override
    def answer_to(self, address: Address | None) -> None:
        pass

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        self.batches_count += 1
        if self.batches_count == BATCHES_COUNT:
            self.loop.close()
        posted_s = self._clock.time_s
        if self.batches_count % 7 == 0:
            self.loop.loop.post(lambda called_s: self.called_s.append((posted_s, called_s)))
        self._clock.time_s += BATCH_S
        said: list[Message] = [heartbeat()]
        if self._moves:
            said += [attitude(), position(self._clock.time_s)]
        return [(data, ADDRESS) for data in (*[self._garbage] * 6, *map(self._pack, said))]


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("garbage", [b"\xfd\xff\x00" * 400, b"\xfd" * 1200, b"\xfe" * 1200, b""])
def test_a_flood_that_never_ends_keeps_no_update_tick_or_command_waiting(garbage: bytes, *, moves: bool) -> None:
    clock = Clock()
    flood = Flood(clock, garbage, moves=moves)
    connection = LinkConnection(flood, "test")
    discovery = Discovery(MavlinkSettings(), connection, "test", SetpointMonitor())
    updates: list[Snapshot] = []
    flood.loop = ReceiveLoop(connection, discovery, clock, lambda _: None, updates.append)
    flood.loop.thread.run()
    gaps = [later.time_s - earlier.time_s for earlier, later in itertools.pairwise(updates)]
    assert max(gaps) <= (BATCH_S if moves else TICK_S + BATCH_S) + 1e-9
    assert len(updates) >= BATCHES_COUNT * BATCH_S / (TICK_S + BATCH_S)
    assert len(flood.called_s) == BATCHES_COUNT // 7
    assert all(called_s - posted_s <= BATCH_S + 1e-9 for posted_s, called_s in flood.called_s)
    assert updates[-1].control.armed is not None
    assert (updates[-1].motion.pose is not None) is moves


def test_what_is_known_is_as_old_as_what_was_received_and_not_as_its_snapshot() -> None:
    """A starved thread may take long for a batch: what came meanwhile is not in the snapshot that it then publishes."""
    clock = Clock()
    flood = Flood(clock, b"", moves=True)
    connection = LinkConnection(flood, "test")
    discovery = Discovery(MavlinkSettings(), connection, "test", SetpointMonitor())
    updates: list[Snapshot] = []

    def publish(snapshot: Snapshot) -> None:
        updates.append(snapshot)
        flood.loop.close()

    flood.loop = ReceiveLoop(connection, discovery, clock, lambda _: None, publish)
    take, received_s = discovery.receiver.receive, []

    def slow(data: bytes, address: Address | None, now_s: float, utc_now_s: float) -> None:
        received_s.append(clock.time_s)
        clock.time_s += 0.1
        take(data, address, now_s, utc_now_s)

    discovery.receiver.receive = slow  # type: ignore[method-assign]
    flood.loop.thread.run()
    assert updates[0].updated_s == pytest.approx(received_s[0])
    assert updates[0].time_s > received_s[0] + 0.2


class Script(EndlessLink):
    """Some batches of messages, one after the other; then its end."""

    is_stream = False
    connections_count = 1
    peer = ADDRESS

    def __init__(self, clock: Clock, *batches: list[Message]) -> None:
        super().__init__()
        self.loop: ReceiveLoop
        self._clock, self._batches, self._pack = clock, list(batches), packer()

    @override
    def answer_to(self, address: Address | None) -> None:
        pass

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        self._clock.time_s += BATCH_S
        if not self._batches:
            self.loop.close()
            return []
        return [(data, ADDRESS) for data in map(self._pack, self._batches.pop(0))]


def test_a_mode_that_lasts_for_a_moment_is_visible_to_an_update() -> None:
    """A pilot took over 0.01 s after OFFBOARD: no update saw that mode, and the take-off went on in the pilot's."""
    clock = Clock()
    begun = [heartbeat(_POSCTL, armed=True), attitude(), position(0.0)]
    link = Script(clock, begun, [heartbeat(_OFFBOARD, armed=True), heartbeat(_POSCTL, armed=True)])
    connection = LinkConnection(link, "test")
    discovery = Discovery(MavlinkSettings(), connection, "test", SetpointMonitor())
    modes: list[str] = []

    def on_update(snapshot: Snapshot) -> None:
        mode = snapshot.control.mode
        if mode is not None and mode.value.name != (modes or [""])[-1]:
            modes.append(mode.value.name)

    link.loop = ReceiveLoop(connection, discovery, clock, lambda _: None, on_update)
    link.loop.thread.run()
    assert modes == ["POSCTL", "OFFBOARD", "POSCTL"]
