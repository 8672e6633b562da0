from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import cast

from ual.types import State, Telemetry
from ual_daemon.server.updates import Reader, Sample, Updates
from ual_daemon.vehicle import Vehicle


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


class Clock(asyncio.SelectorEventLoop):
    """A loop whose time tests set."""

    now_s = 1000.0

    def time(self) -> float:
        return self.now_s


def sample(sequence: int) -> Sample:
    return Sample(Telemetry(State.FLYING_AUTO, sequence=sequence))


def read_all(rate_hz: float, period_s: float, count: int, read_every: int = 1) -> list[tuple[int, int]]:
    """Offers samples 1 to `count`, one each `period_s`, to a reader who comes at every `read_every`th of them."""
    loop = Clock()

    async def run() -> list[tuple[int, int]]:
        reader = Reader(rate_hz, sample(0))
        await reader.read()
        found = []
        for sequence in range(1, count + 1):
            loop.now_s += period_s
            reader.offer(sample(sequence))
            if sequence % read_every == 0:
                reading = asyncio.ensure_future(reader.read())
                await asyncio.sleep(0)
                if reading.done():
                    newest, missed_count = reading.result()
                    found.append((newest.telemetry.sequence, missed_count))
                else:
                    reading.cancel()
        return found

    try:
        return loop.run_until_complete(run())
    finally:
        loop.close()


def test_a_reader_who_keeps_up_gets_each_sample() -> None:
    assert read_all(0.0, 0.02, 4) == [(1, 0), (2, 0), (3, 0), (4, 0)]


def test_a_slow_reader_gets_the_newest_and_how_many_he_missed() -> None:
    assert read_all(0.0, 0.02, 9, read_every=3) == [(3, 2), (6, 2), (9, 2)]


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
    assert [missed_count for _, missed_count in found[1:]] == [9] * 9


def test_what_never_reached_the_loop_counts_as_missed() -> None:
    async def run() -> None:
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        with updates.reader() as reader:
            assert (await reader.read())[0].telemetry.sequence == 0
            vehicle.update(count=5)  # the loop does not run meanwhile
            newest, missed_count = await reader.read()
            assert (newest.telemetry.sequence, missed_count) == (5, 4)
            vehicle.update()
            newest, missed_count = await reader.read()
            assert (newest.telemetry.sequence, missed_count) == (6, 0)
        updates.close()
        assert not vehicle.subscribers
        assert not vehicle.listeners

    asyncio.run(run())


def test_readers_share_the_message() -> None:
    async def run() -> None:
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        with updates.reader() as one, updates.reader() as other:
            await one.read(), await other.read()
            vehicle.update()
            assert (await one.read())[0].message is (await other.read())[0].message

    asyncio.run(run())


def test_states_are_told_from_any_thread_though_nobody_reads() -> None:
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
        hops: list[object] = []
        loop.call_soon_threadsafe = hops.append  # type: ignore[assignment,method-assign]
        vehicle.update(count=10)
        assert not hops
        with updates.reader():
            vehicle.update(count=10)
            assert len(hops) == 1
        del loop.call_soon_threadsafe
        updates.close()

    asyncio.run(run())


def test_no_sample_is_made_before_it_is_due_for_a_reader() -> None:
    loop = Clock()

    async def run() -> list[int]:
        vehicle = FakeVehicle()
        updates = Updates(cast("Vehicle", vehicle), lambda _: None)
        made: list[int] = []
        vehicle.subscribe(lambda sample: made.append(sample.sequence), vehicle.subscribers[0][1])
        with updates.reader(rate_hz=8.0), updates.reader(rate_hz=4.0):
            for _ in range(20):
                loop.now_s += 1 / 32
                vehicle.update()
                await asyncio.sleep(0)
        vehicle.update(count=5)
        return made

    try:
        assert loop.run_until_complete(run()) == [4, 8, 12, 16, 20]
    finally:
        loop.close()


def test_an_update_after_the_loop_has_ended_is_no_error() -> None:
    vehicle = FakeVehicle()

    async def run() -> None:
        Updates(cast("Vehicle", vehicle), lambda _: None)

    asyncio.run(run())
    vehicle.update()
