"""Recorded flights on real autopilots are clean, and each breach that is put into them is found."""

from __future__ import annotations

import dataclasses
import gzip
from itertools import pairwise
from pathlib import Path

import pytest

from tests.campaign.evidence import Case
from tests.campaign.judge import judge
from tests.campaign.record import DAEMON_STARTED, Located, Order, Record, Sent
from tests.campaign.tally import tally

FOLDER = Path(__file__).parent / "data"
FILES = sorted(FOLDER.glob("*.json.gz"))
TAKE_OVERS = [path for path in FILES if "400002" in path.name]
OLD_WORDS = {"words"}
"""The only rule that UAL's words of that time broke."""
KILLED = [path for path in FILES if "400004" in path.name]


def read(path: Path) -> Record:
    record = Record.from_json(gzip.decompress(path.read_bytes()).decode())
    changes = Case(record).changes
    armed_s = [now.time_s for before, now in pairwise(changes) if now.armed and before.armed is False]
    record.orders += [Order(time_s - 1.0, "arm") for time_s in armed_s]  # which was not recorded at that time
    return record


def rules(record: Record) -> set[str]:
    return {breach.rule for breach in judge(record)}


def setpoint(record: Record, time_s: float) -> Record:
    record.sent.append(Sent(time_s, "setpoint"))
    record.sent.sort(key=lambda sent: sent.time_s)
    return record


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_recorded_flight_is_clean(path: Path) -> None:
    record = read(path)
    assert rules(record) <= OLD_WORDS
    assert len(record.truth) > 100
    assert any(sent.what == "setpoint" for sent in record.sent)


def test_what_was_once_reported_of_a_flight_that_ual_had_executed_is_found() -> None:
    """The pilot gave GUIDED back, and UAL said that it had not been commanded in this flight."""
    (breach,) = judge(read(FOLDER / "ardupilot-400002.json.gz"))
    assert breach.rule == "words"
    assert "not been commanded in this flight" in breach.text


def test_what_was_assessed_is_counted() -> None:
    text = tally([read(path) for path in TAKE_OVERS])
    assert text.startswith("2 flights, ")
    assert " 2 take-overs, " in text
    assert text.endswith("pilot 2")


def test_there_are_flights_of_both_autopilots() -> None:
    assert {read(path).autopilot for path in TAKE_OVERS} == {read(path).autopilot for path in KILLED}
    assert len(TAKE_OVERS) == len(KILLED) == 2


@pytest.mark.parametrize("path", TAKE_OVERS, ids=lambda path: path.name)
def test_one_setpoint_after_the_take_over_is_found(path: Path) -> None:
    record = read(path)
    record.troubles.clear()  # the computer was busy
    taken_s = Case(record).taken_s[0]
    assert rules(setpoint(record, taken_s + 0.5)) - OLD_WORDS == {"take-over", "unasked"}


@pytest.mark.parametrize("path", KILLED, ids=lambda path: path.name)
def test_one_setpoint_of_a_daemon_that_has_just_started_is_found(path: Path) -> None:
    record = read(path)
    record.troubles.clear()
    started_s = [life.time_s for life in record.lives if life.what == DAEMON_STARTED][-1]
    first_s = min(call.began_s for call in record.called if call.began_s > started_s)
    assert "unasked" in rules(setpoint(record, (started_s + first_s) / 2.0))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_states_that_come_two_seconds_late_are_found(path: Path) -> None:
    record = read(path)
    record.troubles.clear()
    record.said = [dataclasses.replace(said, time_s=said.time_s + 2.0) for said in record.said]
    assert "state" in rules(record)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_truth_elsewhere_is_found(path: Path) -> None:
    """Autopilot and daemon agree, and both are 30 m beside the truth: nothing that flies there is inside the fence."""
    record = read(path)
    record.estimate = [Located(each.time_s, (each.place[0] + 30.0, *each.place[1:])) for each in record.estimate]
    record.truth = [Located(each.time_s, (each.place[0] + 30.0, *each.place[1:])) for each in record.truth]
    assert "fence" in rules(record)
