"""The conformance checks of missions, logs and corrections find what is wrong: each with a service sabotaged so."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import pytest

from ual import conformance
from ual.conformance import (
    CannotRunError,
    CheckFailedError,
    Flight,
    Tolerances,
    own_corrections,
    own_logs,
    own_missions,
)
from ual.corrections import CorrectionsStatus
from ual.errors import InvalidArgumentError, WrongStateError
from ual.interface import Uav
from ual.logs.values import Log, LogChunk
from ual.missions import Item, MissionProgress, MissionStage, OtherItem, StoredMission, Waypoint, checks
from ual_daemon import UAL

TOLERANCES = replace(Tolerances.of_simulation(), patience=1.0)


class Mission:
    """Mission of a UAV that does as it must on the ground, but for what a test changes."""

    def __init__(self) -> None:
        self.kept = StoredMission(())
        self.checks = True
        self.keeps: Callable[[Sequence[Item]], Sequence[Item]] = lambda items: items
        self.starts = False
        self.first = 1

    def plan(self, items: Sequence[Item]) -> None:
        if self.checks:
            checks.require(items)

    def upload(self, items: Sequence[Item]) -> StoredMission:
        self.plan(items)
        self.kept = StoredMission(tuple(self.keeps(items)), "digest")
        return self.kept

    def download(self) -> StoredMission:
        return self.kept

    def clear(self) -> None:
        self.kept = StoredMission(tuple(self.keeps(())))

    def start(self, first_item: int = 1) -> None:
        if first_item < 1:
            raise InvalidArgumentError("first_item: 0 is no item; they are counted from 1")
        if not self.starts:
            raise WrongStateError("start_mission: the UAV is disarmed")

    def pause(self) -> None:
        raise WrongStateError("pause_mission: no mission of UAL is flown")

    def jump_to(self, item: int) -> None:
        raise WrongStateError(f"jump to {item}: no mission of UAL is flown")

    def progress(self) -> MissionProgress:
        return MissionProgress(MissionStage.NOT_STARTED, self.first)

    def watch(self) -> Iterator[MissionProgress]:
        yield self.progress()


class Logs:
    """Logs of a UAV that does as it must, but for what a test changes."""

    content = bytes(range(256)) * 3

    def __init__(self) -> None:
        self.listed = [Log("1", len(self.content)), Log("2", 0)]
        self.data = self.content
        self.sha256 = hashlib.sha256
        self.checks = True

    def get_all(self) -> list[Log]:
        return self.listed

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        found = next((each for each in self.listed if each.id == log_id), self.listed[0])
        if self.checks and (found.id != log_id or not 0 <= offset <= found.size_bytes):
            raise InvalidArgumentError(f"{log_id!r} from {offset} on is no log")
        data = self.data[max(offset, 0) :]
        middle = len(data) // 2
        yield LogChunk(found, offset, data[:middle])
        yield LogChunk(found, offset + middle, data[middle:], self.sha256(data).hexdigest())


class Corrections:
    """Corrections of a UAV that does as it must, but for what a test changes."""

    def __init__(self) -> None:
        self.now = CorrectionsStatus()
        self.passes = False
        self.counts = True
        self.stays = ""

    def status(self) -> CorrectionsStatus:
        return self.now

    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        skipped = sum(map(len, rtcm)) if self.counts else 0
        self.now = CorrectionsStatus(self.stays, int(self.passes), skipped_bytes_count=skipped)
        return self.now


class WithServices:
    """A UAV that has them."""

    def __init__(self, uav: UAL) -> None:
        self._uav = uav
        self.mission, self.logs, self.corrections = Mission(), Logs(), Corrections()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uav, name)


@pytest.fixture(scope="module")
def uav() -> Iterator[UAL]:
    with UAL("light", "uav_1", backend_settings={"speed_factor": 5.0}) as uav:
        yield uav


ROOMS = (own_missions, own_logs, own_corrections)
CHECKS = [check for room in ROOMS for check in room.ON_GROUND]


def run(uav: object) -> None:
    """Runs the checks."""
    flight = Flight(cast("Uav", uav), TOLERANCES)
    for check in CHECKS:
        conformance.run_check(flight, check)


def test_a_uav_that_does_as_it_must_passes_and_has_no_mission_afterwards(uav: UAL) -> None:
    made = WithServices(uav)
    run(made)
    assert made.mission.kept == StoredMission(())


class GrowingLogs(Logs):
    """The autopilot writes on: what was half written in one download is whole in the next."""

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        yield from super().download(log_id, offset)
        self.data = self.content + b"written later" if len(self.data) > len(self.content) else self.content + bytes(8)


def test_a_log_that_grows_while_it_is_downloaded_is_no_fault(uav: UAL) -> None:
    made = WithServices(uav)
    made.logs = GrowingLogs()
    made.logs.data = made.logs.content + bytes(8)
    run(made)


@pytest.mark.parametrize(
    "check", [*own_missions.ON_GROUND, *own_missions.IN_FLIGHT, *own_logs.ON_GROUND], ids=lambda each: each.name
)
def test_a_uav_without_them_cannot_be_checked(uav: UAL, check: conformance.Check) -> None:
    flight = Flight(cast("Uav", uav), TOLERANCES)
    with pytest.raises(CannotRunError, match="does not offer"):
        check.run(flight)


def test_a_mission_that_is_there_is_left_alone(uav: UAL) -> None:
    made = WithServices(uav)
    made.mission.kept = kept = StoredMission((Waypoint(47.0, 8.0, 10.0),), "digest")
    with pytest.raises(CannotRunError, match="has a mission, which is left alone"):
        run(made)
    assert made.mission.kept == kept


def takes_any(made: WithServices) -> None:
    made.mission.checks = False


def keeps_another(made: WithServices) -> None:
    made.mission.keeps = lambda items: [*items, OtherItem(82, "a spline")] if items else ()


def keeps_it_when_cleared(made: WithServices) -> None:
    made.mission.keeps = lambda items: items or (Waypoint(47.0, 8.0, 10.0),)


def starts_disarmed(made: WithServices) -> None:
    made.mission.starts = True


def counts_items_from_0(made: WithServices) -> None:
    made.mission.first = 0


def lists_one_twice(made: WithServices) -> None:
    made.logs.listed = [made.logs.listed[0]] * 2


def takes_any_log(made: WithServices) -> None:
    made.logs.checks = False


def has_less(made: WithServices) -> None:
    made.logs.data = made.logs.content[:-1]


def has_another_hash(made: WithServices) -> None:
    made.logs.sha256 = hashlib.sha224


def passes_garbage_on(made: WithServices) -> None:
    made.corrections.passes = True


def counts_no_garbage(made: WithServices) -> None:
    made.corrections.counts = False


def never_ends(made: WithServices) -> None:
    made.corrections.stays = "ual check"


@pytest.mark.parametrize(
    ("sabotage", "message"),
    [
        (takes_any, "a mission without items"),
        (keeps_another, "were read back as"),
        (keeps_it_when_cleared, "it is not removed"),
        (starts_disarmed, "a start while disarmed"),
        (counts_items_from_0, "counted from 1"),
        (lists_one_twice, "a log is listed twice"),
        (takes_any_log, "a log without a name"),
        (has_less, "767 of 768 bytes came"),
        (has_another_hash, "the hash is not that of the pieces"),
        (passes_garbage_on, "a damaged message was passed on"),
        (counts_no_garbage, "bytes were told as skipped"),
        (never_ends, "still counts as sending"),
    ],
)
def test_what_is_wrong_is_found(uav: UAL, sabotage: Callable[[WithServices], None], message: str) -> None:
    sabotaged = WithServices(uav)
    sabotage(sabotaged)
    with pytest.raises(CheckFailedError, match=message):
        run(sabotaged)
