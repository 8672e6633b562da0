"""`ual gripper`: the grippers, winches, servos and relays that the UAV carries."""

from __future__ import annotations

from collections.abc import Iterator

import click

from ual.gripper import Equipment, GripperInfo, RelayInfo, ServoInfo, WinchAction, WinchInfo
from ual_tools import values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table

_name = click.option("--name", default="", help="Which one, where there are several.")


@click.group(
    "gripper",
    cls=UalGroup,
    section=Section.CARRIED,
    examples=(
        "ual gripper list",
        "ual gripper release",
        "ual gripper winch length --length 2",
        "ual gripper servo open",
        "ual gripper relay on",
    ),
)
def gripper() -> None:
    """Move grippers, winches, servos and relays.

    Those that the daemon's configuration names, and no others.
    """


@gripper.command("list", cls=UalCommand, examples=("ual gripper list", "ual --json gripper list"))
@pass_session
def list_equipment(session: CommandSession) -> None:
    """List what may be moved, and what is known of it."""
    with session.connect() as uav:
        found = uav.gripper.get_all()
    found_rows = list(rows(found))
    if session.as_json:
        session.emit(found)
    elif found_rows:
        print_table(("kind", "name", "state", "ordered", "note"), found_rows)
    else:
        click.echo("nothing is configured: see payload in the daemon's settings")


@gripper.command("grip", cls=UalCommand, examples=("ual gripper grip", "ual gripper grip claw"))
@click.argument("name", default="")
@pass_session
def grip(session: CommandSession, name: str) -> None:
    """Close a gripper."""
    with session.connect() as uav:
        uav.gripper.grip(name)
    _done(session, "gripper grip")


@gripper.command("release", cls=UalCommand, examples=("ual gripper release", "ual gripper release claw"))
@click.argument("name", default="")
@pass_session
def release(session: CommandSession, name: str) -> None:
    """Open a gripper: what it holds falls."""
    with session.connect() as uav:
        uav.gripper.release(name)
    _done(session, "gripper release")


@gripper.command(
    "winch",
    cls=UalCommand,
    examples=("ual gripper winch length --length 2", "ual gripper winch rate --rate -0.5", "ual gripper winch hold"),
)
@click.argument("action", type=click.Choice([each.name.lower().replace("_", "-") for each in WinchAction]))
@click.option("--length", "length_m", type=values.number, help="For length: how much to let out, m; negative takes in.")
@click.option("--rate", "rate_m_s", type=values.number, help="How fast, m/s; negative takes in.")
@_name
@pass_session
def winch(session: CommandSession, action: str, length_m: float | None, rate_m_s: float | None, name: str) -> None:
    """Have a winch do something.

    It is done after the command has ended: see `ual gripper list`.
    """
    wanted = WinchAction[action.upper().replace("-", "_")]
    with session.connect() as uav:
        uav.gripper.order_winch(wanted, winch=name, length_m=length_m, rate_m_s=rate_m_s)
    _done(session, f"gripper winch {action}")


@gripper.command("servo", cls=UalCommand, examples=("ual gripper servo open", "ual gripper servo --pwm 1500"))
@click.argument("position", default="")
@click.option("--pwm", "pwm_us", type=int, help="A pulse width in microseconds, instead of a position.")
@_name
@pass_session
def servo(session: CommandSession, position: str, pwm_us: int | None, name: str) -> None:
    """Move a servo to a POSITION of the configuration."""
    with session.connect() as uav:
        uav.gripper.set_servo(position, servo=name, pwm_us=pwm_us)
    _done(session, "gripper servo")


@gripper.command("relay", cls=UalCommand, examples=("ual gripper relay on", "ual gripper relay lit --name lamp"))
@click.argument("state")
@_name
@pass_session
def relay(session: CommandSession, state: str, name: str) -> None:
    """Switch a relay to a STATE."""
    with session.connect() as uav:
        uav.gripper.set_relay(state, relay=name)
    _done(session, "gripper relay")


def _done(session: CommandSession, command: str) -> None:
    session.emit({"done": command}, "done")


def rows(found: Equipment) -> Iterator[tuple[str, str, str, str, str]]:
    """Yields the kind of each device, its name, its state, what it was ordered, and why something is not known."""
    for kind, devices in (
        ("gripper", found.grippers),
        ("winch", found.winches),
        ("servo", found.servos),
        ("relay", found.relays),
    ):
        for each in devices:
            yield kind, each.name, _state(each), each.ordered, each.note


def _state(each: GripperInfo | WinchInfo | ServoInfo | RelayInfo) -> str:
    if isinstance(each, GripperInfo):
        return each.state.name.lower()
    if isinstance(each, WinchInfo):
        return _winch_state(each)
    if isinstance(each, RelayInfo):
        return "unknown" if each.is_on is None else each.on_name if each.is_on else each.off_name
    pulse = "unknown" if each.pwm_us is None else f"{each.pwm_us} us"
    return f"{each.position} ({pulse})" if each.position else pulse


def _winch_state(each: WinchInfo) -> str:
    status = each.status
    if status is None:
        return "unknown"
    parts = (
        "" if status.length_m is None else f"{status.length_m:.1f} m out",
        "" if not status.speed_m_s else f"{status.speed_m_s:+.1f} m/s",
        "" if status.tension_n is None else f"{status.tension_n:.0f} N",
        "" if status.is_healthy else "not healthy",
        "turns freely" if status.is_clutch_engaged else "",
    )
    return ", ".join(filter(None, parts))


COMMANDS = (gripper,)
