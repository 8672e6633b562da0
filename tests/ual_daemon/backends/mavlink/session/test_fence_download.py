"""Times at which the autopilot's own fence is downloaded, again, or not any more."""

from __future__ import annotations

from concurrent.futures import Future

import pytest
from pymavlink.dialects.v20 import all as mavlink

from ual.errors import ResourceExhaustedError, UalTimeoutError
from ual_daemon.backends.firmwares.fence_zones import FoundZones
from ual_daemon.backends.firmwares.mission_items import MissionItem, MissionList, MissionType
from ual_daemon.backends.mavlink.protocols.mission_transfers import MissionTransfers, OpaqueIds
from ual_daemon.backends.mavlink.session.fence_download import FIRST_PAUSE_S, MAX_ITEMS, POLL_S, FenceDownload

CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION


class Transfers(MissionTransfers):
    """Keeps what is asked for."""

    def __init__(self) -> None:
        super().__init__(lambda _: None, lambda _: True)
        self.asked: list[Future[MissionList]] = []

    def download(self, kind: MissionType, future: Future[MissionList], most_items: int = 0) -> None:
        assert (kind, most_items) == (MissionType.FENCE, MAX_ITEMS)
        self.asked.append(future)


class Bench:
    """A download, and what it has asked for and told."""

    def __init__(self) -> None:
        self.transfers = Transfers()
        self.found: list[FoundZones] = []
        self.failed: list[str] = []
        self.now_s = 100.0
        self.is_armed: bool | None = False
        self.download = FenceDownload(self.transfers, self.found.append, self.failed.append)
        self.wait(0.0)

    def wait(self, duration_s: float) -> None:
        """Ticks once after a time."""
        self.now_s += duration_s
        self.download.tick(self.now_s, is_armed=self.is_armed)

    def requests_count(self) -> int:
        return len(self.transfers.asked)

    def succeed(self, count: int = 1, opaque_id: int = 0) -> None:
        items = tuple(MissionItem(0, CIRCLE, 5.0, x=470000000, y=80000000 + seq) for seq in range(count))
        self.transfers.asked[-1].set_result(MissionList(items, opaque_id))
        self.wait(0.0)

    def fail(self) -> None:
        self.transfers.asked[-1].set_exception(UalTimeoutError("it does not answer"))
        self.wait(0.0)

    def tell(self, fence_id: int) -> None:
        self.transfers.opaque_ids = OpaqueIds(0, fence_id, 0)
        self.wait(0.0)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_what_was_downloaded_is_reported_as_zones(bench: Bench) -> None:
    bench.wait(10.0)
    assert bench.requests_count() == 1
    bench.succeed(3)
    assert [len(found.zones or ()) for found in bench.found] == [3]
    zone = (bench.found[0].zones or ())[1]
    assert (zone.radius_m, zone.points) == (5.0, ((47.0, 8.0000001),))


def test_an_autopilot_that_never_answers_is_queried_ever_more_rarely(bench: Bench) -> None:
    pauses_s = []
    for _ in range(8):
        bench.fail()
        failed_s, asked_count = bench.now_s, bench.requests_count()
        while bench.requests_count() == asked_count:
            bench.wait(0.5)
        pauses_s.append(bench.now_s - failed_s)
    assert pauses_s == pytest.approx([5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 160.0, 160.0], abs=1.0)
    assert bench.failed == ["it does not answer"] * 8
    assert bench.found == []


def test_a_failure_is_tried_again_in_flight_too(bench: Bench) -> None:
    bench.is_armed = True
    bench.wait(0.0)
    bench.fail()
    assert bench.requests_count() == 2  # at first, and as it was armed
    bench.fail()
    bench.wait(2.0 * FIRST_PAUSE_S)
    assert bench.requests_count() == 3


def test_too_many_items_are_reported(bench: Bench) -> None:
    bench.transfers.asked[-1].set_exception(ResourceExhaustedError("it has 501 items, more than 500"))
    bench.wait(0.0)
    assert bench.found == [FoundZones(None, "it has 501 items, more than 500")]


def test_where_too_many_transfers_wait_it_is_tried_again(bench: Bench) -> None:
    bench.transfers.asked[-1].set_exception(ResourceExhaustedError("20 transfers wait already"))
    bench.wait(0.0)
    assert (bench.found, bench.failed) == ([], ["20 transfers wait already"])


def test_it_is_read_again_now_and_then_while_disarmed_but_not_in_flight(bench: Bench) -> None:
    bench.succeed()
    bench.wait(POLL_S - 1.0)
    assert bench.requests_count() == 1
    bench.wait(1.0)
    bench.succeed()
    assert bench.requests_count() == 2
    bench.is_armed = True
    bench.wait(0.0)
    assert bench.requests_count() == 3  # as it is armed
    bench.succeed()
    for _ in range(100):
        bench.wait(10.0)
    assert bench.requests_count() == 3


def test_a_new_wish_in_the_middle_begins_anew_once_what_is_in_progress_has_ended(bench: Bench) -> None:
    bench.download.want()
    bench.wait(0.0)
    assert bench.requests_count() == 1
    bench.succeed()
    assert bench.requests_count() == 2
    bench.succeed()
    assert (bench.requests_count(), len(bench.found)) == (2, 2)


def test_px4s_checksum_saves_the_polls_and_tells_of_another_fence_in_flight_too(bench: Bench) -> None:
    bench.succeed(opaque_id=7)
    bench.tell(7)
    for _ in range(100):
        bench.wait(10.0)
    assert bench.requests_count() == 1
    bench.is_armed = True
    bench.wait(0.0)
    bench.succeed(opaque_id=7)
    bench.tell(8)
    assert bench.requests_count() == 3
    bench.succeed(opaque_id=8)
    bench.tell(0)  # it was cleared
    assert bench.requests_count() == 4
    bench.succeed(0)
    bench.tell(0)
    assert bench.requests_count() == 4


def test_a_change_by_ual_is_read_again(bench: Bench) -> None:
    bench.succeed()
    bench.transfers._changes[MissionType.FENCE] += 1
    bench.wait(0.0)
    assert bench.requests_count() == 2
