"""`ual fence`: the fence and the rally points that the autopilot keeps."""

from __future__ import annotations

from pathlib import Path

import click

from ual.errors import InvalidArgumentError
from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint, read
from ual.types import AltitudeReference
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table

_EXISTING = click.Path(path_type=Path, dir_okay=False, exists=True)
_FORCE = "Also while the UAV is armed."


@click.group(
    "fence",
    cls=UalGroup,
    section=Section.AUTOPILOT,
    examples=(
        "ual fence show",
        "ual fence upload",
        "ual fence upload field.plan --replace",
        "ual fence disable",
        "ual fence clear",
    ),
)
def fence() -> None:
    """Read, upload and enable the fence of the autopilot.

    It applies it by itself, also while UAL is not there. It is written while the UAV is disarmed, and read back.
    """


@fence.command("show", cls=UalCommand, examples=("ual fence show", "ual --json fence show"))
@pass_session
def show(session: CommandSession) -> None:
    """Print the zones and rally points of the autopilot.

    It says whether the autopilot applies the zones, too.
    """
    with session.connect() as uav:
        _print(session, uav.fence.get())


@fence.command("upload", cls=UalCommand, examples=("ual fence upload", "ual fence upload field.plan --replace"))
@click.argument("file", type=_EXISTING, required=False)
@click.option("--replace", is_flag=True, help="Also where the autopilot has another fence, or other rally points.")
@click.option("--keep-disabled", is_flag=True, help="Leave it as it is whether the autopilot applies its zones.")
@click.option("--force", is_flag=True, help=_FORCE)
@pass_session
def upload(session: CommandSession, file: Path | None, replace: bool, keep_disabled: bool, force: bool) -> None:
    """Upload the fence and rally points in FILE, and enable them.

    They are read back first.

    Without FILE it is the polygon of the geofence in UAL's own configuration. FILE is a .plan of QGroundControl, or a
    file of a fence or of rally points of Mission Planner or MAVProxy (.waypoints, .fen, .ral).
    """
    plan = None if file is None else _read(session, file)
    with session.connect() as uav:
        _print(session, uav.fence.upload(plan, replace=replace, enable=not keep_disabled, force=force))


@fence.command("clear", cls=UalCommand, examples=("ual fence clear", "ual fence clear --rally-points"))
@click.option("--rally-points", is_flag=True, help="Remove the rally points, too.")
@click.option("--force", is_flag=True, help=_FORCE)
@pass_session
def clear(session: CommandSession, rally_points: bool, force: bool) -> None:
    """Remove all zones."""
    with session.connect() as uav:
        _print(session, uav.fence.clear(with_rally_points=rally_points, force=force))


@fence.command("enable", cls=UalCommand, examples=("ual fence enable",))
@pass_session
def enable(session: CommandSession) -> None:
    """Have the autopilot apply its zones."""
    with session.connect() as uav:
        _print(session, uav.fence.enable())


@fence.command("disable", cls=UalCommand, examples=("ual fence disable",))
@pass_session
def disable(session: CommandSession) -> None:
    """Have the autopilot no longer apply its zones."""
    with session.connect() as uav:
        _print(session, uav.fence.disable())


def _read(session: CommandSession, file: Path) -> FencePlan:
    try:
        plan = read(file)
    except OSError as error:
        raise InvalidArgumentError(f"{file} cannot be read: {error.strerror}", {"field": "file"}) from None
    for what in plan.left_out:
        session.note(f"left out: {what}")
    return plan


def _print(session: CommandSession, kept: KeptFence) -> None:
    if session.as_json:
        session.emit(kept)
        return
    rows = [*map(_zone_row, kept.zones), *map(_rally_row, kept.rally_points)]
    if kept.return_point is not None:
        rows.append(("point to return to", _position_text(*kept.return_point)))
    if rows:
        print_table(("what", "places"), rows)
    click.echo(_summary(kept))


def _zone_row(zone: FenceZone) -> tuple[str, str]:
    return zone.text, " ".join(_position_text(*each) for each in zone.points)


def _rally_row(point: RallyPoint) -> tuple[str, str]:
    above = "the sea" if point.reference is AltitudeReference.AMSL else "home"
    return f"rally point, {point.height_m} m above {above}", _position_text(point.latitude_deg, point.longitude_deg)


def _position_text(latitude_deg: float, longitude_deg: float) -> str:
    return f"{latitude_deg:.7f},{longitude_deg:.7f}"


def _summary(kept: KeptFence) -> str:
    applied = {
        True: "it applies its fence",
        False: "it does not apply its fence",
        None: "it does not say whether it applies its fence",
    }
    if not kept.zones:
        return "the autopilot has no fence of zones"
    zones = "1 zone" if len(kept.zones) == 1 else f"{len(kept.zones)} zones"
    return f"the autopilot has {zones}, and {applied[kept.is_enabled]}"


COMMANDS = (fence,)
