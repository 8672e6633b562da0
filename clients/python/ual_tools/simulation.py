"""``ual sim`` controls the safety pilot, faults, time, noise and wind of a simulated UAV."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable

import click

from ual.geometry import Vector3
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual_tools import complete, values
from ual_tools.app import Multi, UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table


@click.group("sim", cls=UalGroup, section=Section.SIMULATION, examples=("ual sim arm", "ual sim speed 10"))
def sim() -> None:
    """Control the world around a simulated UAV.

    That is its safety pilot, faults, time, noise, wind and place. A simulation may offer any of these parts.
    """


def _pilot(name: str, help_text: str, done: str, act: str) -> None:
    def run(session: CommandSession) -> None:
        with session.connect() as uav:
            getattr(uav.simulation, act)()
        session.emit({"done": f"sim {name}"}, done)

    examples = (f"ual sim {name}",)
    sim.add_command(UalCommand(name, callback=pass_session(run), help=help_text, examples=examples, multi=Multi.EACH))


_pilot("arm", "The safety pilot arms.", "armed by the pilot", "pilot_arm")
_pilot("disarm", "The safety pilot disarms.", "disarmed by the pilot", "pilot_disarm")
_pilot("take-over", "The safety pilot takes over and flies by hand.", "the pilot flies", "pilot_take_over")
_pilot("give-back", "The safety pilot switches back to the daemon.", "given back by the pilot", "pilot_give_back")


@sim.command("sticks", cls=UalCommand, examples=("ual sim sticks --forward 0.5",))
@click.option("--forward", type=values.number, default=0.0)
@click.option("--left", type=values.number, default=0.0)
@click.option("--up", type=values.number, default=0.0)
@click.option("--turn", type=values.number, default=0.0, help="To the left.")
@pass_session
def sticks(session: CommandSession, forward: float, left: float, up: float, turn: float) -> None:
    """The safety pilot holds the sticks.

    Each is from -1 to 1; 0 releases it.
    """
    with session.connect() as uav:
        uav.simulation.pilot_move_sticks(forward=forward, left=left, up=up, turn=turn)
    session.emit({"done": "sim sticks"}, "sticks moved")


@sim.command("speed", cls=UalCommand, examples=("ual sim speed 10",), multi=Multi.EACH)
@click.argument("factor", type=values.number)
@pass_session
def speed(session: CommandSession, factor: float) -> None:
    """Let time run FACTOR times as fast as the clock.

    1 is real time; at 0 it stands still; inf is as fast as possible.
    """
    with session.connect() as uav:
        uav.simulation.set_speed_factor(factor)
    session.emit({"done": "sim speed", "speed_factor": factor if math.isfinite(factor) else "inf"}, "speed set")


@sim.command("step", cls=UalCommand, examples=("ual sim step 0.5",), multi=Multi.EACH)
@click.argument("duration_s", type=values.number, metavar="SECONDS")
@pass_session
def step(session: CommandSession, duration_s: float) -> None:
    """Advance time that stands still by SECONDS."""
    with session.connect() as uav:
        uav.simulation.step(duration_s)
    session.emit({"done": "sim step"}, f"{duration_s:g} s passed")


@sim.command("noise", cls=UalCommand, examples=("ual sim noise 0.05 0.02",), multi=Multi.EACH)
@click.argument("position_m", type=values.number, metavar="POSITION")
@click.argument("velocity_m_s", type=values.number, metavar="VELOCITY")
@pass_session
def noise(session: CommandSession, position_m: float, velocity_m_s: float) -> None:
    """Set the noise of the estimates.

    POSITION (m) and VELOCITY (m/s) are its standard deviations.
    """
    with session.connect() as uav:
        uav.simulation.set_noise(position_m=position_m, velocity_m_s=velocity_m_s)
    session.emit({"done": "sim noise"}, "noise set")


@sim.command("wind", cls=UalCommand, examples=("ual sim wind 2 0",), multi=Multi.EACH)
@click.argument("x", type=values.number)
@click.argument("y", type=values.number)
@click.argument("z", type=values.number, default=0.0)
@pass_session
def wind(session: CommandSession, x: float, y: float, z: float) -> None:
    """Set a steady wind. X Y Z is the velocity of the air (m/s, map axes)."""
    with session.connect() as uav:
        uav.simulation.set_wind(Vector3(x, y, z))
    session.emit({"done": "sim wind"}, "wind set")


@sim.command("place", cls=UalCommand, examples=("ual sim place 2 -1",))
@click.argument("x", type=values.number)
@click.argument("y", type=values.number)
@click.argument("z", type=values.number, default=0.0)
@click.option(
    "--yaw", type=values.heading, default="0", help="Its heading, counter-clockwise from east: 90deg or 1.57."
)
@pass_session
def put_on_ground(session: CommandSession, x: float, y: float, z: float, yaw: float) -> None:
    """Put the UAV on the ground at X Y Z, disarmed and at rest.

    X, Y and Z are metres east, north and up from where <ns>/odom began.
    """
    with session.connect() as uav:
        uav.simulation.place_on_ground(Vector3(x, y, z), yaw)
    session.emit({"done": "sim place"}, "placed")


@sim.command("parts", cls=UalCommand, examples=("ual sim parts",))
@pass_session
def parts(session: CommandSession) -> None:
    """List the parts of the world that this simulation offers."""
    with session.connect() as uav:
        names = sorted(part.name.lower() for part in uav.simulation.parts())
    session.emit({"parts": names}, "\n".join(names))


@sim.group("fault", cls=UalGroup, examples=("ual sim fault begin link-lost --for 3",))
def fault() -> None:
    """Begin, end and list simulated faults."""


@fault.group("begin", cls=UalGroup, examples=("ual sim fault begin link-lost --for 3",))
def begin() -> None:
    """Begin a fault; prints its id."""


_duration = click.option(
    "--for", "duration_s", type=values.number, default=0.0, help="End by itself after this many (simulated) seconds."
)
_command = click.option(
    "--command",
    "command",
    type=click.Choice([each.name.lower() for each in Command]),
    default=Command.ANY.name.lower(),
    show_default=True,
)


def _begin(session: CommandSession, new: Fault, duration_s: float) -> None:
    with session.connect() as uav:
        fault_id = uav.simulation.begin_fault(new, duration_s)
    session.emit({"fault_id": fault_id}, fault_id)


def _simple(name: str, help_text: str, make: Callable[[], Fault]) -> None:
    def run(session: CommandSession, duration_s: float) -> None:
        _begin(session, make(), duration_s)

    begin.command(name, cls=UalCommand, help=help_text, examples=(f"ual sim fault begin {name} --for 3",))(
        _duration(pass_session(run))
    )


_simple("link-lost", "The link to the autopilot carries nothing either way.", LinkLost)
_simple("position-lost", "The autopilot loses its position.", PositionLost)


@begin.command(
    "estimator-jumps", cls=UalCommand, examples=("ual sim fault begin estimator-jumps --offset 0,0,-1 --period 2",)
)
@click.option("--offset", type=values.vector, default="1,0,0", show_default=True, help="By how much (m).")
@click.option("--period", "period_s", type=values.number, default=5.0, show_default=True, help="Between two jumps.")
@_duration
@pass_session
def estimator_jumps(session: CommandSession, offset: Vector3, period_s: float, duration_s: float) -> None:
    """The position estimate jumps by an offset and back again."""
    _begin(session, EstimatorJumps(offset, period_s), duration_s)


@begin.command("motors-weak", cls=UalCommand, examples=("ual sim fault begin motors-weak --power 0.4",))
@click.option("--power", "power_ratio", type=values.number, default=0.5, show_default=True, help="0 to 1.")
@_duration
@pass_session
def motors_weak(session: CommandSession, power_ratio: float, duration_s: float) -> None:
    """The motors give only a part of their power."""
    _begin(session, MotorsWeak(power_ratio), duration_s)


@begin.command("battery-low", cls=UalCommand, examples=("ual sim fault begin battery-low --percent 5",))
@click.option("--percent", type=values.number, default=10.0, show_default=True, help="0 to 100.")
@_duration
@pass_session
def battery_low(session: CommandSession, percent: float, duration_s: float) -> None:
    """The battery falls to a low charge."""
    _begin(session, BatteryLow(percent), duration_s)


@begin.command("command-refused", cls=UalCommand, examples=("ual sim fault begin command-refused --command take_off",))
@_command
@click.option("--text", default="refused by a simulated fault", show_default=True)
@_duration
@pass_session
def command_refused(session: CommandSession, command: str, text: str, duration_s: float) -> None:
    """The autopilot refuses a command with a text."""
    _begin(session, CommandRefused(Command[command.upper()], text), duration_s)


@begin.command("ack-lost", cls=UalCommand, examples=("ual sim fault begin ack-lost --command arm",))
@_command
@_duration
@pass_session
def ack_lost(session: CommandSession, command: str, duration_s: float) -> None:
    """The autopilot obeys a command; the acknowledgement is lost."""
    _begin(session, AckLost(Command[command.upper()]), duration_s)


@begin.command("ack-late", cls=UalCommand, examples=("ual sim fault begin ack-late --delay 2",))
@_command
@click.option("--delay", "delay_s", type=values.number, default=1.0, show_default=True, help="Seconds.")
@_duration
@pass_session
def ack_late(session: CommandSession, command: str, delay_s: float, duration_s: float) -> None:
    """The acknowledgement of a command arrives late."""
    _begin(session, AckLate(Command[command.upper()], delay_s), duration_s)


@begin.command("failsafe", cls=UalCommand, examples=("ual sim fault begin failsafe",))
@click.option("--cause", default=FailsafeTriggered().cause, show_default=True, help="As `ual state` names it.")
@_duration
@pass_session
def failsafe(session: CommandSession, cause: str, duration_s: float) -> None:
    """A failsafe of the autopilot.

    It holds its position, and follows no references.
    """
    _begin(session, FailsafeTriggered(cause), duration_s)


@fault.command("end", cls=UalCommand, examples=("ual sim fault end",))
@click.argument("fault_id", default="", metavar="[ID]", shell_complete=complete.faults)
@pass_session
def end(session: CommandSession, fault_id: str) -> None:
    """End the fault ID, or all of them."""
    with session.connect() as uav:
        uav.simulation.end_fault(fault_id)
    session.emit({"done": "sim fault end"}, "fault ended" if fault_id else "faults ended")


@fault.command("list", cls=UalCommand, examples=("ual sim fault list",))
@pass_session
def list_faults(session: CommandSession) -> None:
    """List the active faults."""
    with session.connect() as uav:
        found = uav.simulation.faults()
    if session.as_json:
        for fault_id, active in found.items():
            session.emit({"fault_id": fault_id, "kind": type(active).__name__, "fault": active})
        return
    print_table(("id", "fault"), [(fault_id, _fault_text(active)) for fault_id, active in found.items()])


def _fault_text(fault: Fault) -> str:
    """Returns a fault as `ual sim fault begin` names it, with its values."""
    values = (f"{field.name}={_value_text(getattr(fault, field.name))}" for field in dataclasses.fields(fault))
    return " ".join([fault_name(type(fault)), *values])


def fault_name(kind: type[Fault]) -> str:
    """Returns the name of a kind of fault: ``link-lost``."""
    return re.sub(r"(?<!^)(?=[A-Z])", "-", kind.__name__).lower()


def _value_text(value: object) -> str:
    if isinstance(value, Vector3):
        return ",".join(f"{component:g}" for component in value)
    return value.name.lower() if isinstance(value, Command) else str(value)


COMMANDS = (sim,)
