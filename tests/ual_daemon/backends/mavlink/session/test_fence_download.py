"""The download of a fence, message by message: what is sent, again, or not any more."""

from __future__ import annotations

from typing import Any

import pytest

from ual_daemon.backends.firmwares.fence_zones import FoundZones
from ual_daemon.backends.mavlink.session.fence_download import (
    FIRST_PAUSE_S,
    MAX_ITEMS,
    POLL_S,
    RETRY_S,
    TRIES_COUNT,
    FenceDownload,
)
from ual_daemon.backends.mavlink.wire.frames import Source
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

OWN, OTHER = (7, 191), (255, 190)
FENCE, MISSION = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_MISSION
CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION


def count(number: int, target: tuple[int, int] = OWN, kind: int = FENCE) -> Message:
    return mavlink.MAVLink_mission_count_message(*target, number, kind)


def item(seq: int, target: tuple[int, int] = OWN, kind: int = FENCE, radius_m: float = 5.0) -> Message:
    place = 470000000, 80000000 + seq
    return mavlink.MAVLink_mission_item_int_message(*target, seq, 0, CIRCLE, 0, 1, radius_m, 0, 0, 0, *place, 0, kind)


def refusal(result: int, target: tuple[int, int] = OWN, kind: int = FENCE) -> Message:
    return mavlink.MAVLink_mission_ack_message(*target, result, kind)


class Bench:
    """A download, and what it has sent and told."""

    def __init__(self) -> None:
        self.sent: list[Message] = []
        self.found: list[FoundZones] = []
        self.failed: list[str] = []
        self.now_s = 100.0
        self.is_armed: bool | None = False
        self.download = FenceDownload(Source(7, 1), OWN, self.sent.append, self.found.append, self.failed.append)
        self.tick()

    def tick(self, count: int = 0, every_s: float = RETRY_S + 0.01) -> None:
        """Ticks now, or so many times later."""
        for _ in range(count or 1):
            self.now_s += every_s if count else 0.0
            self.download.tick(self.now_s, is_armed=self.is_armed)

    def wait(self, duration_s: float) -> None:
        """Ticks once after a time."""
        self.tick(1, duration_s)

    def take(self, message: Message) -> None:
        handlers: dict[str, Any] = {
            "MISSION_COUNT": self.download.on_count,
            "MISSION_ITEM_INT": self.download.on_item,
            "MISSION_ACK": self.download.on_ack,
        }
        handlers[message.get_type()](message, self.now_s)

    def requests(self) -> list[object]:
        """Returns what was sent since the last call: the list, the numbers of items, and results."""
        sent, self.sent[:] = list(self.sent), []
        assert all((each.target_system, each.target_component, each.mission_type) == (7, 1, FENCE) for each in sent)
        return [
            "list"
            if each.get_type() == "MISSION_REQUEST_LIST"
            else each.seq
            if each.get_type() == "MISSION_REQUEST_INT"
            else f"ack {each.type}"
            for each in sent
        ]

    def download_all(self, number: int) -> None:
        self.take(count(number))
        for seq in range(number):
            self.take(item(seq))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_all_items_are_requested_one_after_the_other_and_acknowledged(bench: Bench) -> None:
    assert bench.requests() == ["list"]
    bench.download_all(3)
    assert bench.requests() == [0, 1, 2, "ack 0"]
    assert [len(found.zones or ()) for found in bench.found] == [3]
    zone = (bench.found[0].zones or ())[1]
    assert (zone.radius_m, zone.points) == (5.0, ((47.0, 8.0000001),))


def test_a_fence_without_items_is_known_to_be_empty(bench: Bench) -> None:
    bench.take(count(0))
    assert bench.requests() == ["list", "ack 0"]
    assert bench.found == [FoundZones(())]


def test_lost_requests_and_answers_are_requested_again(bench: Bench) -> None:
    bench.tick(1)
    bench.take(count(2))
    bench.tick(2)
    bench.take(item(0))
    bench.wait(RETRY_S - 0.1)  # not yet
    bench.wait(0.2)
    bench.take(item(1))
    assert bench.requests() == ["list", "list", 0, 0, 0, 1, 1, "ack 0"]
    assert len(bench.found) == 1


def test_doubled_late_and_reordered_messages_change_nothing(bench: Bench) -> None:
    bench.take(item(0))  # of a download before
    for message in (count(3), count(3), item(1), item(0), item(0), item(2), item(1), count(3), item(2), item(2)):
        bench.take(message)
    bench.take(count(3))
    assert bench.requests() == ["list", 0, 1, 2, "ack 0"]
    assert [zone.points[0][1] for zone in bench.found[0].zones or ()] == pytest.approx([8.0, 8.0000001, 8.0000002])
    assert len(bench.found) == 1


@pytest.mark.parametrize(("target", "kind"), [(OTHER, FENCE), (OWN, MISSION), ((0, 0), FENCE)])
def test_what_is_for_others_or_of_another_list_does_not_count(bench: Bench, target: tuple[int, int], kind: int) -> None:
    bench.take(count(1, target, kind))
    assert bench.requests() == ["list"]
    bench.take(count(1))
    bench.take(item(0, target, kind))
    bench.take(refusal(mavlink.MAV_MISSION_DENIED, target, kind))
    assert bench.requests() == [0]
    assert (bench.found, bench.failed) == ([], [])


def test_another_number_of_items_begins_anew(bench: Bench) -> None:
    bench.take(count(3))
    bench.take(item(0))
    bench.take(count(2))
    assert bench.requests() == ["list", 0, 1, "list"]
    bench.download_all(2)
    assert len(bench.found[0].zones or ()) == 2


def test_an_autopilot_that_never_answers_is_asked_ever_more_rarely(bench: Bench) -> None:
    bench.tick(TRIES_COUNT)
    assert bench.requests() == ["list"] * TRIES_COUNT
    assert bench.failed == ["it does not answer"]
    pauses_s = []
    for _ in range(8):
        failed_s = bench.now_s
        while not bench.requests():
            bench.wait(0.5)
        pauses_s.append(bench.now_s - failed_s)
        bench.tick(TRIES_COUNT)
        bench.requests()
    assert pauses_s == pytest.approx([5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 160.0, 160.0], abs=1.0)
    assert bench.found == []


def test_an_item_that_never_comes_ends_the_transfer_and_it_is_tried_again(bench: Bench) -> None:
    bench.take(count(2))
    bench.take(item(0))
    bench.tick(TRIES_COUNT)
    assert bench.requests() == ["list", 0, *[1] * TRIES_COUNT, f"ack {mavlink.MAV_MISSION_OPERATION_CANCELLED}"]
    assert bench.failed == ["it does not answer"]
    bench.wait(FIRST_PAUSE_S)
    bench.download_all(2)
    assert bench.requests() == ["list", 0, 1, "ack 0"]
    assert len(bench.found) == 1


def test_a_refusal_is_not_answered_and_tried_again_in_flight_too(bench: Bench) -> None:
    bench.is_armed = True
    bench.tick()
    bench.requests()
    bench.take(refusal(mavlink.MAV_MISSION_DENIED))
    assert bench.failed == ["it answers MAV_MISSION_DENIED"]
    bench.wait(FIRST_PAUSE_S)
    assert bench.requests() == ["list"]
    bench.take(refusal(99))
    assert bench.failed[1] == "it answers 99"


def test_too_many_items_are_not_read_and_that_is_told(bench: Bench) -> None:
    bench.take(count(MAX_ITEMS + 1))
    assert bench.requests() == ["list", f"ack {mavlink.MAV_MISSION_OPERATION_CANCELLED}"]
    assert bench.found == [FoundZones(None, "it has 501 items, more than 500")]


def test_it_is_read_again_now_and_then_while_disarmed_but_not_in_flight(bench: Bench) -> None:
    bench.download_all(1)
    bench.requests()
    bench.wait(POLL_S - 1.0)
    assert bench.requests() == []
    bench.wait(1.0)
    bench.download_all(1)
    assert bench.requests() == ["list", 0, "ack 0"]
    bench.is_armed = True
    bench.tick()
    bench.download_all(1)
    assert bench.requests() == ["list", 0, "ack 0"]  # as it is armed
    bench.tick(100, 10.0)
    assert bench.requests() == []


def test_a_new_wish_begins_anew_also_in_the_middle(bench: Bench) -> None:
    bench.take(count(2))
    bench.take(item(0))
    bench.download.want()
    bench.tick()
    bench.take(item(1))  # of the fence before
    assert bench.requests() == ["list", 0, 1, "list"]
    assert bench.found == []
