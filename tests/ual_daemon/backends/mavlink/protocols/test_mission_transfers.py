"""Transfers by the mission protocol, message by message: what is sent, again, or not any more, and how each ends."""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.simulators.mission_store import FENCE, ArduPilotStore, MissionStore, Px4Store, Sender
from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat, position
from ual.errors import (
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
    WrongStateError,
)
from ual_daemon.backends.firmwares.item_lists import WRITES_COUNT
from ual_daemon.backends.firmwares.mission_items import (
    FENCE_FIELDS,
    MissionItem,
    MissionList,
    MissionType,
    difference,
    refusal_text,
)
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.dialects.unknown import Unknown
from ual_daemon.backends.mavlink.protocols.mission_download import FIRST_RESTART_PAUSE_S
from ual_daemon.backends.mavlink.protocols.mission_exchange import (
    LONGEST_TRANSFER_S,
    PROGRESS_TIMEOUT_S,
    RESTART_PAUSE_S,
    RETRY_S,
)
from ual_daemon.backends.mavlink.protocols.mission_transfers import MOST_WAITING_TRANSFERS, MissionTransfers
from ual_daemon.backends.mavlink.wire.frames import MessageSource, split
from ual_daemon.backends.mavlink.wire.messages import Codec, Message

OWN, OTHER = (7, 191), (255, 190)
CIRCLE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
CANCELLED, DENIED = mavlink.MAV_MISSION_OPERATION_CANCELLED, mavlink.MAV_MISSION_DENIED
ARMED = WrongStateError("the UAV is armed", {"needed": "LANDED_DISARMED"})


def circle(seq: int, radius_m: float = 5.0) -> MissionItem:
    return MissionItem(0, CIRCLE, radius_m, x=470000000, y=80000000 + seq, autocontinue=True)


def circles(count: int, radius_m: float = 5.0) -> list[MissionItem]:
    return [circle(seq, radius_m) for seq in range(count)]


def differs(sent: Any, found: Any) -> str:
    return difference(sent, found, FENCE_FIELDS)


class Bench:
    """The transfers with a PX4, and what they have sent."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.now_s = 100.0
        self.is_up = True
        self.refusal: UalError | None = None
        """Why nothing may be written now."""
        self.transfers = MissionTransfers(self.sent.append, lambda _: self.is_up)
        self.transfers.attach(MessageSource(7, 1), Px4())

    def tick(self, count: int = 0, every_s: float = RETRY_S + 0.01) -> None:
        """Ticks now, or so many times later."""
        for _ in range(count or 1):
            self.now_s += every_s if count else 0.0
            self.transfers.tick(self.now_s)

    def take(self, *messages: Message) -> None:
        for message in messages:
            self.transfers.handlers[message.get_msgId()](message, self.now_s)

    def download(self, kind: MissionType = MissionType.FENCE, most_items: int = 500) -> Future[MissionList]:
        future: Future[MissionList] = Future()
        self.transfers.download(kind, future, most_items)
        self.tick()
        return future

    def replace(self, items: list[MissionItem]) -> Future[MissionList]:
        future: Future[MissionList] = Future()
        self.transfers.replace(MissionType.FENCE, items, lambda: self.refusal, future, differs)
        self.tick()
        return future

    def read_back(self, items: list[MissionItem]) -> None:
        """The autopilot is asked for all items, and has these."""
        self.tick()
        self.take(count(len(items)))
        for seq, item in enumerate(items):
            self.take(an_item(seq, item))
        self.tick()

    def requests(self) -> list[object]:
        """Returns what was sent since the last call, in short."""
        sent, self.sent[:] = list(self.sent), []
        assert all((each.target_system, each.target_component, each.mission_type) == (7, 1, FENCE) for each in sent)
        shown: dict[str, Any] = {
            "MISSION_REQUEST_LIST": lambda _: "list",
            "MISSION_REQUEST_INT": lambda each: each.seq,
            "MISSION_COUNT": lambda each: f"count {each.count}",
            "MISSION_ITEM_INT": lambda each: f"item {each.seq}",
            "MISSION_CLEAR_ALL": lambda _: "clear",
            "MISSION_ACK": lambda each: f"ack {each.type}",
        }
        return [shown[each.get_type()](each) for each in sent]


def count(number: int, target: tuple[int, int] = OWN, kind: int = FENCE) -> Message:
    return mavlink.MAVLink_mission_count_message(*target, number, kind)


def an_item(seq: int, item: MissionItem, target: tuple[int, int] = OWN, kind: int = FENCE) -> Message:
    return mavlink.MAVLink_mission_item_int_message(
        *target, seq, item.frame, item.command, 0, 1, *item[2:6], *item[6:9], kind
    )


def request(seq: int, target: tuple[int, int] = OWN, *, is_float: bool = False) -> Message:
    kind = mavlink.MAVLink_mission_request_message if is_float else mavlink.MAVLink_mission_request_int_message
    return kind(*target, seq, FENCE)


def ack(result: int, target: tuple[int, int] = OWN, kind: int = FENCE) -> Message:
    return mavlink.MAVLink_mission_ack_message(*target, result, kind)


def error_of(future: Future[Any]) -> UalError:
    assert future.done()
    error = future.exception()
    assert isinstance(error, UalError)
    return error


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- Download ---------------------------------------------------------------------------------------------------------


def test_all_items_are_requested_one_after_the_other_and_acknowledged(bench: Bench) -> None:
    future = bench.download()
    bench.read_back(circles(3))
    assert bench.requests() == ["list", 0, 1, 2, "ack 0"]
    assert future.result(0) == MissionList(tuple(circles(3)))


def test_an_empty_list_is_read_to_its_end(bench: Bench) -> None:
    future = bench.download()
    bench.take(count(0))
    assert bench.requests() == ["list", "ack 0"]
    assert future.result(0).items == ()


def test_lost_requests_and_answers_are_requested_again(bench: Bench) -> None:
    future = bench.download()
    bench.tick(1)
    bench.take(count(2))
    bench.tick(2)
    bench.take(an_item(0, circle(0)))
    bench.tick(1, RETRY_S - 0.1)  # not yet
    bench.tick(1, 0.2)
    bench.take(an_item(1, circle(1)))
    assert bench.requests() == ["list", "list", 0, 0, 0, 1, 1, "ack 0"]
    assert len(future.result(0).items) == 2


def test_doubled_late_and_reordered_messages_change_nothing(bench: Bench) -> None:
    future: Future[MissionList] = Future()
    bench.transfers.download(MissionType.FENCE, future)
    bench.take(count(9))  # of a download before
    bench.tick()
    items = circles(3)
    bench.take(an_item(0, items[0]), count(3), count(3), an_item(1, items[1]))
    for seq in (0, 0, 2, 1, 2, 2):
        bench.take(an_item(seq, items[seq]))
    bench.take(count(3))
    assert bench.requests() == ["list", 0, 1, 2, "ack 0"]
    assert future.result(0).items == tuple(items)


@pytest.mark.parametrize(("target", "kind"), [(OWN, 0), ((0, 0), FENCE)])
def test_what_is_for_all_or_of_another_list_does_not_count(bench: Bench, target: tuple[int, int], kind: int) -> None:
    future = bench.download()
    bench.take(count(1, target, kind))
    assert bench.requests() == ["list"]
    bench.take(count(1), an_item(0, circle(0), target, kind), ack(mavlink.MAV_MISSION_NO_SPACE, target, kind))
    assert bench.requests() == [0]
    assert not future.done()


def test_another_number_of_items_begins_anew(bench: Bench) -> None:
    future = bench.download()
    bench.take(count(3), an_item(0, circle(0)), count(2))
    assert bench.requests() == ["list", 0, 1, "list"]
    bench.read_back(circles(2))
    assert len(future.result(0).items) == 2


def test_silence_ends_it_and_in_the_middle_the_list_is_requested_anew(bench: Bench) -> None:
    future = bench.download()
    bench.tick(30)
    assert isinstance(error_of(future), UalTimeoutError)
    assert set(bench.requests()) == {"list"}
    future = bench.download()
    bench.take(count(2))
    bench.tick(30)
    assert isinstance(error_of(future), UalTimeoutError)
    sent = bench.requests()
    assert sent[:8] == ["list", 0, 0, 0, 0, 0, 0, "list"]


def test_silence_of_a_lost_link_is_reported_as_such(bench: Bench) -> None:
    future = bench.download()
    bench.is_up = False
    bench.tick(30)
    assert isinstance(error_of(future), LinkLostError)


def test_a_refusal_that_may_pass_is_waited_for_and_then_reported(bench: Bench) -> None:
    future = bench.download()
    for pause_s in (FIRST_RESTART_PAUSE_S, 2.0 * FIRST_RESTART_PAUSE_S, 4.0 * FIRST_RESTART_PAUSE_S, RESTART_PAUSE_S):
        bench.take(ack(DENIED))
        bench.requests()
        bench.tick(1, pause_s - 0.1)
        assert bench.requests() == []
        bench.tick(1, 0.2)
        assert bench.requests() == ["list"]
    began_s = bench.now_s
    while not future.done():
        bench.take(ack(DENIED))
        bench.tick(1)
        assert bench.now_s - began_s < PROGRESS_TIMEOUT_S + 2.0
    assert "DENIED" in error_of(future).message
    assert "another station" in error_of(future).message


def test_a_refusal_that_stays_ends_it_at_once_and_is_not_answered(bench: Bench) -> None:
    future = bench.download()
    bench.take(ack(mavlink.MAV_MISSION_UNSUPPORTED))
    assert error_of(future).metadata == {"list": "fence", "result": "3"}
    assert bench.requests() == ["list"]


def test_too_many_items_are_not_read(bench: Bench) -> None:
    future = bench.download(most_items=500)
    bench.take(count(501))
    assert bench.requests() == ["list", f"ack {CANCELLED}"]
    assert "it has 501 items, more than 500" in error_of(future).message


# --- Upload -----------------------------------------------------------------------------------------------------------


def test_an_upload_is_requested_item_by_item_and_read_back(bench: Bench) -> None:
    future = bench.replace(circles(2))
    bench.take(request(0), request(1, is_float=True), ack(0))
    assert bench.requests() == ["count 2", "item 0", "item 1"]
    assert not future.done()
    bench.tick()
    bench.read_back(circles(2))
    assert bench.requests() == ["list", 0, 1, "ack 0"]
    assert future.result(0).items == tuple(circles(2))


def test_each_request_is_answered_by_the_item_that_it_names(bench: Bench) -> None:
    bench.replace(circles(3))
    bench.take(request(0), request(0), request(1), request(0), request(2), request(1), request(3), request(2))
    assert bench.requests() == ["count 3", *[f"item {seq}" for seq in (0, 0, 1, 0, 2, 1, 2)]]


def test_what_is_lost_of_an_upload_is_sent_again(bench: Bench) -> None:
    bench.replace(circles(2))
    bench.tick(1)
    bench.take(request(0))
    bench.tick(1)
    assert bench.requests() == ["count 2", "count 2", "item 0", "item 0"]


@pytest.mark.parametrize("result", range(1, 16))
def test_each_refusal_is_reported_in_words_with_the_item(bench: Bench, result: int) -> None:
    future = bench.replace(circles(3))
    bench.take(request(0), request(1))
    for _ in range(1500):
        if future.done():
            break
        bench.take(ack(result))
        bench.tick(1)
    error = error_of(future)
    if result in (1, 13, 14, 15):  # it may pass
        assert isinstance(error, (UalTimeoutError, RejectedByAutopilotError))
        assert "another station" in error.message
    else:
        assert error.metadata == {"list": "fence", "result": str(result), "item": "1"}
        assert "fence, item 1: the autopilot answers" in error.message
        assert refusal_text(result) in error.message


def test_a_number_that_is_no_result_is_reported() -> None:
    assert "result 99" in refusal_text(99)


def test_an_acknowledgement_before_the_last_item_is_none(bench: Bench) -> None:
    future = bench.replace(circles(2))
    bench.take(ack(0), request(0), ack(0))
    bench.tick(1)
    assert bench.requests() == ["count 2", "item 0", "item 0"]
    assert not future.done()


def test_a_lost_last_acknowledgement_is_decided_by_reading_back(bench: Bench) -> None:
    ends: list[Callable[[], None]] = [lambda: bench.take(ack(mavlink.MAV_MISSION_ERROR)), lambda: bench.tick(26)]
    for end in ends:
        future = bench.replace(circles(1))
        bench.take(request(0))
        end()
        bench.tick()
        bench.read_back(circles(1))
        assert future.result(0).items == tuple(circles(1))
        bench.requests()


def test_what_is_read_back_otherwise_is_sent_again_and_then_an_error(bench: Bench) -> None:
    future = bench.replace(circles(2))
    for _ in range(WRITES_COUNT):
        assert not future.done()
        bench.take(request(0), request(1), ack(0))
        bench.tick()
        bench.read_back([circle(0), circle(1, 6.0)])
    assert "item 1 has param1 6 instead of 5" in error_of(future).message
    assert bench.requests().count("count 2") == WRITES_COUNT


def test_an_upload_that_may_not_be_any_more_is_ended_and_reported_to_be_in_part(bench: Bench) -> None:
    bench.refusal = ARMED
    assert error_of(bench.replace(circles(2))) is ARMED
    assert bench.requests() == []
    bench.refusal = None
    future = bench.replace(circles(2))
    bench.take(request(0))
    bench.refusal = ARMED
    bench.take(request(1))
    bench.tick()
    assert bench.requests() == ["count 2", "item 0", f"ack {CANCELLED}"]
    error = error_of(future)
    assert isinstance(error, WrongStateError)
    assert "not sent to the end" in error.message


def test_all_are_removed_by_one_message_and_that_is_read_back(bench: Bench) -> None:
    future = bench.replace([])
    bench.tick(1)
    bench.take(ack(0))
    bench.tick()
    bench.take(count(0))
    bench.tick()
    assert bench.requests() == ["clear", "clear", "list", "ack 0"]
    assert future.result(0).items == ()
    bench.refusal = ARMED
    assert error_of(bench.replace([])) is ARMED


# --- Turns and ends ---------------------------------------------------------------------------------------------------


def test_transfers_take_turns_and_their_number_is_limited(bench: Bench) -> None:
    first, second = bench.download(), bench.replace(circles(1))
    bench.take(request(0))
    assert bench.requests() == ["list"]
    bench.take(count(0))
    bench.tick()
    assert first.done()
    assert bench.requests() == ["ack 0", "count 1"]
    many = [bench.download() for _ in range(MOST_WAITING_TRANSFERS + 1)]
    assert isinstance(error_of(many[-1]), ResourceExhaustedError)
    assert not second.done()


def test_one_that_is_not_waited_for_any_more_is_ended(bench: Bench) -> None:
    future = bench.replace(circles(2))
    bench.take(request(0))
    future.cancel()
    later = bench.download()
    bench.take(request(1))
    assert bench.requests() == ["count 2", "item 0", f"ack {CANCELLED}", "list"]
    bench.take(count(0))
    assert later.done()


@pytest.mark.parametrize("is_withdrawn", [False, True])
def test_a_daemon_that_ends_tells_the_autopilot_that_its_transfer_has_ended(
    bench: Bench, *, is_withdrawn: bool
) -> None:
    future = bench.replace(circles(2))
    bench.take(request(0))
    if is_withdrawn:
        future.cancel()
    bench.requests()
    bench.transfers.release()
    bench.transfers.drop("the daemon ends")
    bench.tick(1)
    assert bench.requests() == [f"ack {CANCELLED}"]


def test_a_daemon_that_ends_without_a_transfer_tells_nothing(bench: Bench) -> None:
    bench.download()
    bench.take(count(0))
    bench.requests()
    bench.transfers.release()
    assert bench.requests() == []


def test_changes_of_a_list_are_counted_however_they_end(bench: Bench) -> None:
    bench.replace([]).cancel()
    bench.tick()
    assert bench.transfers.changes_count(MissionType.FENCE) == 1
    bench.download().cancel()
    bench.tick()
    assert bench.transfers.changes_count(MissionType.FENCE) == 1
    assert bench.transfers.changes_count(MissionType.RALLY) == 0


def test_a_boot_or_another_autopilot_ends_everything(bench: Bench) -> None:
    transfers = bench.transfers
    ends: list[Callable[[], None]] = [
        lambda: transfers.drop("it booted"),
        lambda: transfers.attach(MessageSource(8, 1), Px4()),
    ]
    for end in ends:
        futures = [bench.download(), bench.replace(circles(1))]
        end()
        assert all(isinstance(error_of(each), LinkLostError) for each in futures)
        bench.requests()


def test_an_autopilot_that_is_only_watched_is_not_queried(bench: Bench) -> None:
    bench.transfers.attach(MessageSource(8, 1), Unknown(0))
    assert isinstance(error_of(bench.download()), NotSupportedError)
    assert isinstance(error_of(bench.replace([])), NotSupportedError)
    assert bench.requests() == []


@pytest.mark.parametrize("seed", range(20))
def test_each_transfer_ends_whatever_comes(seed: int) -> None:
    noise, bench = random.Random(seed), Bench()
    items = circles(noise.choice((1, 2, 3)))
    futures: list[Future[MissionList]] = [bench.download(), bench.replace(items), bench.replace([])]
    makers: list[Any] = [
        lambda: count(noise.choice((0, 1, 2, 3, 65535))),
        lambda: an_item(noise.choice((0, 1, 2, 65535)), noise.choice(items)._replace(param1=noise.choice((5.0, 1e38)))),
        lambda: request(noise.choice((0, 1, 2, 3, 65535)), is_float=noise.random() < 0.5),
        lambda: ack(noise.choice((0, 0, 1, 13, 14, 15, noise.randrange(256) if noise.random() < 0.02 else 13))),
    ]
    began_s = bench.now_s
    while not all(each.done() for each in futures):
        bench.take(noise.choice(makers)())
        bench.tick(1, noise.choice((0.0, 0.05, 0.5)))
        assert bench.now_s - began_s < 8 * LONGEST_TRANSFER_S
    written = futures[1]
    if written.exception() is None:
        assert differs(items, written.result().items) == ""


# --- With both firmwares' side of it, over a bad link -----------------------------------------------------------------


class BadLink:
    """The transfers and a store, with a link between them that loses, doubles and delays. Time is stepped."""

    def __init__(self, store: MissionStore, seed: int, loss: float = 0.2) -> None:
        self.noise, self.loss, self.store = random.Random(seed), loss, store
        self.now_s = 0.0
        self._count = itertools.count()
        self._under_way: list[tuple[float, int, bool, bytes]] = []
        self._ours, self._theirs = Codec(191), AutopilotCodec(1)
        self._ours.join(7)
        self._theirs.join(7)
        self.transfers = MissionTransfers(self._ours_sends, lambda _: True)
        self.transfers.attach(MessageSource(7, 1), Px4())
        self.station: list[Message] = []
        """Messages for another station."""

    def send(self, message: Message, now_s: float) -> None:
        """The autopilot sends: this is its channel."""
        self._send(False, self._theirs.encode(message))

    def run(self, future: Future[Any], limit_s: float = 600.0) -> None:
        while not future.done():
            self.step()
            assert self.now_s < limit_s

    def step(self) -> None:
        self.now_s += 0.02
        while self._under_way and self._under_way[0][0] <= self.now_s:
            _, _, is_up, data = heapq.heappop(self._under_way)
            self._arrive(is_up, data)
        self.store.tick(self.now_s)
        self.transfers.tick(self.now_s)

    def _ours_sends(self, message: Message) -> None:
        self._send(True, self._ours.encode(message))

    def _send(self, is_up: bool, data: bytes) -> None:
        for _ in range(1 + (self.noise.random() < 0.1)):
            if self.noise.random() >= self.loss:
                delay_s = self.noise.choice((0.0, 0.03, 0.03, 0.3))
                heapq.heappush(self._under_way, (self.now_s + delay_s, next(self._count), is_up, data))

    def _arrive(self, is_up: bool, data: bytes) -> None:
        [frame] = split(data)[0]
        message = self._theirs.decode(frame) if is_up else self._ours.decode(frame)
        if is_up:
            sender = Sender(self, frame.system_id, frame.component_id)  # type: ignore[arg-type]  # only what is used
            self.store.handlers()[frame.message_id](message, sender, self.now_s)
        elif getattr(message, "target_system", 7) == 7:
            self.transfers.handlers[frame.message_id](message, self.now_s)
        else:
            self.station.append(message)


def store(kind: str) -> MissionStore:
    return Px4Store(lambda: None) if kind == "px4" else ArduPilotStore(lambda: None)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_an_upload_over_a_bad_link_is_whole(kind: str, seed: int) -> None:
    link = BadLink(store(kind), seed)
    link.store.keep(FENCE, circles(3, 9.0))
    for items in (circles(20), circles(20, 7.0), []):
        future: Future[MissionList] = Future()
        link.transfers.replace(MissionType.FENCE, items, lambda: None, future, differs)
        link.run(future, link.now_s + 200.0)
        assert differs(items, future.result(0).items) == ""
        assert differs(items, link.store.lists[FENCE]) == ""


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_another_stations_upload_is_waited_for(kind: str) -> None:
    link = BadLink(store(kind), 1, loss=0.0)
    station = Sender(link, *OTHER)  # type: ignore[arg-type]  # only what is used
    handlers = link.store.handlers()
    handlers[mavlink.MAVLINK_MSG_ID_MISSION_COUNT](count(2, (7, 1)), station, link.now_s)
    future: Future[MissionList] = Future()
    link.transfers.replace(MissionType.FENCE, circles(3), lambda: None, future, differs)
    while link.now_s < 4.0:
        link.step()
    assert not future.done()
    for seq in range(2):
        handlers[mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT](an_item(seq, circle(seq, 8.0), (7, 1)), station, link.now_s)
    assert len(link.store.lists[FENCE]) == 2  # theirs has come whole
    link.run(future)
    assert differs(circles(3), link.store.lists[FENCE]) == ""


def test_a_download_that_is_abandoned_at_once_holds_px4_up_for_no_other() -> None:
    link = BadLink(store("px4"), 1, loss=0.0)
    given_up: Future[MissionList] = Future()
    link.transfers.download(MissionType.FENCE, given_up)
    link.step()
    given_up.cancel()
    future: Future[MissionList] = Future()
    link.transfers.replace(MissionType.FENCE, circles(2), lambda: None, future, differs)
    link.run(future, limit_s=4.0)
    assert future.result(0).items


def test_px4s_checksums_are_kept() -> None:
    link = BadLink(store("px4"), 1, loss=0.0)
    future: Future[MissionList] = Future()
    link.transfers.replace(MissionType.FENCE, circles(2), lambda: None, future, differs)
    link.run(future)
    assert isinstance(link.store, Px4Store)
    opaque_id = link.store.opaque_ids[FENCE]
    assert opaque_id
    assert future.result(0).opaque_id == opaque_id
    assert link.transfers.opaque_ids is None
    link.send(link.store.current(), link.now_s)
    for _ in range(30):
        link.step()
    assert link.transfers.opaque_ids == (0, opaque_id, 0)


@pytest.mark.parametrize(
    ("kind", "items", "name"),
    [
        ("px4", circles(65), "NO_SPACE"),
        ("ardupilot", circles(85), "NO_SPACE"),
        ("px4", [circle(0), circle(1)._replace(frame=1)], "UNSUPPORTED_FRAME"),
        ("ardupilot", [circle(0), circle(1)._replace(command=16)], "item 1: the autopilot answers UNSUPPORTED"),
        ("ardupilot", [MissionItem(0, 5001, 300.0)], "INVALID_PARAM1"),
        ("px4", [MissionItem(0, 5001, 2.0)] * 2, "ERROR"),
        ("ardupilot", [MissionItem(0, 5001, 4.0)] * 3, "ERROR"),
    ],
)
def test_what_each_firmware_refuses_is_reported_and_the_list_stays(
    kind: str, items: list[MissionItem], name: str
) -> None:
    link = BadLink(store(kind), 1, loss=0.0)
    link.store.keep(FENCE, circles(3, 9.0))
    future: Future[MissionList] = Future()
    link.transfers.replace(MissionType.FENCE, items, lambda: None, future, differs)
    link.run(future)
    assert name in error_of(future).message
    assert differs(circles(3, 9.0), link.store.lists[FENCE]) == ""


# --- With the session -------------------------------------------------------------------------------------------------


def test_messages_go_through_the_session_and_those_for_other_stations_do_not_count() -> None:
    harness = Harness()
    harness.receive(heartbeat(), position(0.0))
    future: Future[MissionList] = Future()
    harness.discovery.protocols.missions.download(MissionType.RALLY, future)
    harness.run(0.1)
    harness.receive(count(5, OTHER, 2))
    assert len([each for each in harness.link.take("MISSION_REQUEST_LIST") if each.mission_type == 2]) <= 1
    assert not future.done()
    harness.receive(count(0, (1, 191), 2))
    if not future.done():  # the fence was read first
        harness.receive(count(0, (1, 191), 1))
        harness.run(0.1)
        harness.receive(count(0, (1, 191), 2))
    assert future.result(0).items == ()
