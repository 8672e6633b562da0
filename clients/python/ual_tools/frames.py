"""Commands for frames."""

from __future__ import annotations

import click

from ual.geometry import Quaternion, Transform, Vector3
from ual_tools import complete, values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.output import vector_text
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table


@click.group(
    "frames",
    cls=UalGroup,
    invoke_without_command=True,
    section=Section.FRAMES,
    examples=("ual frames", "ual frames add pad 1 -2 0.5 --yaw 90deg"),
)
@click.pass_context
def frames(context: click.Context) -> None:
    """List the frames, add one, or remove one."""
    if context.invoked_subcommand is None:
        context.invoke(list_frames)


@pass_session
def list_frames(session: CommandSession) -> None:
    """Prints all frames with their parents."""
    with session.connect() as uav:
        found = uav.frames()
    if session.as_json:
        for frame in found:
            session.emit(frame)
        return
    rows = []
    for frame in found:
        transform = frame.transform
        where = "" if transform is None else vector_text(transform.translation)
        yaw = "" if transform is None else f"{transform.rotation.yaw_rad:.3f}"
        rows.append((frame.frame_id, frame.parent_frame_id, where, yaw, "fixed" if frame.is_static else "moves"))
    print_table(("frame", "parent", "x y z (m)", "yaw (rad)", ""), rows)


@frames.command("add", cls=UalCommand, examples=("ual frames add pad 1 -2 0.5 --yaw 90deg",))
@click.argument("name")
@click.argument("x", type=values.number)
@click.argument("y", type=values.number)
@click.argument("z", type=values.number)
@click.option(
    "--yaw", type=values.heading, default="0", help="Its rotation about z, counter-clockwise: 90deg, 1.57rad or 1.57."
)
@click.option("--parent", default="", help="Its parent; map when not given.", shell_complete=complete.frames)
@pass_session
def add(session: CommandSession, name: str, x: float, y: float, z: float, yaw: float, parent: str) -> None:
    """Add the frame NAME at X Y Z in its parent, or move it there."""
    with session.connect() as uav:
        uav.add_frame(Transform(Vector3(x, y, z), Quaternion.from_yaw(yaw), parent, name))
    session.emit({"done": "frames add", "frame_id": name}, f"frame {name} added")


@frames.command("remove", cls=UalCommand, examples=("ual frames remove pad",))
@click.argument("name", shell_complete=complete.frames)
@pass_session
def remove(session: CommandSession, name: str) -> None:
    """Remove the frame NAME, which was added."""
    with session.connect() as uav:
        uav.remove_frame(name)
    session.emit({"done": "frames remove", "frame_id": name}, f"frame {name} removed")


COMMANDS = (frames,)
