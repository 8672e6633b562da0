"""Files of parameters: of QGroundControl (``.params``), Mission Planner and MAVProxy (``.param``, ``.parm``).

QGroundControl: lines of five fields with tabs between them: system, component, name, value, type (MAV_PARAM_TYPE).
Mission Planner: lines ``NAME,value``. MAVProxy: the same with spaces. Lines that begin with ``#`` are comments. Both
are read, whatever the file is called; the end of its name says which one is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ual.errors import InvalidArgumentError
from ual.parameters.values import Parameter, is_equal, is_same

QGC_ENDING = ".params"
ENDINGS = (QGC_ENDING, ".param", ".parm")
MOST_BYTES = 4 << 20
"""A file that is larger is not read. ArduPilot's 1,400 parameters are 30 kB."""

_NAME = re.compile(r"[A-Za-z0-9_]{1,16}|[A-Za-z0-9_]{1,30}\.[A-Za-z0-9_]{1,30}")
"""MAVLink's param_id has 16 characters. A Crazyflie has the name of a group before each."""
_QGC_FIELDS_COUNT = 5
_HEAD = "# Onboard parameters for Vehicle {system_id}\n#\n# Vehicle-Id Component-Id Name Value Type\n"


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
    path.write_text(text, encoding="ascii")
    return len(ordered)


def read(path: Path) -> dict[str, float]:
    """Returns the values in a file, by name.

    Raises:
        InvalidArgumentError: A line is none of a parameter, or one is there twice with two values; the line is named.
        OSError: It cannot be read.

    """
    if path.stat().st_size > MOST_BYTES:
        raise InvalidArgumentError(f"{path}: a file of parameters has at most {MOST_BYTES} bytes", {"field": "file"})
    found: dict[str, float] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            name, value = _parameter(line)
        except ValueError as error:
            raise InvalidArgumentError(f"{path}, line {number}: {error}", {"field": "file"}) from None
        if not is_equal(found.setdefault(name, value), value):
            what = f"{path}, line {number}: {name} was {found[name]:g} before, and is {value:g} here"
            raise InvalidArgumentError(what, {"field": "file"})
    return found


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


def _parameter(line: str) -> tuple[str, float]:
    fields = line.replace(",", " ").split()
    if len(fields) == _QGC_FIELDS_COUNT and fields[0].isdecimal():
        fields = fields[2:4]
    if len(fields) < 2:
        raise ValueError(f"expected a name and a value, got {line.strip()!r:.60}")
    if not _NAME.fullmatch(fields[0]):
        raise ValueError(f"{fields[0]!r:.40} is no name of a parameter")
    try:
        return fields[0], float(fields[1])  # PX4 has some that are NaN
    except ValueError:
        raise ValueError(f"{fields[0]}: {fields[1]!r:.40} is no number") from None
