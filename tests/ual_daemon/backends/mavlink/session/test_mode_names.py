"""Modes that other programs add to an autopilot, by the autopilot's own names for them."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.session.mode_names import LONGEST_NAME_CHARACTERS, MOST_REQUESTS, REQUEST_S, ModeNames
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Control, Mode

LOITER, EXTERNAL_1 = 4 << 16 | 3 << 24, 4 << 16 | 11 << 24


def available(custom_mode: int, name: str) -> Message:
    return mavlink.MAVLink_available_modes_message(1, 1, 0, custom_mode, 0, name.encode())


def test_an_external_mode_has_its_own_name_once_that_was_reported() -> None:
    names = ModeNames(Px4())
    before = names.mode(EXTERNAL_1)
    assert before.text == "AUTO.EXTERNAL1"
    assert names.take_request(10.0)
    names.on_available(available(EXTERNAL_1, "Survey\x07 2"), 10.1, 0.0)
    after = names.mode(EXTERNAL_1)
    assert after.text == "AUTO.EXTERNAL1 (Survey 2)"
    assert (after.name, after.control) == ("AUTO.EXTERNAL1", Control.OTHER)
    assert after == before  # nothing is decided by the name
    assert not names.take_request(20.0)


def test_known_modes_keep_their_names_and_nothing_is_requested() -> None:
    names = ModeNames(Px4())
    names.on_available(available(LOITER, "Hold"), 0.0, 0.0)
    assert names.mode(LOITER).text == "AUTO.LOITER"
    assert not names.take_request(10.0)
    copter = ModeNames(ArduCopter())
    assert copter.mode(4) == Mode("GUIDED", Control.REFERENCES)
    assert not copter.take_request(10.0)


def test_a_mode_of_a_script_cannot_pass_for_another() -> None:
    names = ModeNames(ArduCopter())
    names.on_available(available(104, "GUIDED"), 0.0, 0.0)
    assert names.mode(104).name == "MODE104"
    assert names.mode(104).control is Control.OTHER


def test_names_that_have_changed_are_requested_anew() -> None:
    names = ModeNames(Px4())
    names.on_monitor(mavlink.MAVLink_available_modes_monitor_message(1), 0.0, 0.0)
    names.on_available(available(EXTERNAL_1, "Survey"), 0.0, 0.0)
    names.mode(EXTERNAL_1)
    assert not names.take_request(0.0)
    names.on_monitor(mavlink.MAVLink_available_modes_monitor_message(2), 0.0, 0.0)
    assert names.mode(EXTERNAL_1).text == "AUTO.EXTERNAL1"
    assert names.take_request(0.0)
    names.on_available(available(EXTERNAL_1, "x" * LONGEST_NAME_CHARACTERS), 0.0, 0.0)
    assert names.mode(EXTERNAL_1).text == f"AUTO.EXTERNAL1 ({'x' * LONGEST_NAME_CHARACTERS})"


def test_an_autopilot_without_names_is_not_requested_ever() -> None:
    names = ModeNames(Px4())
    names.mode(EXTERNAL_1)
    assert [names.take_request(REQUEST_S * i) for i in range(MOST_REQUESTS + 1)] == [True] * MOST_REQUESTS + [False]
    assert not names.take_request(1e6)
