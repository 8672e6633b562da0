"""Step two: from the standard layout to sticks and actions, and the file that says which."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.joystick import Axis, Button, GamepadState
from ual_tools.strict_yaml.loading import YamlFileError
from ual_tools.teleop.actions import Action
from ual_tools.teleop.layout import TWO_BUTTONS, Layout, StickAxis
from ual_tools.teleop.layout_file import load
from ual_tools.teleop.sticks import CENTRED, Sticks

LAYOUT = Layout()
VALUE = st.floats(-1.0, 1.0)
BUTTONS = st.frozensets(st.sampled_from(list(Button)))
DOCS = Path(__file__).parents[2] / "docs" / "how-to" / "fly-by-joystick.md"


def axis(dead_zone: float = 0.1, expo: float = 0.3) -> StickAxis:
    return StickAxis(Axis.LEFT_X, dead_zone=dead_zone, expo=expo)


def deflection(of: StickAxis, value: float) -> float:
    return of.deflection(GamepadState(left_x=value))


@given(st.lists(VALUE, min_size=2), st.floats(0.0, 0.9), st.floats(0.0, 0.99))
def test_a_deflection_is_odd_and_grows_from_the_dead_zone_to_the_end(
    values: list[float], dead_zone: float, expo: float
) -> None:
    of = axis(dead_zone, expo)
    found = [deflection(of, value) for value in sorted(values)]
    assert all(before <= after for before, after in pairwise(found))
    for value in values:
        assert deflection(of, value) == -deflection(of, -value)
        assert abs(value) > dead_zone or deflection(of, value) == 0.0
        assert abs(deflection(of, value)) <= max(0.0, abs(value) - dead_zone) / (1.0 - dead_zone) + 1e-9
    assert [deflection(of, -1.0), deflection(of, 1.0)] == pytest.approx([-1.0, 1.0])


def test_a_deflection_begins_at_zero_behind_the_dead_zone() -> None:
    assert 0.0 < deflection(axis(), 0.1001) < 1e-3


@given(VALUE, VALUE, VALUE, VALUE, BUTTONS)
def test_nothing_flies_while_the_dead_mans_button_is_not_held(
    left_x: float, left_y: float, right_x: float, right_y: float, pressed: frozenset[Button]
) -> None:
    state = GamepadState(left_x, left_y, right_x, right_y, pressed=pressed - {Button.LEFT_SHOULDER})
    assert LAYOUT.steered(state) == CENTRED


def test_a_stick_that_is_pushed_away_flies_forward_and_up_and_one_to_the_left_left() -> None:
    state = GamepadState(-1.0, -1.0, -1.0, -1.0, pressed=frozenset((Button.LEFT_SHOULDER,)))
    assert LAYOUT.steered(state) == Sticks(1.0, 1.0, 1.0, 1.0)


@given(st.lists(BUTTONS))
def test_an_action_begins_once_and_only_with_all_its_buttons(presses: list[frozenset[Button]]) -> None:
    before: frozenset[Button] = frozenset()
    held: set[Action] = set()
    for pressed in presses:
        complete = {action for action, buttons in LAYOUT.actions.items() if buttons <= pressed}
        begun = LAYOUT.begun(before, pressed)
        assert set(begun) <= complete - held
        before, held = pressed, complete


@pytest.mark.parametrize(
    ("pressed", "actions"),
    [
        ({Button.START}, [Action.MODE]),
        ({Button.START, Button.RIGHT_SHOULDER}, [Action.ARM]),
        ({Button.Y}, []),
        ({Button.Y, Button.RIGHT_SHOULDER}, [Action.TAKE_OFF]),
        ({Button.B}, [Action.STOP]),
    ],
)
def test_the_larger_of_two_combinations_is_meant(pressed: set[Button], actions: list[Action]) -> None:
    assert LAYOUT.begun(frozenset(), frozenset(pressed)) == actions


def test_what_makes_it_move_needs_two_buttons() -> None:
    assert {len(LAYOUT.actions[action]) for action in TWO_BUTTONS} == {2}


def test_the_file_of_the_docs_is_the_default(tmp_path: Path) -> None:
    [text] = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path / "joystick.yaml"
    file.write_text(text, encoding="utf-8")
    assert load(file) == LAYOUT


def test_a_file_says_only_what_is_different(tmp_path: Path) -> None:
    file = tmp_path / "joystick.yaml"
    file.write_text(
        "hold: none\ndead_zone: 0.2\nsticks: {up: {axis: righttrigger, expo: 0}}\nactions: {stop: x, headless: none}\n",
        encoding="utf-8",
    )
    found = load(file)
    assert found.hold is None
    assert found.sticks["up"] == StickAxis(Axis.RIGHT_TRIGGER, dead_zone=0.2, expo=0.0)
    assert found.sticks["left"] == StickAxis(Axis.RIGHT_X, is_inverted=True, dead_zone=0.2)
    assert found.actions[Action.STOP] == {Button.X}
    assert Action.HEADLESS not in found.actions


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("dead_zone: 1", "1: dead_zone: expected a number from 0 to below 1"),
        ("sticks:\n  forwards: lefty", "2: sticks.forwards: there is no such key"),
        ("sticks:\n  forward: a0", "2: sticks.forward: expected leftx"),
        ("sticks:\n  forward: {dead_zone: 0.2}", "2: sticks.forward: axis is missing"),
        ("actions:\n  take_off: y", "2: actions.take_off: needs two buttons together"),
        ("actions:\n  stop: []", "2: actions.stop: expected a button, or none"),
        ("hold: shoulder", "1: hold: expected a, b"),
        ("button: a", "1: button: there is no such key"),
    ],
)
def test_a_wrong_file_is_refused_with_its_row(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "joystick.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(YamlFileError) as caught:
        load(file)
    assert why in str(caught.value)
