"""`ual gimbal`: where the gimbals that the UAV carries look."""

from __future__ import annotations

import click

from ual.geometry import PointStamped, Vector3
from ual.gimbals import GimbalAngles, GimbalInfo, GimbalReference, GimbalStatus
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table
from ual_tools.values import angle, heading, number

_gimbal = click.option(
    "--gimbal", "gimbal_number", type=click.IntRange(0), default=0, show_default=True, help="Which one, as listed."
)


@click.group(
    "gimbal",
    cls=UalGroup,
    section=Section.CARRIED,
    examples=(
        "ual gimbal list",
        "ual gimbal angles 90deg",
        "ual gimbal point 10 5 0 --frame map",
        "ual gimbal watch",
        "ual gimbal neutral",
    ),
)
def gimbal() -> None:
    """Point gimbals, and see where they look.

    A positive pitch looks down, a positive yaw is to the left. No command moves the UAV, so none needs the lease.
    """


@gimbal.command("list", cls=UalCommand, examples=("ual gimbal list",))
@pass_session
def list_gimbals(session: CommandSession) -> None:
    """List the gimbals, and what each can do."""
    with session.connect() as uav:
        found = uav.gimbals.get_all()
    if session.as_json:
        for each in found:
            session.emit(each)
    elif found:
        print_table(("number", "name", "frame", "limits", "can", "note"), [_row(each) for each in found])
    else:
        click.echo("no gimbal was found")


@gimbal.command("status", cls=UalCommand, examples=("ual gimbal status",))
@_gimbal
@pass_session
def status(session: CommandSession, gimbal_number: int) -> None:
    """Print where a gimbal looks, and what it does."""
    with session.connect() as uav:
        found = uav.gimbals[gimbal_number].status()
    session.emit(found, _status_text(found))


@gimbal.command("watch", cls=UalCommand, examples=("ual gimbal watch", "ual --json gimbal watch --rate 20"))
@click.option("--rate", default="10", help="So many times a second.  [default: 10]")
@_gimbal
@pass_session
def watch(session: CommandSession, rate: str, gimbal_number: int) -> None:
    """Print where a gimbal looks, repeatedly, until Ctrl-C."""
    with session.connect() as uav:
        for found in uav.gimbals[gimbal_number].watch(number(rate)):
            session.emit(found, _status_text(found))


@gimbal.command(
    "angles",
    cls=UalCommand,
    examples=("ual gimbal angles 90deg", "ual gimbal angles 0.3 45deg", "ual gimbal angles 0 0 --reference earth"),
)
@click.argument("pitch", type=str)
@click.argument("yaw", type=str, default="0")
@click.argument("roll", type=str, default="0")
@click.option(
    "--reference",
    type=click.Choice([each.name.lower() for each in GimbalReference]),
    default="horizon",
    show_default=True,
    help="From what they count.",
)
@click.option("--frame", "frame_id", default="", help="With earth: from whose x axis yaw counts.  [default: <ns>/odom]")
@_gimbal
@pass_session
def angles(
    session: CommandSession, pitch: str, yaw: str, roll: str, reference: str, frame_id: str, gimbal_number: int
) -> None:
    """Turn to PITCH, YAW and ROLL: as 90deg or 1.57.

    horizon: level, and yaw from the nose. earth: level, and yaw in a frame. body: it tilts with the UAV.
    """
    with session.connect() as uav:
        uav.gimbals[gimbal_number].set_angles(
            angle(pitch), heading(yaw), angle(roll), reference=GimbalReference[reference.upper()], frame_id=frame_id
        )
    _done(session, "gimbal angles")


@gimbal.command("rates", cls=UalCommand, examples=("ual gimbal rates 0.1", "ual gimbal rates 0 -20deg"))
@click.argument("pitch", type=str)
@click.argument("yaw", type=str, default="0")
@_gimbal
@pass_session
def rates(session: CommandSession, pitch: str, yaw: str, gimbal_number: int) -> None:
    """Turn by PITCH and YAW each second, until the next order. Zeros hold."""
    with session.connect() as uav:
        uav.gimbals[gimbal_number].set_rates(angle(pitch), angle(yaw))
    _done(session, "gimbal rates")


@gimbal.command("point", cls=UalCommand, examples=("ual gimbal point 10 5 0", "ual gimbal point 0 0 0 --frame car"))
@click.argument("x", type=str)
@click.argument("y", type=str)
@click.argument("z", type=str)
@click.option("--frame", "frame_id", default="", help="The frame of the position.  [default: <ns>/odom]")
@_gimbal
@pass_session
def point(session: CommandSession, x: str, y: str, z: str, frame_id: str, gimbal_number: int) -> None:
    """Look at a position, and follow it while the UAV or the frame moves."""
    target = PointStamped(Vector3(number(x), number(y), number(z)), frame_id)
    with session.connect() as uav:
        uav.gimbals[gimbal_number].point_at(target)
    _done(session, "gimbal point")


@gimbal.command("neutral", cls=UalCommand, examples=("ual gimbal neutral",))
@_gimbal
@pass_session
def neutral(session: CommandSession, gimbal_number: int) -> None:
    """Turn to the neutral angles."""
    with session.connect() as uav:
        uav.gimbals[gimbal_number].move_to_neutral()
    _done(session, "gimbal neutral")


@gimbal.command("retract", cls=UalCommand, examples=("ual gimbal retract",))
@_gimbal
@pass_session
def retract(session: CommandSession, gimbal_number: int) -> None:
    """Retract it, as for a landing."""
    with session.connect() as uav:
        uav.gimbals[gimbal_number].retract()
    _done(session, "gimbal retract")


@gimbal.command("control", cls=UalCommand, examples=("ual gimbal control take", "ual gimbal control release"))
@click.argument("action", type=click.Choice(["take", "release"]))
@_gimbal
@pass_session
def control(session: CommandSession, action: str, gimbal_number: int) -> None:
    """Take the control of it from another program, or give it up."""
    with session.connect() as uav:
        chosen = uav.gimbals[gimbal_number]
        (chosen.take_control if action == "take" else chosen.release_control)()
    _done(session, f"gimbal control {action}")


def _done(session: CommandSession, command: str) -> None:
    session.emit({"done": command}, "done")


def _row(info: GimbalInfo) -> tuple[str, str, str, str, str, str]:
    can = ", ".join(each.name.lower() for each in sorted(info.abilities, key=lambda it: it.value))
    limits = ", ".join(
        f"{name} {range_.least_rad:.2f} to {range_.most_rad:.2f} rad"
        for name, range_ in (("pitch", info.pitch), ("yaw", info.yaw))
        if range_
    )
    notes = "; ".join(filter(None, ("" if info.is_connected else "is not heard", info.note)))
    return str(info.number), info.name, info.frame_id, limits, can, notes


def _status_text(status: GimbalStatus) -> str:
    parts = [
        "it is not known where it looks" if status.angles is None else _angles_text(status.angles),
        "" if status.activity is None else status.activity.name.lower(),
        "" if status.off_target_rad is None else f"{status.off_target_rad:.2f} rad beside its target",
        "" if status.control is None else f"control: {status.controller or status.control.name.lower()}",
        *status.problems,
    ]
    return ", ".join(filter(None, parts))


def _angles_text(angles: GimbalAngles) -> str:
    return f"pitch {angles.pitch_rad:.2f} yaw {angles.yaw_rad:.2f} roll {angles.roll_rad:.2f} rad"


COMMANDS = (gimbal,)
