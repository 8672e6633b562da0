"""Makes the mapping of a device by asking for each axis and button in turn. Reads no device and shows nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from ual.joystick._errors import JoystickError
from ual.joystick._mapping import Mapping
from ual.joystick._state import Axis, Button, RawState

_MOVED_DEFLECTION = 0.6
"""An axis counts as moved from this far from its rest on: sticks that are pushed aside move the other axis, too."""
_REST_DEFLECTION = 0.25
"""A worn stick or one of a remote control's may rest this far from the middle."""
_HAT_DIRECTIONS = {(0, 1): 1, (1, 0): 2, (0, -1): 4, (-1, 0): 8}


@dataclass(frozen=True)
class Question:
    """Question to the user."""

    target: Axis | Button
    text: str


QUESTIONS = (
    Question(Axis.LEFT_X, "push the left stick to the right, and let go"),
    Question(Axis.LEFT_Y, "pull the left stick towards you, and let go"),
    Question(Axis.RIGHT_X, "push the right stick to the right, and let go"),
    Question(Axis.RIGHT_Y, "pull the right stick towards you, and let go"),
    Question(Button.LEFT_SHOULDER, "press the left shoulder button, the upper one"),
    Question(Button.RIGHT_SHOULDER, "press the right shoulder button, the upper one"),
    Question(Axis.LEFT_TRIGGER, "pull the left trigger all the way, and let go"),
    Question(Axis.RIGHT_TRIGGER, "pull the right trigger all the way, and let go"),
    Question(Button.A, "press A, the lower one of the four buttons (cross)"),
    Question(Button.B, "press B, the right one of the four buttons (circle)"),
    Question(Button.X, "press X, the left one of the four buttons (square)"),
    Question(Button.Y, "press Y, the upper one of the four buttons (triangle)"),
    Question(Button.BACK, "press BACK, left of the middle (select, share)"),
    Question(Button.START, "press START, right of the middle (options)"),
    Question(Button.GUIDE, "press the button in the middle (the maker's sign)"),
    Question(Button.DPAD_UP, "press the directional pad up"),
    Question(Button.DPAD_DOWN, "press the directional pad down"),
    Question(Button.DPAD_LEFT, "press the directional pad to the left"),
    Question(Button.DPAD_RIGHT, "press the directional pad to the right"),
    Question(Button.LEFT_STICK, "press the left stick in, like a button"),
    Question(Button.RIGHT_STICK, "press the right stick in, like a button"),
)


@dataclass
class _MovedControls:
    """Axes that were moved, and buttons that were pressed, since all was at rest."""

    extremes: dict[int, float] = field(default_factory=dict)
    """Of each axis, the position farthest from its rest."""
    buttons: set[int] = field(default_factory=set)
    hats: set[tuple[int, int]] = field(default_factory=set)
    """Number and direction."""


class Mapper:
    """Asks for each axis and button in turn.

    Give it what the device says, repeatedly, and show its `question` and its `note`. Before it begins, all axes
    must have been moved once, as some devices say 0 until then, and all must be at rest again.

    Args:
        guid: Of the device.
        name: Of the device.
        rest: What it says while nothing is touched.

    Raises:
        JoystickError: A button is held, or an axis is neither in its middle nor at one of its ends.

    """

    def __init__(self, guid: str, name: str, rest: RawState) -> None:
        self._guid, self._name, self._rest = guid, name, rest
        self._answers: list[str | None] = []
        self._moved = _MovedControls()
        self.note = ""
        """Why the last answer was not taken, if it was not."""
        _require_rest(rest)

    @property
    def question(self) -> Question | None:
        """Present question; None at the end."""
        return QUESTIONS[len(self._answers)] if len(self._answers) < len(QUESTIONS) else None

    def feed(self, state: RawState) -> None:
        """Takes what the device says now. An answer is taken when all is at rest again."""
        if self.question is None:
            return
        if not self._is_at_rest(state):
            self._compare_with_rest(state)
        elif self._moved != _MovedControls():
            moved, self._moved = self._moved, _MovedControls()
            self._answer(self.question.target, moved)

    def skip(self) -> None:
        """Leaves out what is requested: the device has no such axis or button."""
        if self.question is not None:
            self._on_answer(None)

    def back(self) -> None:
        """Asks the last question again."""
        if self._answers:
            self._answers.pop()
        self.note = ""

    def mapping(self) -> Mapping:
        """Returns the mapping by the answers so far."""
        answered = zip(QUESTIONS, self._answers, strict=False)
        return Mapping(self._guid, self._name, {each.target.value: how for each, how in answered if how is not None})

    def _is_at_rest(self, state: RawState) -> bool:
        return not (any(state.buttons) or any(map(any, state.hats))) and all(
            abs(value - rest) < _REST_DEFLECTION for value, rest in zip(state.axes, self._rest.axes, strict=True)
        )

    def _compare_with_rest(self, state: RawState) -> None:
        for number, (value, rest) in enumerate(zip(state.axes, self._rest.axes, strict=True)):
            if abs(value - rest) > abs(self._moved.extremes.get(number, rest) - rest):
                self._moved.extremes[number] = value
        self._moved.buttons |= {number for number, is_held in enumerate(state.buttons) if is_held}
        self._moved.hats |= {
            (number, _HAT_DIRECTIONS[hat]) for number, hat in enumerate(state.hats) if hat in _HAT_DIRECTIONS
        }

    def _answer(self, target: Axis | Button, moved: _MovedControls) -> None:
        """Takes what was moved as the answer, if it is one thing and not another's."""
        found = self._found(target, moved)
        if len(found) != 1:
            self.note = "two were moved at once: once more, only the one" if found else ""
        elif (used := self._user(found[0])) is not None:
            self.note = f"that is {used} already: another one, or skip it"
        else:
            self._on_answer(found[0])

    def _found(self, target: Axis | Button, moved: _MovedControls) -> list[str]:
        """Returns the bindings that may be meant. Some triggers are an axis and a button at once."""
        axes = self._moved_axes(target, moved)
        if isinstance(target, Axis) and (axes or not target.is_trigger):
            return axes
        buttons = [f"b{number}" for number in sorted(moved.buttons)]
        return buttons or [f"h{number}.{direction}" for number, direction in sorted(moved.hats)] or axes

    def _moved_axes(self, target: Axis | Button, moved: _MovedControls) -> list[str]:
        deflections = {number: value - self._rest.axes[number] for number, value in moved.extremes.items()}
        is_stick = isinstance(target, Axis) and not target.is_trigger
        return [
            self._axis(number, deflection, is_stick=is_stick)
            for number, deflection in deflections.items()
            if abs(deflection) > _MOVED_DEFLECTION
        ]

    def _axis(self, number: int, deflection: float, *, is_stick: bool) -> str:
        """Returns the binding of an axis that was moved to one side: of all of it, or of its half on that side."""
        if is_stick or abs(self._rest.axes[number]) > 0.5:
            return f"a{number}" if deflection > 0.0 else f"a{number}~"
        return f"+a{number}" if deflection > 0.0 else f"-a{number}"

    def _user(self, binding: str) -> str | None:
        """Returns what is bound to this already, or to all of the axis of which this is a half."""
        for question, answer in zip(QUESTIONS, self._answers, strict=False):
            if answer is not None and _is_shared(answer, binding):
                return str(question.target.value)
        return None

    def _on_answer(self, answer: str | None) -> None:
        self._answers.append(answer)
        self.note = ""


def _is_shared(one: str, other: str) -> bool:
    """Returns True if two bindings cannot be told apart. Two different halves of an axis can."""
    if one.strip("+-~") != other.strip("+-~"):
        return False
    return one == other or not (one[0] in "+-" and other[0] in "+-")


def _require_rest(rest: RawState) -> None:
    if any(rest.buttons) or any(map(any, rest.hats)):
        raise JoystickError("a button is held: let go of all")
    for number, value in enumerate(rest.axes):
        if min(abs(value - each) for each in (-1.0, 0.0, 1.0)) >= _REST_DEFLECTION:
            raise JoystickError(
                f"axis {number} rests at {value:.2f}, neither in its middle nor at an end: let go of all"
            )
