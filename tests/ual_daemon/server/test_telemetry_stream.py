from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import cast

import pytest

from tests.waiting import until_async
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual_daemon.server.packing import TelemetryPacker
from ual_daemon.server.telemetry_stream import LoopCalls, PackedTelemetry, TelemetryReader, Updates
from ual_daemon.vehicle.vehicle import Vehicle


class FakeVehicle:
    """Updates when it is told to, on the thread of the teller."""

    def __init__(self) -> None:
        self.newest = Telemetry(State.UNINITIALIZED)
        self.subscribers: list[tuple[Callable[[Telemetry], None], Callable[[], bool]]] = []
        self.listeners: list[Callable[[State], None]] = []

    def telemetry(self) -> Telemetry:
        return self.newest

    def state(self) -> State:
        return self.newest.state

    def subscribe(self, callback: Callable[[Telemetry], None], is_due: Callable[[], bool]) -> Callable[[], None]:
        subscriber = (callback, is_due)
        self.subscribers.append(subscriber)
        return lambda: self.subscribers.remove(subscriber)

    def listen_to_state(self, callback: Callable[[State], None]) -> Callable[[], None]:
        self.listeners.append(callback)
        return lambda: self.listeners.remove(callback)

    def update(self, state: State = State.LANDED_DISARMED, count: int = 1) -> None:
        for _ in range(count):
            last, self.newest = self.newest, Telemetry(state, sequence=self.newest.sequence + 1)
            if state is not last.state:
                for listener in self.listeners:
                    listener(state)
            for callback, is_due in self.subscribers:
                if is_due():
                    callback(self.newest)


class Clock:
    """A clock that tests set."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Receiver:
    """Gets what is sent, one message at a time: the next may come when it has taken the one before."""

    def __init__(self) -> None:
        self.received: list[pb.StreamTelemetryResponse] = []
        self._on_sent: Callable[[bool], None] | None = None

    def send(self, message: bytes, then: Callable[[bool], None]) -> None:
        assert self._on_sent is None, "two at a time"
        self.received.append(pb.StreamTelemetryResponse.FromString(message))
        self._on_sent = then

    def take(self, is_out: bool = True) -> None:
        """The message that was sent last is out."""
        on_sent, self._on_sent = self._on_sent, None
        if on_sent is not None:
            on_sent(is_out)

    @property
    def found(self) -> list[tuple[int, int]]:
        """Sequence and missed_count of what came."""
        return [(each.telemetry.sequence, each.missed_count) for each in self.received]


def sample(sequence: int) -> PackedTelemetry:
    return PackedTelemetry(Telemetry(State.FLYING_AUTO, sequence=sequence), TelemetryPacker())


def read_all(rate_hz: float, period_s: float, count: int, read_every: int = 1) -> list[tuple[int, int]]:
    """Offers samples 1 to `count`, one each `period_s`, to a reader whose messages get out at every `read_every`th."""
    clock, receiver = Clock(), Receiver()
    reader = TelemetryReader(rate_hz, sample(0), receiver.send, clock)
    receiver.take()
    for sequence in range(1, count + 1):
        clock.now_s += period_s
        reader.offer(sample(sequence))
        if sequence % read_every == 0:
            receiver.take()
    assert receiver.found[0] == (0, 0)
    return receiver.found[1:]


def test_a_reader_who_keeps_up_gets_each_sample() -> None:
    assert read_all(0.0, 0.02, 4) == [(1, 0), (2, 0), (3, 0), (4, 0)]


def test_a_slow_reader_gets_the_newest_and_how_many_he_missed() -> None:
    # The first is under way while the next two come, of which one is lost; from then on it is three at a time.
    assert read_all(0.0, 0.02, 10, read_every=3) == [(1, 0), (3, 1), (6, 2), (9, 2)]


def test_what_readers_missed_is_counted_also_of_those_that_are_gone() -> None:
    async def run() -> None:
        vehicle, slow, slower = FakeVehicle(), Receiver(), Receiver()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        end = updates.read(0.0, slow.send)
        updates.read(0.0, slower.send)
        vehicle.update(count=3)
        slow.take()  # two were lost
        assert updates.missed_count == 2
        end()
        end()
        assert updates.missed_count == 2
        vehicle.update(count=2)
        slower.take()
        assert updates.missed_count == 2 + 4
        updates.close()

    asyncio.run(run())


def test_what_is_sent_to_one_who_is_gone_ends_it_quietly() -> None:
    receiver = Receiver()
    reader = TelemetryReader(0.0, sample(0), receiver.send)
    reader.offer(sample(1))
    receiver.take(is_out=False)
    assert receiver.found == [(0, 0)]


def test_a_rate_leaves_samples_out_which_are_not_missed() -> None:
    found = read_all(10.0, 0.02, 500)
    assert len(found) in (99, 100)
    assert all(missed_count == 0 for _, missed_count in found)


def test_a_rate_that_does_not_divide_the_updates_is_kept_on_average() -> None:
    assert len(read_all(20.0, 1 / 30, 300)) in (199, 200, 201)


def test_a_rate_beyond_the_updates_gives_each() -> None:
    assert len(read_all(100.0, 0.1, 10)) == 10


def test_a_slow_reader_with_a_rate_misses_only_what_was_due() -> None:
    found = read_all(10.0, 0.02, 500, read_every=50)  # one each second, when ten were due
    assert [missed_count for _, missed_count in found[2:]] == [9] * (len(found) - 2)


def test_a_few_readers_get_a_sample_where_it_is_made() -> None:
    async def run() -> None:
        vehicle, receiver = FakeVehicle(), Receiver()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        end = updates.read(0.0, receiver.send)
        for _ in range(3):
            receiver.take()
            vehicle.update()  # the loop does not run meanwhile
        assert receiver.found == [(0, 0), (1, 0), (2, 0), (3, 0)]
        receiver.take()
        end()
        vehicle.update()
        assert len(receiver.found) == 4
        updates.close()
        assert not vehicle.subscribers
        assert not vehicle.listeners

    asyncio.run(run())


@pytest.mark.parametrize(
    ("readers_count", "gather_s", "is_sent_on_loop"), [(20, 0.0, False), (1, 0.001, False), (1, 0.0, True)]
)
def test_for_many_readers_or_uavs_what_never_reached_the_loop_counts_as_missed(
    readers_count: int, gather_s: float, is_sent_on_loop: bool
) -> None:
    async def run() -> None:
        vehicle, receivers = FakeVehicle(), [Receiver() for _ in range(readers_count)]
        updates = Updates(
            cast("Vehicle", vehicle), lambda _: None, LoopCalls(gather_s), is_sent_on_loop=is_sent_on_loop
        )
        for receiver in receivers:
            updates.read(0.0, receiver.send)
            receiver.take()
        vehicle.update(count=5)  # the loop does not run meanwhile
        assert all(receiver.found == [(0, 0)] for receiver in receivers)
        await until_async(lambda: len(receivers[-1].found) != 1)  # a turn of the loop or two
        assert all(receiver.found[1:] == [(5, 4)] for receiver in receivers)
        updates.close()

    asyncio.run(run())


def test_a_sample_is_packed_once_for_all_readers(monkeypatch: pytest.MonkeyPatch) -> None:
    packed: list[int] = []
    pack = TelemetryPacker.pack

    def counted(packer: TelemetryPacker, telemetry: Telemetry) -> bytes:
        packed.append(telemetry.sequence)
        return pack(packer, telemetry)

    monkeypatch.setattr(TelemetryPacker, "pack", counted)
    one, other = Receiver(), Receiver()
    readers = [TelemetryReader(0.0, first, receiver.send) for first, receiver in ((sample(0), one), (sample(0), other))]
    one.take()
    other.take()
    newest = sample(3)
    for reader in readers:
        reader.offer(newest)
    assert one.found == other.found == [(0, 0), (3, 2)]
    assert packed == [0, 0, 3]


def test_states_are_reported_from_any_thread_though_nobody_reads() -> None:
    async def run() -> None:
        states: asyncio.Queue[State] = asyncio.Queue()
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), states.put_nowait)
        assert await states.get() is State.UNINITIALIZED
        for state in (State.LANDED_DISARMED, State.UNINITIALIZED, State.LANDED_ARMED):
            thread = threading.Thread(target=vehicle.update, args=(state, 3))
            thread.start()
            assert await states.get() is state
            thread.join()
        updates.close()

    asyncio.run(run())


def test_nothing_is_brought_to_the_loop_while_nobody_reads() -> None:
    async def run() -> None:
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        vehicle.update()
        await asyncio.sleep(0)
        loop = asyncio.get_running_loop()
        woken: list[object] = []
        loop.call_soon_threadsafe = woken.append  # type: ignore[assignment,method-assign]
        vehicle.update(count=10)
        assert not woken
        for _ in range(20):
            updates.read(0.0, lambda *_: None)
        vehicle.update(count=10)
        assert len(woken) == 1
        del loop.call_soon_threadsafe
        updates.close()

    asyncio.run(run())


def test_no_sample_is_made_before_it_is_due_for_a_reader() -> None:
    clock = Clock()

    async def run() -> list[int]:
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None, clock=clock)
        made: list[int] = []
        # Before the updates' own, which is due no more as soon as it was told.
        vehicle.subscribers.insert(0, (lambda sample: made.append(sample.sequence), vehicle.subscribers[0][1]))
        ends = [updates.read(rate_hz, lambda *_: None) for rate_hz in (8.0, 4.0)]
        for _ in range(20):
            clock.now_s += 1 / 32
            vehicle.update()
        for end in ends:
            end()
        vehicle.update(count=5)
        return made

    assert asyncio.run(run()) == [4, 8, 12, 16, 20]


def test_an_update_after_the_loop_has_ended_is_no_error() -> None:
    vehicle = FakeVehicle()

    async def run() -> None:
        Updates(cast("Vehicle", vehicle), lambda _: None)

    asyncio.run(run())
    vehicle.update()
