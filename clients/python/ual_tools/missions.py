"""`ual mission`: missions that the autopilot flies by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from ual import interface, missions
from ual.errors import InvalidArgumentError
from ual.missions.items import Item, words_of
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress
from ual.routes import RouteError
from ual.types import AltitudeReference
from ual_tools import values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table

C = TypeVar("C", bound=Callable[..., Any])

_FILE = click.Path(path_type=Path, dir_okay=False, exists=True)
_REFERENCES = {"home": AltitudeReference.HOME, "amsl": AltitudeReference.AMSL}
_LOSSES = {each.name.lower(): each for each in LinkLossAction}


@click.group(
    "mission",
    cls=UalGroup,
    section=Section.FLYING,
    examples=(
        "ual mission plan survey.plan",
        "ual mission upload survey.plan",
        "ual mission start",
        "ual mission status",
    ),
)
def mission() -> None:
    """Bring missions to the autopilot, which flies them by itself.

    A mission goes on where the link or the daemon is lost.
    """


def _reading(command: C) -> C:
    """Adds the file of a mission, and what says how its altitudes are meant."""
    command = click.option(
        "--altitude", "altitude_m", type=values.number, help="Fly all of a line (KML, GPX, GeoJSON) so high above home."
    )(command)
    command = click.option(
        "--reference", type=click.Choice(list(_REFERENCES)), help="What the altitudes of GPX and GeoJSON count from."
    )(command)
    return click.argument("file", type=_FILE)(command)


@mission.command("plan", cls=UalCommand, examples=("ual mission plan survey.plan",))
@_reading
@pass_session
def plan(session: CommandSession, file: Path, altitude_m: float | None, reference: str | None) -> None:
    """Make a dry run of the mission in FILE.

    It tells the length and the time, and whether the UAV may fly it.
    """
    items = _read(file, altitude_m, reference).items
    with session.connect() as uav:
        found = uav.mission.plan(items)
    session.emit(found, _plan_text(found))


@mission.command("upload", cls=UalCommand, examples=("ual mission upload survey.plan",))
@_reading
@pass_session
def upload(session: CommandSession, file: Path, altitude_m: float | None, reference: str | None) -> None:
    """Upload the mission in FILE, and read it back."""
    read = _read(file, altitude_m, reference)
    with session.connect() as uav:
        found = uav.mission.upload(read.items)
    done = {
        "done": "mission upload",
        "items": len(found.items),
        "digest": found.digest,
        "left_out": read.left_out,
    }
    session.emit(done, f"{len(found.items)} items are on the autopilot, and were read back")


@mission.command("download", cls=UalCommand, examples=("ual mission download",))
@pass_session
def download(session: CommandSession) -> None:
    """Print the mission that the autopilot has."""
    with session.connect() as uav:
        found = uav.mission.download()
    if session.as_json:
        for each in found.items:
            session.emit(_row(each))
        return
    if not found.items:
        click.echo("the autopilot has no mission")
        return
    print_table(("item", "what", ""), [(str(number), *_cells(each)) for number, each in enumerate(found.items, 1)])


@mission.command("clear", cls=UalCommand, examples=("ual mission clear",))
@pass_session
def clear(session: CommandSession) -> None:
    """Remove the mission from the autopilot."""
    with session.connect() as uav:
        uav.mission.clear()
    session.emit({"done": "mission clear"}, "the autopilot has no mission")


@mission.command("start", cls=UalCommand, examples=("ual mission start", "ual mission start --from 5 --wait"))
@click.option("--from", "first_item", type=click.IntRange(min=1), default=1, help="Begin with this item.")
@click.option("--on-link-loss", type=click.Choice(list(_LOSSES)), help="Start only if the autopilot would do this.")
@click.option("--wait", "is_waited_for", is_flag=True, help="Wait for its end.")
@pass_session
def start(session: CommandSession, first_item: int, on_link_loss: str | None, is_waited_for: bool) -> None:
    """Fly the mission that the autopilot has."""
    loss = None if on_link_loss is None else _LOSSES[on_link_loss]
    with session.connect() as uav:
        info = uav.mission.start(first_item, loss)
        session.emit(info, info.description)
        if is_waited_for:
            info = uav.task(info.id).wait()
            session.emit(info, "the mission has ended")


@mission.command("pause", cls=UalCommand, examples=("ual mission pause",))
@pass_session
def pause(session: CommandSession) -> None:
    """Hold on the way of the mission."""
    _do(session, "pause", lambda current: current.pause(), "the UAV holds on the way of its mission")


@mission.command("resume", cls=UalCommand, examples=("ual mission resume",))
@pass_session
def resume(session: CommandSession) -> None:
    """Go on with the mission after a pause."""
    _do(session, "resume", lambda current: current.resume(), "the mission goes on")


@mission.command("jump", cls=UalCommand, examples=("ual mission jump 12",))
@click.argument("item", type=click.IntRange(min=1))
@pass_session
def jump(session: CommandSession, item: int) -> None:
    """Fly on to ITEM of the mission."""
    _do(session, "jump", lambda current: current.jump_to(item), f"the mission goes on with item {item}")


@mission.command("status", cls=UalCommand, examples=("ual mission status",))
@pass_session
def status(session: CommandSession) -> None:
    """Print how far the autopilot is with its mission."""
    with session.connect() as uav:
        found = uav.mission.progress()
    session.emit(found, _progress_text(found))


def _do(session: CommandSession, name: str, act: Callable[[interface.Mission], None], text: str) -> None:
    with session.connect() as uav:
        act(uav.mission)
    session.emit({"done": f"mission {name}"}, text)


def _read(file: Path, altitude_m: float | None, reference: str | None) -> missions.Mission:
    above = None if reference is None else _REFERENCES[reference]
    try:
        found = missions.read(file, altitude_m=altitude_m, altitude_reference=above)
    except RouteError as error:
        raise InvalidArgumentError(str(error), {"field": "file"}) from None
    for what in found.left_out:
        click.echo(f"left out: {what}", err=True)
    return found


def _plan_text(found: MissionPlan) -> str:
    return (
        f"{found.length_m:.0f} m in {found.duration_s:.0f} s, {found.executed_count} items, "
        f"from {found.lowest_m:.1f} to {found.highest_m:.1f} m above the ground of the take-off"
    )


def _progress_text(found: MissionProgress) -> str:
    item = "" if found.item is None else f", item {found.item}"
    whose = f", task {found.task_id}" if found.task_id else ", no task of UAL"
    return f"{found.stage.name.lower().replace('_', ' ')}{item}{whose}"


def _row(item: Item) -> dict[str, object]:
    fields = {name: getattr(item, name) for name in item.__dataclass_fields__ if name != "number"}
    shown = {name: getattr(value, "name", value) for name, value in fields.items() if value is not None}
    return {"what": words_of(item), **shown}


def _cells(item: Item) -> tuple[str, str]:
    row = _row(item)
    what = str(row.pop("what"))
    return what, ", ".join(f"{name} {_text(value)}" for name, value in row.items())


def _text(value: object) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


COMMANDS = (mission,)
