"""Logs by LOG_REQUEST_LIST and LOG_REQUEST_DATA: what is asked for, again, or not any more, and how each ends."""

from __future__ import annotations

import os
import random
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.protocols.served import Served, error_of
from ual.errors import LinkLostError, RejectedByAutopilotError, ResourceExhaustedError, UalTimeoutError
from ual_daemon.backends.mavlink.protocols.log_transfers import (
    GENTLE_DOWNLOAD_BYTES_S,
    IDLE_LOG_S,
    MOST_LOGS,
    MOST_WAITING_READS,
    PROGRESS_TIMEOUT_S,
    LogEntry,
)

FUZZ_COUNT = int(os.environ.get("UAL_TEST_FUZZ", "10000"))


def content(size: int) -> bytes:
    return random.Random(5).randbytes(size)


def listed(served: Served) -> list[LogEntry]:
    future: Future[list[LogEntry]] = Future()
    served.logs.list(future)
    return served.finished(future)


def read(served: Served, log_id: int, offset: int, size: int) -> bytes:
    future: Future[bytes] = Future()
    served.logs.read(log_id, offset, size, future)
    return served.finished(future)


def kinds(served: Served) -> list[str]:
    return [each.get_type() for each in served.store.log_requests]


def with_logs(served: Served, *sizes: int) -> Served:
    directory = served.store.directory
    served.store.files = {f"{directory}/{number:03}.bin": content(size) for number, size in enumerate(sizes)}
    served.store.times_utc_s = {path: 1_800_000_000 + at for at, path in enumerate(served.store.files)}
    return served


@pytest.fixture(params=["px4", "ardupilot"])
def served(request: pytest.FixtureRequest) -> Served:
    return Served(is_px4=request.param == "px4")


def test_logs_are_listed_and_read(served: Served) -> None:
    with_logs(served, 1000, 0, 50_000)
    found = listed(served)
    assert [(each.size, each.time_utc_s) for each in found] == [
        (1000, 1_800_000_000),
        (0, 1_800_000_001),
        (50_000, 1_800_000_002),
    ]
    for offset, size in ((0, 50_000), (7, 1000), (49_999, 1), (180, 0)):
        assert read(served, found[2].id, offset, size) == content(50_000)[offset : offset + size]


def test_over_a_bad_link_the_list_and_the_log_are_whole(served: Served) -> None:
    bad = Served(is_px4=served.store._is_px4, loss=0.2, doubled=0.2, late=0.1)
    with_logs(bad, *range(1, 40), 60_000)
    found = listed(bad)
    assert [each.size for each in found] == [*range(1, 40), 60_000]
    assert read(bad, found[-1].id, 0, 60_000) == content(60_000)


@pytest.mark.parametrize("lost", [0, 2, 4])
def test_one_that_is_never_described_does_not_hide_the_others(served: Served, lost: int) -> None:
    with_logs(served, *range(1, 6))
    first = 0 if served.store._is_px4 else 1

    def spoil(message: Any) -> Any:
        return None if message.get_type() == "LOG_ENTRY" and message.id == first + lost else message

    served.spoil = spoil
    found = listed(served)
    assert [(each.id, each.size) for each in found if each.size is not None] == [
        (first + index, index + 1) for index in range(5) if index != lost
    ]
    assert [each.id for each in found if each.size is None] == [first + lost]
    assert read(served, found[0].id, 0, found[0].size or 0)


def test_an_ardupilot_without_logs_says_so() -> None:
    served = Served(is_px4=False)
    assert listed(served) == []


def test_a_px4_without_logs_is_silent_and_that_ends() -> None:
    with pytest.raises(UalTimeoutError, match="or has none"):
        listed(Served())


def test_an_armed_ardupilot_refuses_in_its_own_words() -> None:
    served = with_logs(Served(is_px4=False), 1000)
    served.is_armed = True
    with pytest.raises(RejectedByAutopilotError, match="it says: Disarm for log download"):
        listed(served)
    with pytest.raises(UalTimeoutError, match="ArduPilot gives none while it is armed: disarm first"):
        listed(served)  # it says so once only
    served.is_armed = False
    assert len(listed(served)) == 1


def test_armed_it_is_read_gently() -> None:
    served = with_logs(Served(), 100_000)
    [log] = listed(served)
    served.is_armed = True
    began_s = served.now_s
    assert read(served, log.id, 0, 100_000) == content(100_000)
    assert 10_000.0 < 100_000 / (served.now_s - began_s) < GENTLE_DOWNLOAD_BYTES_S * 1.1


def test_the_autopilot_is_reported_when_no_more_is_wanted(served: Served) -> None:
    [log] = listed(with_logs(served, 1000))
    read(served, log.id, 0, 1000)
    served.run(IDLE_LOG_S + 0.5)
    assert kinds(served).count("LOG_REQUEST_END") == 1
    served.run(5.0)
    assert kinds(served).count("LOG_REQUEST_END") == 1


@pytest.mark.parametrize("is_read", [False, True])
def test_a_daemon_that_ends_reports_that_no_more_is_wanted_once(served: Served, is_read: bool) -> None:
    with_logs(served, 500_000)
    first = listed(served)[0].id
    if is_read:
        read(served, first, 0, 1000)
    else:
        served.logs.read(first, 0, 500_000, Future())
        served.run(0.05)
    for _ in range(2):
        served.logs.release()
    served.logs.drop("the daemon ends")
    served.run(0.1)
    assert kinds(served).count("LOG_REQUEST_END") == 1
    assert kinds(served)[-1] == "LOG_REQUEST_END"


def test_silence_and_a_boot_end_what_is_requested(served: Served) -> None:
    with_logs(served, 100_000)
    [log] = listed(served)
    served.spoil = lambda _: None
    with pytest.raises(UalTimeoutError, match="nothing of it has come"):
        read(served, log.id, 0, 100_000)
    served.is_up = False
    with pytest.raises(LinkLostError):
        read(served, log.id, 0, 100_000)
    future: Future[bytes] = Future()
    served.logs.read(log.id, 0, 10, future)
    served.run(PROGRESS_TIMEOUT_S / 2)
    served.logs.drop("the autopilot has booted")
    assert "has booted" in error_of(future).message


def test_too_many_neither_wait_nor_are_listed(served: Served) -> None:
    waiting: list[Future[Any]] = [Future() for _ in range(MOST_WAITING_READS + 1)]
    for each in waiting:
        served.logs.list(each)
    assert isinstance(error_of(waiting[-1]), ResourceExhaustedError)
    served.spoil = lambda _: mavlink.MAVLink_log_entry_message(1, MOST_LOGS + 1, 5, 0, 0)
    with_logs(served, 10)
    served.run(1.0)
    assert isinstance(error_of(waiting[0]), ResourceExhaustedError)


@pytest.mark.parametrize("seed", range(2))
def test_whatever_is_answered_each_exchange_ends(seed: int) -> None:
    noise = random.Random(seed)
    served = with_logs(Served(is_px4=bool(seed), loss=0.1, doubled=0.1, late=0.1, seed=seed), 10, 20_000)

    def spoilt(message: Any) -> Any:
        kind = noise.random()
        if kind < 0.5 or message.get_type() == "STATUSTEXT":
            return message
        if kind < 0.7:
            numbers = [noise.randrange(65536) for _ in range(3)]
            return mavlink.MAVLink_log_entry_message(*numbers, noise.randrange(2**32), noise.randrange(2**32))
        offset = noise.choice((0, 90, noise.randrange(2**32)))
        data = list(noise.randbytes(90))
        return mavlink.MAVLink_log_data_message(noise.randrange(3), offset, noise.randrange(256), data)

    served.spoil = spoilt
    while len(served.received) < FUZZ_COUNT // 2:
        entries: Future[list[LogEntry]] = Future()
        piece: Future[bytes] = Future()
        served.logs.list(entries)
        served.logs.read(noise.randrange(3), 0, 20_000, piece)
        for _ in range(60_000):
            if entries.done() and piece.done():
                break
            served.step()
            served.is_armed = noise.random() < 0.3
        assert entries.done()
        assert piece.done()
