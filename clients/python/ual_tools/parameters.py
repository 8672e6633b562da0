"""`ual param`: the autopilot's own parameters."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import click

from ual.errors import InvalidArgumentError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual.interface import Parameters
from ual.parameters import SYSTEM_ID_NAMES, Difference, FileValues, Parameter, compare, range_text, read, write
from ual_tools import values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import REFUSED_STATUS, CommandSession, pass_session
from ual_tools.tables import print_table

_FILE = click.Path(path_type=Path, dir_okay=False)
_EXISTING = click.Path(path_type=Path, dir_okay=False, exists=True)


@click.group(
    "param",
    cls=UalGroup,
    section=Section.AUTOPILOT,
    examples=(
        "ual param list 'MPC_XY_*'",
        "ual param get MPC_XY_CRUISE",
        "ual param set MPC_XY_CRUISE 5",
        "ual param save before.params",
        "ual param compare before.params",
        "ual param load before.params",
    ),
)
def param() -> None:
    """Read, write and compare the parameters of the autopilot.

    They are written while the UAV is disarmed, and read back.
    """


@param.command("list", cls=UalCommand, examples=("ual param list", "ual param list 'BATT_*'"))
@click.argument("pattern", default="*")
@pass_session
def list_parameters(session: CommandSession, pattern: str) -> None:
    """List the parameters whose names match PATTERN (a shell's: *, ?).

    Those on which a flight relies cannot be written while the UAV is armed.
    """
    with session.connect() as uav:
        every = uav.parameters.get_all()
    found = [each for each in every if fnmatch.fnmatchcase(each.name.upper(), pattern.upper())]
    if not found:
        raise InvalidArgumentError(f"none of its {len(every)} parameters matches {pattern}", {"field": "pattern"})
    if session.as_json:
        for each in found:
            session.emit(each)
        return
    rows = [
        (
            each.name,
            each.text,
            each.unit,
            each.type.name,
            range_text(replace(each, unit="")),
            _notes(each),
            each.description,
        )
        for each in found
    ]
    print_table(("name", "value", "unit", "type", "range", "", "description"), rows)


@param.command("get", cls=UalCommand, examples=("ual param get MPC_XY_CRUISE",))
@click.argument("name")
@pass_session
def get(session: CommandSession, name: str) -> None:
    """Print the parameter NAME."""
    with session.connect() as uav:
        found = uav.parameters.get(name.upper())
    session.emit(found, found.text)


@param.command("set", cls=UalCommand, examples=("ual param set MPC_XY_CRUISE 5",))
@click.argument("name")
@click.argument("value", type=values.number)
@click.option(
    "--force",
    is_flag=True,
    help="Also while the UAV is armed, or out of range. Not for those on which a flight relies.",
)
@pass_session
def set_parameter(session: CommandSession, name: str, value: float, force: bool) -> None:
    """Write VALUE to the parameter NAME, and read it back."""
    with session.connect() as uav:
        found = uav.parameters.set(name.upper(), value, force=force)
    later = "; it takes effect at the next boot of the autopilot" if found.needs_reboot else ""
    session.emit(found, f"{found.name} is {found.text}{later}")


@param.command("save", cls=UalCommand, examples=("ual param save before.params", "ual param save before.param"))
@click.argument("file", type=_FILE)
@pass_session
def save(session: CommandSession, file: Path) -> None:
    """Save all parameters in FILE.

    .params is QGroundControl's form; .param and .parm are Mission Planner's and MAVProxy's.
    """
    with session.connect() as uav:
        count = _saved(uav.parameters.get_all(), file)
    session.emit({"done": "param save", "file": str(file), "count": count}, f"{count} parameters saved in {file}")


@param.command(
    "compare", cls=UalCommand, examples=("ual param compare before.params", "ual param compare --all my.param")
)
@click.argument("file", type=_EXISTING)
@click.option("--all-names", is_flag=True, help="Also parameters that the file does not have.")
@pass_session
def compare_file(session: CommandSession, file: Path, all_names: bool) -> None:
    """Print where the parameters in FILE and those of the UAV differ. Exit status 1 where they do."""
    in_file = _read(file)
    for other in in_file.left_out:
        session.note(f"left out: {other.text}")
    with session.connect() as uav:
        on_uav = uav.parameters.get_all() if all_names else _those_of(session, uav.parameters, in_file)
        differences = compare(in_file, on_uav, all_names=all_names)
    if session.as_json:
        for each in differences:
            session.emit(each)
    elif differences:
        print_table(("name", "in the file", "on the UAV"), [_row(each) for each in differences])
    else:
        click.echo(f"all {len(in_file)} parameters of {file} are alike on the UAV")
    if differences:
        raise click.exceptions.Exit(REFUSED_STATUS)


@param.command("load", cls=UalCommand, examples=("ual param load before.params", "ual param load --force my.param"))
@click.argument("file", type=_EXISTING)
@click.option("--force", is_flag=True, help="As of `set`.")
@pass_session
def load(session: CommandSession, file: Path, force: bool) -> None:
    """Write what differs in FILE from the UAV, and read each back.

    Those that take effect at the next boot come last, and at the very end the autopilot's system id, by which it
    becomes another system. What the UAV has not, or refuses, is printed, and the exit status is 1 then. So it is for
    all that was not written, if the link is lost meanwhile. Lines of other components (cameras, gimbals) are left out,
    and named.
    """
    in_file = _read(file)
    with session.connect() as uav:
        differences = compare(in_file, _those_of(session, uav.parameters, in_file))
        results = _all_loaded(session, uav.parameters, sorted(differences, key=_turn), force)
    written = [each for each in results if each is not None]
    later = [each.name for each in written if each.needs_reboot]
    text = f"{len(written)} of {len(differences)} parameters that differed were written"
    boot = f"; these take effect at the next boot of the autopilot: {', '.join(later)}" if later else ""
    result = {"done": "param load", "file": str(file), "written": len(written), "differed": len(differences)}
    others = [{"component": each.component, "count": len(each.names), "names": each.names} for each in in_file.left_out]
    left_out = "".join(f"; left out: {each.text}" for each in in_file.left_out)
    session.emit({**result, "needs_reboot": later, "left_out": others}, text + boot + left_out)
    if len(written) < len(differences):
        raise click.exceptions.Exit(REFUSED_STATUS)


def _those_of(session: CommandSession, parameters: Parameters, in_file: Mapping[str, float]) -> list[Parameter]:
    """Returns at least the parameters of a file. One that never comes does not keep the others from being known."""
    try:
        return parameters.get_all()
    except UalTimeoutError as error:
        session.note(f"{error.message}; so those of the file are read one by one")
    found = []
    for name in in_file:
        try:
            found.append(parameters.get(name))
        except (UalTimeoutError, InvalidArgumentError, RejectedByAutopilotError) as error:
            session.note(f"{name}: {error.message}")
    return found


def _turn(difference: Difference) -> tuple[bool, bool, bool, str]:
    """Returns the order in which parameters are written: later ones are those that take effect at the next boot, and
    before them those that flights rely on.

    The system id comes at the very end: some programs lose an autopilot that becomes another system.
    """
    found, is_id = difference.on_uav, difference.name in SYSTEM_ID_NAMES
    return is_id, found is not None and found.needs_reboot, found is not None and found.is_relied_on, difference.name


def _all_loaded(
    session: CommandSession, parameters: Parameters, differences: list[Difference], force: bool
) -> list[Parameter | None]:
    """Writes those that differ, in this order. An error after which none can be written names all that were not."""
    results: list[Parameter | None] = []
    for each in differences:
        try:
            results.append(_loaded(session, parameters, each, force))
        except UalError as error:
            left = ", ".join(other.name for other in differences[len(results) :])
            text = f"{error.message}; {len(results)} of {len(differences)} were tried; these were not written: {left}"
            raise type(error)(text, error.metadata) from None
    return results


def _loaded(session: CommandSession, parameters: Parameters, difference: Difference, force: bool) -> Parameter | None:
    """Writes one that differs. Returns None where the autopilot has none of this name, or refuses this value."""
    name, value, before = difference.name, difference.in_file, difference.on_uav
    if before is None or value is None:
        session.note(f"{name}: the UAV has no parameter of this name")
        return None
    try:
        found = parameters.set(name, value, force=force)
    except (InvalidArgumentError, RejectedByAutopilotError, UalTimeoutError) as error:
        session.note(f"{name}: {error.message}")
        return None
    session.emit(found, f"{name}: {before.text} -> {found.text}")
    return found


def _notes(parameter: Parameter) -> str:
    notes = ("a flight relies on it" if parameter.is_relied_on else "", "reboot" if parameter.needs_reboot else "")
    return ", ".join(filter(None, notes))


def _read(file: Path) -> FileValues:
    try:
        return read(file)
    except OSError as error:
        raise InvalidArgumentError(f"{file} cannot be read: {error.strerror}", {"field": "file"}) from None


def _saved(parameters: list[Parameter], file: Path) -> int:
    try:
        return write(parameters, file)
    except OSError as error:
        raise InvalidArgumentError(f"{file}: {error.strerror}", {"field": "file"}) from None


def _row(difference: Difference) -> tuple[str, str, str]:
    in_file, on_uav = difference.in_file, difference.on_uav
    return (
        difference.name,
        "is not there" if in_file is None else f"{in_file:.9g}",
        "is not there" if on_uav is None else on_uav.text,
    )


COMMANDS = (param,)
