"""The mapping of an unknown device is made by asking; needs no device and no pygame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.joystick import Axis, Button, JoystickError, Mapper, RawState
from ual.joystick._mapping import read_mappings

GUID = "03" + "0" * 30
REST = RawState((0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.1), (False,) * 16, ((0, 0),))


def moved(number: int, value: float, rest: RawState = REST) -> RawState:
    return replace(rest, axes=tuple(value if each == number else held for each, held in enumerate(rest.axes)))


def pressed(*numbers: int, rest: RawState = REST) -> RawState:
    return replace(rest, buttons=tuple(number in numbers for number in range(len(rest.buttons))))


def answer(mapper: Mapper, *states: RawState, rest: RawState = REST) -> None:
    for state in (*states, rest):
        mapper.feed(state)


def skip_to(mapper: Mapper, target: Axis | Button) -> None:
    while mapper.question is not None and mapper.question.target is not target:
        mapper.skip()


def requests_made(mapper: Mapper) -> Axis | Button | None:
    return None if mapper.question is None else mapper.question.target


def test_it_asks_for_each_axis_and_button_once() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    targets = []
    while mapper.question is not None:
        targets.append(mapper.question.target)
        mapper.skip()
    assert set(targets) == {*Axis, *Button}
    assert len(targets) == len(set(targets))
    assert mapper.mapping().bindings == {}
    mapper.skip()
    mapper.feed(pressed(1))


@pytest.mark.parametrize(("value", "binding"), [(1.0, "a2"), (-1.0, "a2~"), (0.7, "a2")])
def test_a_stick_is_the_axis_that_moved(value: float, binding: str) -> None:
    mapper = Mapper(GUID, "Stick", REST)
    answer(mapper, moved(2, 0.2), moved(2, value), moved(2, 0.3))
    assert mapper.mapping().bindings == {"leftx": binding}
    assert requests_made(mapper) is Axis.LEFT_Y


def test_an_answer_is_taken_once_all_is_at_rest_again() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    mapper.feed(moved(2, 1.0))
    assert requests_made(mapper) is Axis.LEFT_X
    mapper.feed(moved(2, 0.3))
    assert requests_made(mapper) is Axis.LEFT_X
    mapper.feed(moved(2, 0.2))
    assert requests_made(mapper) is Axis.LEFT_Y


@pytest.mark.parametrize(
    ("number", "value", "binding"), [(4, 1.0, "a4"), (5, -1.0, "a5~"), (6, 1.0, "+a6"), (6, -1.0, "-a6")]
)
def test_a_trigger_may_rest_at_either_end_or_in_the_middle(number: int, value: float, binding: str) -> None:
    mapper = Mapper(GUID, "Stick", REST)
    skip_to(mapper, Axis.LEFT_TRIGGER)
    answer(mapper, moved(number, value))
    assert mapper.mapping().bindings == {"lefttrigger": binding}


def test_a_trigger_that_is_an_axis_and_a_button_is_the_axis_and_one_that_is_a_button_is_that() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    skip_to(mapper, Axis.LEFT_TRIGGER)
    answer(mapper, pressed(6), replace(moved(4, 1.0), buttons=pressed(6).buttons))
    answer(mapper, pressed(7))
    assert mapper.mapping().bindings == {"lefttrigger": "a4", "righttrigger": "b7"}


def test_two_triggers_on_one_axis_are_its_halves() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    skip_to(mapper, Axis.LEFT_TRIGGER)
    answer(mapper, moved(3, 1.0))
    answer(mapper, moved(3, -1.0))
    assert mapper.mapping().bindings == {"lefttrigger": "+a3", "righttrigger": "-a3"}


def test_the_directional_pad_may_be_buttons_a_hat_or_axes() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    skip_to(mapper, Button.DPAD_UP)
    answer(mapper, pressed(11))
    answer(mapper, replace(REST, hats=((0, -1),)))
    answer(mapper, moved(0, -1.0))
    answer(mapper, moved(0, 1.0))
    assert mapper.mapping().bindings == {"dpup": "b11", "dpdown": "h0.4", "dpleft": "-a0", "dpright": "+a0"}


def test_what_is_not_one_thing_is_queried_again_and_says_why() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    answer(mapper, moved(2, 0.4), pressed(3))
    assert (requests_made(mapper), mapper.note) == (Axis.LEFT_X, "")
    answer(mapper, moved(2, 0.8), moved(3, 0.8))
    assert (requests_made(mapper), mapper.note) == (Axis.LEFT_X, "two were moved at once: once more, only the one")
    answer(mapper, moved(2, 1.0))
    answer(mapper, moved(2, 1.0))
    assert (requests_made(mapper), mapper.note) == (Axis.LEFT_Y, "that is leftx already: another one, or skip it")
    skip_to(mapper, Button.A)
    answer(mapper, moved(2, 1.0))
    assert (requests_made(mapper), mapper.note) == (Button.A, "that is leftx already: another one, or skip it")


def test_back_asks_again() -> None:
    mapper = Mapper(GUID, "Stick", REST)
    mapper.back()
    answer(mapper, moved(2, 1.0))
    mapper.back()
    assert requests_made(mapper) is Axis.LEFT_X
    answer(mapper, moved(1, 1.0))
    assert mapper.mapping().bindings == {"leftx": "a1"}


@pytest.mark.parametrize(
    ("rest", "error"),
    [
        (moved(2, 0.4), "axis 2 rests at 0.40, neither in its middle nor at an end"),
        (pressed(3), "a button is held"),
        (replace(REST, hats=((1, 0),)), "a button is held"),
    ],
)
def test_it_does_not_begin_before_all_is_at_rest(rest: RawState, error: str) -> None:
    with pytest.raises(JoystickError, match=error):
        Mapper(GUID, "Stick", rest)


@given(st.permutations(range(7)), st.lists(st.booleans(), min_size=4, max_size=4), st.permutations(range(16)))
def test_what_was_answered_is_what_the_file_says(axes: list[int], inverted: list[bool], buttons: list[int]) -> None:
    rest = RawState((0.0,) * 7, (False,) * 16)
    mapper = Mapper(GUID, "Stick", rest)
    sticks, free, expected = iter(axes), iter(buttons), {}
    signs = iter(inverted)
    while (question := mapper.question) is not None:
        if isinstance(question.target, Axis) and not question.target.is_trigger:
            number, sign = next(sticks), next(signs)
            expected[question.target.value] = f"a{number}{'~' if sign else ''}"
            answer(mapper, moved(number, -1.0 if sign else 1.0, rest), rest=rest)
        elif (button := next(free, None)) is None:
            mapper.skip()
        else:
            expected[question.target.value] = f"b{button}"
            answer(mapper, pressed(button, rest=rest), rest=rest)
    assert mapper.mapping().bindings == expected


def test_a_saved_mapping_replaces_the_one_before(tmp_path: Path) -> None:
    mapper = Mapper(GUID, "A, B", REST)
    mapper.mapping().save(tmp_path / "new")
    answer(mapper, moved(2, 1.0))
    mapper.mapping().save(tmp_path / "new")
    assert read_mappings(tmp_path / "new") == [f"{GUID},A  B,leftx:a2,platform:Linux,"]
