"""Commands as calls of MAVROS' services.

``set_mode`` answers only that its message was sent, and ``cmd/...`` with the autopilot's acknowledgement, or after 5 s
without one. So the effect counts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from ual.errors import NotSupportedError
from ual_daemon.backends.engine.command import (
    ARMING,
    FLYING,
    Command,
    Repeat,
    Verdict,
    shows_armed,
    shows_landed,
    shows_mode,
)
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.gripper_codec import PayloadOrder, ordered
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.values import LandedState, Snapshot

CALL_S = 6.0
MODE_AGE_LIMIT_S = 0.3
"""A mode is requested only while the present one was reported within this time. A PX4 that is armed is queried for a
heartbeat each 0.2 s, and an ArduPilot streams ten a second. Where they come once a second, a mode leaves with one.
"""
TEXT_S = 0.3
"""Seconds after a refusal within which the autopilot's texts about it may come."""
_AGAIN = Repeat(every_s=1.0, most=5, after_answer_s=0.3)
"""A mode that was sent may show 0.3 s late. Another one that is shown sooner does not say that it was not entered."""
_ACCEPTED, _FAILED, _IN_PROGRESS = 0, 4, 5
_NO_ACK_S = 4.5
"""MAVROS waits for 5 s, and then says FAILED (version 1.21)."""
_MISSION_START_COMMAND = 300
_NO_FRAME = 2
"""MAV_FRAME_MISSION."""
_RESULTS = {1: "TEMPORARILY_REJECTED", 2: "DENIED", 3: "UNSUPPORTED", 4: "FAILED", 6: "CANCELLED"}

Answer = Message | ServiceError
"""The answer of a service, or why there is none."""


class MavrosCall(NamedTuple):
    """A service of MAVROS, and its arguments."""

    service: str
    arguments: Message

    @property
    def mode(self) -> str:
        """The mode that it requests; empty if it requests none."""
        return str(self.arguments.get("custom_mode", ""))


def set_mode(
    name: str, what: str, setpoints_before_s: float = 0.0, then: Command[MavrosCall] | None = None
) -> Command[MavrosCall]:
    """Changes the mode."""
    return Command(
        what,
        MavrosCall(topics.SET_MODE, {"base_mode": 0, "custom_mode": name}),
        FLYING,
        mode=name,
        shows=shows_mode(name),
        repeat=_AGAIN,
        mode_age_s=MODE_AGE_LIMIT_S,
        setpoints_before_s=setpoints_before_s,
        then=then,
    )


def arm_or_disarm(*, is_arming: bool) -> Command[MavrosCall]:
    """Arms or disarms, never by force."""
    what, call = "arm" if is_arming else "disarm", MavrosCall(topics.ARMING, {"value": is_arming})
    return Command(what, call, ARMING, shows=shows_armed(is_armed=is_arming), repeat=_AGAIN)


def climb(altitude_m: float) -> Command[MavrosCall]:
    """Takes off to a height above home, as ArduPilot takes it. Its place is where it stands."""
    unset = {"min_pitch": 0.0, "yaw": 0.0, "latitude": 0.0, "longitude": 0.0}
    shows = shows_landed(LandedState.TAKING_OFF, LandedState.IN_AIR)
    return Command(
        "take off", MavrosCall(topics.TAKE_OFF, {**unset, "altitude": altitude_m}), FLYING, shows=shows, repeat=_AGAIN
    )


def arming(autopilot: Autopilot, snapshot: Snapshot) -> Command[MavrosCall]:
    """Arms, from a mode in which it can be armed."""
    mode = snapshot.control.mode_name
    arm = arm_or_disarm(is_arming=True)
    if autopilot.can_be_armed_in(mode):
        return arm
    return set_mode(autopilot.arming_mode, f"leave {mode}, to be armed", then=arm)


def taking_off(autopilot: Autopilot, altitude_m: float | None) -> Command[MavrosCall]:
    """Takes off: by setpoints, or to a height above home."""
    then = None if altitude_m is None else climb(altitude_m)
    return set_mode(autopilot.setpoint_mode, "take off", autopilot.setpoints_before_mode_s, then)


def move(order: PayloadOrder) -> Command[MavrosCall]:
    """Moves something that the UAV carries. Sent once: MAVROS refuses a second one while it waits for an answer."""
    params = {f"param{number}": value for number, value in enumerate(order.params, 1)}
    call = MavrosCall(topics.COMMAND, {"command": order.id, **params})
    return replace(ordered(Command(order.what, call), order), repeat=Repeat(every_s=CALL_S + 0.5, most=1))


def as_int(order: PayloadOrder) -> Message:
    """Returns the arguments of cmd/command_int for an order, which has no place: MAVROS waits for no answer to it."""
    param1, param2, param3, param4, x, y, z = order.params
    params = {"param1": param1, "param2": param2, "param3": param3, "param4": param4}
    return {"frame": _NO_FRAME, "command": order.id, **params, "x": int(x), "y": int(y), "z": z}


def fly_mission(autopilot: Autopilot) -> Command[MavrosCall]:
    """Enters the mode in which it flies its mission. Never arms.

    ArduPilot enters it by a command, without which it waits on the ground for a raised throttle.

    Raises:
        NotSupportedError: UAL flies no missions of this one.

    """
    codec = autopilot.missions
    if codec is None:
        raise NotSupportedError(f"UAL flies no missions of {autopilot.name}")
    what = "fly the mission"
    if codec.is_ardupilot:
        call = MavrosCall(topics.COMMAND, {"command": _MISSION_START_COMMAND})
        return Command(what, call, FLYING, mode=codec.mode)
    return set_mode(codec.mode, what)


class MavrosReply(NamedTuple):
    """Verdict, text and author of an answer; see `CommandRunner.on_answer`."""

    verdict: Verdict
    text: str = ""
    by: str = ""


def read_answer(call: MavrosCall, answer: Answer, after_s: float = 0.0) -> MavrosReply:
    """Reads the answer of a service, which came after a time. One that has not come in time may have been executed."""
    if isinstance(answer, ServiceTimeoutError):
        return MavrosReply(Verdict.LOST)
    if isinstance(answer, ServiceError):
        return MavrosReply(Verdict.REFUSED, str(answer), "MAVROS")
    if call.service == topics.SET_MODE:
        unknown = MavrosReply(Verdict.REFUSED, "MAVROS does not know the mode, or hears no autopilot")
        return MavrosReply(Verdict.PASSED_ON) if answer.get("mode_sent") else unknown
    return _read_result(call, int(answer.get("result", _ACCEPTED)), after_s, is_done=bool(answer.get("success")))


def _read_result(call: MavrosCall, result: int, after_s: float, *, is_done: bool) -> MavrosReply:
    """MAVROS passes on the first acknowledgement only: of one that says "in progress" the end is never reported.

    Arming and take-off show their effect, so they wait for it. Of what else is commanded only answers tell.
    """
    if is_done:
        return MavrosReply(Verdict.ACCEPTED)
    if result == _FAILED and after_s >= _NO_ACK_S:
        return MavrosReply(Verdict.LOST)
    is_told_by_answer = call.service == topics.COMMAND
    if result == _IN_PROGRESS:
        return MavrosReply(Verdict.ACCEPTED if is_told_by_answer else Verdict.PASSED_ON)
    if result == _ACCEPTED:  # no acknowledgement came
        return MavrosReply(Verdict.LOST if is_told_by_answer else Verdict.PASSED_ON)
    return MavrosReply(Verdict.REFUSED, _RESULTS.get(result, f"result {result}"))
