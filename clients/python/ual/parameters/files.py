"""Files of parameters: of QGroundControl (``.params``), Mission Planner and MAVProxy (``.param``, ``.parm``).

QGroundControl: lines of five fields with tabs between them: system, component, name, value, type (MAV_PARAM_TYPE).
Mission Planner: lines ``NAME,value``. MAVProxy: the same with spaces. ``#`` begins a comment. All are read, whatever
the file is called; the end of its name says which one is written. A line has exactly these fields: a comma within a
number is refused, as one program writes it for a point, another one for thousands.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ual.errors import InvalidArgumentError
from ual.parameters.values import Parameter, ParameterType, is_equal, is_same
from ual.shared import whole_file
from ual.shared.numbers import parse_number, shown
from ual.shared.text import read_text, rows_of

QGC_ENDING = ".params"
ENDINGS = (QGC_ENDING, ".param", ".parm")
MOST_BYTES = 4 << 20
"""A file that is larger is not read. ArduPilot's 1,400 parameters are 30 kB."""

AUTOPILOT = 1
"""The component of an autopilot (MAV_COMP_ID_AUTOPILOT1). Cameras and gimbals have parameters of their own."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,15}|[A-Za-z_][A-Za-z0-9_]{0,29}\.[A-Za-z0-9_]{1,30}")
"""MAVLink's param_id has 16 characters. A Crazyflie has the name of a group before each."""
_QGC_FIELDS_COUNT = 5
_LARGEST_MAVLINK_ID = 255
_LONG_TYPES = (7, 8, 10)
"""Types of 64 bits, which no parameter of an autopilot has."""
_NOT_FINITE = re.compile(r"[-+]?(nan|inf)", re.IGNORECASE)
_SPACES = re.compile(r"[ \t]+")
_MOST_NAMES = 10
_HEAD = "# Onboard parameters for Vehicle {system_id}\n#\n# Vehicle-Id Component-Id Name Value Type\n"


@dataclass(frozen=True, slots=True)
class OtherComponent:
    """Parameters in a file that another component than the autopilot has."""

    component: int
    names: tuple[str, ...]

    @property
    def text(self) -> str:
        """Human-readable."""
        more = f" and {len(self.names) - _MOST_NAMES} more" if len(self.names) > _MOST_NAMES else ""
        lines = "1 line" if len(self.names) == 1 else f"{len(self.names)} lines"
        return f"{lines} of component {self.component} ({', '.join(self.names[:_MOST_NAMES])}{more})"


class FileValues(dict[str, float]):
    """The values of a file, by name. `left_out` are those of other components."""

    def __init__(self, values: Mapping[str, float], left_out: tuple[OtherComponent, ...] = ()) -> None:
        super().__init__(values)
        self.left_out = left_out


@dataclass(frozen=True, slots=True)
class Difference:
    """A parameter that a file and the autopilot do not have alike; None where one of them lacks it."""

    name: str
    in_file: float | None
    on_uav: Parameter | None


def write(parameters: Iterable[Parameter], path: Path, system_id: int = 1) -> int:
    """Writes parameters into a file, sorted by name, in the form that the end of its name says. Returns how many.

    Raises:
        InvalidArgumentError: The name ends in none of `ENDINGS`.
        OSError: It cannot be written.

    """
    if path.suffix.lower() not in ENDINGS:
        raise InvalidArgumentError(f"{path}: the name of the file must end in {', '.join(ENDINGS)}", {"field": "file"})
    ordered = sorted(parameters, key=lambda each: each.name)
    if path.suffix.lower() == QGC_ENDING:
        lines = [f"{system_id}\t1\t{each.name}\t{each.text}\t{each.type.value}\n" for each in ordered]
        text = _HEAD.format(system_id=system_id) + "".join(lines)
    else:
        text = "".join(f"{each.name},{each.text}\n" for each in ordered)
    whole_file.write(path, text)
    return len(ordered)


def read(path: Path) -> FileValues:
    """Returns the values in a file, by name. Those of other components than the autopilot are left out, and named.

    Raises:
        InvalidArgumentError: A line is none of a parameter, or one is there twice with two values; the line is named.
            Or the file has none of an autopilot.
        OSError: It cannot be read.

    """
    try:
        text = read_text(path, MOST_BYTES)
    except ValueError as error:
        raise InvalidArgumentError(f"{path}: {error}", {"field": "file"}) from None
    found = _Found()
    for number, line in enumerate(rows_of(text), 1):
        try:
            found.take(line.partition("#")[0].strip())
        except ValueError as error:
            raise InvalidArgumentError(f"{path}, line {number}: {error}", {"field": "file"}) from None
    left_out = found.left_out()
    if AUTOPILOT not in found.values:
        has = f": it has {', '.join(each.text for each in left_out)}" if left_out else ""
        raise InvalidArgumentError(f"{path}: it has no parameters of an autopilot{has}", {"field": "file"})
    return FileValues(found.values[AUTOPILOT], left_out)


def compare(in_file: Mapping[str, float], on_uav: Iterable[Parameter], *, all_names: bool = False) -> list[Difference]:
    """Returns where a file and an autopilot differ, by name.

    `all_names`: also what the file does not have. A file is often a part of all parameters, so that is no difference
    unless asked for.
    """
    by_name = {each.name: each for each in on_uav}
    names = sorted({*in_file, *by_name} if all_names else in_file)
    pairs = (Difference(name, in_file.get(name), by_name.get(name)) for name in names)
    return [pair for pair in pairs if not _is_alike(pair)]


def _is_alike(pair: Difference) -> bool:
    return pair.in_file is not None and pair.on_uav is not None and is_same(pair.on_uav, pair.in_file)


class _Found:
    """The values of the lines so far, by component."""

    def __init__(self) -> None:
        self.values: dict[int, dict[str, float]] = {}
        self._system: int | None = None

    def take(self, line: str) -> None:
        """Takes a line without its comment. Raises `ValueError`."""
        if not line:
            return
        fields = [each.strip(" \t") for each in line.split(",")] if "," in line else _SPACES.split(line)
        if len(fields) == 2 and not _SPACES.search(fields[0]):
            self._keep(AUTOPILOT, fields[0], _value(*fields))
        elif len(fields) == _QGC_FIELDS_COUNT and "," not in line:
            self._keep(*self._of_qgroundcontrol(*fields))
        else:
            raise ValueError(f"expected a name and a value, got {shown(line)}{_about_commas(line)}")

    def left_out(self) -> tuple[OtherComponent, ...]:
        """Returns what others than the autopilot have."""
        others = sorted(self.values.keys() - {AUTOPILOT})
        return tuple(OtherComponent(each, tuple(self.values[each])) for each in others)

    def _of_qgroundcontrol(
        self, system: str, component: str, name: str, value: str, kind: str
    ) -> tuple[int, str, float]:
        of_system, of_component = _id(system, "system"), _id(component, "component")
        if self._system not in (None, of_system):
            raise ValueError(f"it is of system {of_system}, and lines before of system {self._system}")
        self._system = of_system
        number = _value(name, value)
        if kind.isascii() and kind.isdecimal() and int(kind) in _LONG_TYPES and of_component != AUTOPILOT:
            return of_component, name, number
        _require_of_type(name, number, value, kind)
        return of_component, name, number

    def _keep(self, component: int, name: str, value: float) -> None:
        before = self.values.setdefault(component, {}).setdefault(name, value)
        if not is_equal(before, value):
            raise ValueError(f"{name} was {before:.9g} before, and is {value:.9g} here")


def _id(text: str, what: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= _LARGEST_MAVLINK_ID):
        raise ValueError(f"{shown(text)} is no {what} (0 to {_LARGEST_MAVLINK_ID})")
    return int(text)


def _value(name: str, text: str) -> float:
    if not _NAME.fullmatch(name):
        raise ValueError(f"{shown(name)} is no name of a parameter")
    if _NOT_FINITE.fullmatch(text):
        return float(text)  # PX4 has some that are NaN
    try:
        return parse_number(text)
    except ValueError:
        raise ValueError(f"{name}: {shown(text)} is no number{_about_commas(text)}") from None


def _require_of_type(name: str, value: float, text: str, kind: str) -> None:
    known = {str(each.value): each for each in ParameterType}
    if kind not in known:
        raise ValueError(f"{name}: {shown(kind)} is no type of a parameter (MAV_PARAM_TYPE)")
    low, high = known[kind].limits
    is_of_type = low <= value <= high and value.is_integer() if known[kind].is_whole else not abs(value) > high
    if not is_of_type and not (math.isinf(value) and not known[kind].is_whole):
        raise ValueError(f"{name}: {text} is no value of the type {known[kind].name} ({kind})")


def _about_commas(text: str) -> str:
    return " (a comma in a number can mean a point or thousands: write a point)" if "," in text else ""
