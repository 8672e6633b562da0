"""The gimbal of an aircraft, by the gimbal module of psdk_ros2.

The module takes angles on a topic, and answers nothing. Roll and pitch count from the horizon, yaw from east: it stays
so while the aircraft turns. So angles from the nose are sent again whenever the nose has turned.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Quaternion, Vector3, wrap_angle
from ual.gimbals import GimbalAbility, GimbalAngles, GimbalControl, GimbalInfo, GimbalReference
from ual_daemon.backends import futures
from ual_daemon.backends.chain import caught, then
from ual_daemon.backends.dji.cameras import Surroundings
from ual_daemon.backends.offers.gimbals import FindableGimbal, GimbalAttitude
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.rosbridge.fields import number

ROTATION, ROTATION_TYPE = "psdk_ros2/gimbal_rotation", "psdk_interfaces/GimbalRotation"
RESET = "psdk_ros2/gimbal_reset"
PAYLOAD_PORT = 1
"""The first port: the wrapper reports only that one's angles."""
ABSOLUTE, PITCH_AND_YAW = 1, 1
"""`E_DjiGimbalRotationMode` and `E_DjiGimbalResetMode`."""
TURN_S, AIM_S = 0.5, 0.1
"""Seconds that a turn may take: of an order, and of angles that are sent often."""
ANGLES_SILENCE_S = 3.0
"""Seconds without reported angles after which a gimbal counts as not connected. The wrapper tells them once a second at
least.
"""
NOSE_TURN_RAD = 0.01
"""Turn of the nose in rad after which angles that count from it are sent again."""
REACHED_RAD, ASIDE_RAD, SETTLED_S = 0.05, 0.1, 1.0
"""Angle in rad within which it is where it was ordered to be; angle beyond which another operator has turned it, some
seconds after the last order. The safety pilot turns it by the dial of the remote controller, and keeps it then.
"""
FOREIGN_CONTROL_S = 2.0
"""Seconds for which another program then has the control of the gimbal. DJI has no control that could be taken back: a
later order is taken again.
"""
CALL_TIMEOUT_S = 5.0
_NAME = "payload 1"
_ABILITIES = frozenset(
    {GimbalAbility.PITCH, GimbalAbility.YAW, GimbalAbility.HORIZON, GimbalAbility.EARTH, GimbalAbility.NEUTRAL}
)
_PROBLEMS = {
    "pitch_limited": "its pitch is at a limit",
    "roll_limited": "its roll is at a limit",
    "yaw_limited": "its yaw is at a limit",
    "calibrating": "it calibrates itself",
    "gyro_falut": "its gyroscope has failed",
    "fw_updating": "its firmware is updated",
}
"""Meaning of each flag of its status; the wrapper spells them so."""


class _ReportedAngles(NamedTuple):
    """Angles that were reported, and when."""

    orientation: Quaternion
    time_s: float


class _FromNose(NamedTuple):
    """Angles that count from the nose, and where that pointed when they were sent."""

    angles: GimbalAngles
    heading_rad: float


class _SentTarget:
    """Target that was sent last: whether it was reached since the order, and when it was sent."""

    def __init__(self, pitch_rad: float, yaw_rad: float, time_s: float, *, is_reached: bool) -> None:
        self._pitch_rad = pitch_rad
        self._yaw_rad = yaw_rad
        self._time_s = time_s
        self.is_reached = is_reached

    def is_left(self, pitch_rad: float, yaw_rad: float, now_s: float) -> bool:
        """Takes where it looks. Returns whether somebody else has turned it aside."""
        off_rad = max(abs(wrap_angle(pitch_rad - self._pitch_rad)), abs(wrap_angle(yaw_rad - self._yaw_rad)))
        self.is_reached = self.is_reached or off_rad < REACHED_RAD
        return self.is_reached and off_rad > ASIDE_RAD and now_s - self._time_s > SETTLED_S


class DjiGimbal(FindableGimbal):
    """The gimbal at the first port. `on_angles`, `on_status` and `tick` are for the link's thread.

    Args:
        around: The same that its camera has.
        publish: Publishes on a topic of the wrapper.
        heading_rad: Returns where the nose points; None where that is not known.

    """

    def __init__(
        self,
        around: Surroundings,
        publish: Callable[[str, Message], None],
        heading_rad: Callable[[], float | None],
    ) -> None:
        self._around = around
        self._publish = publish
        self._heading_rad = heading_rad
        self._lock = threading.Lock()
        self._reported: _ReportedAngles | None = None
        self._is_mounted: bool | None = None
        """None while its status was not reported."""
        self._first_s: float | None = None
        self._problems: tuple[str, ...] = ()
        self._from_nose: _FromNose | None = None
        self._target: _SentTarget | None = None
        self._is_turned_aside = False
        """Whether somebody else has turned it since our last order."""
        self._aside_s = -math.inf

    @property
    @override
    def is_found(self) -> bool:
        """Whether it has ever reported its angles."""
        return self._reported is not None

    def on_angles(self, message: Message, now_s: float) -> None:
        """Takes roll, pitch (down) from the horizon and yaw from east, in radians."""
        roll, pitch, yaw = (number(message["vector"][axis]) for axis in "xyz")
        if self._first_s is None:
            self._first_s = now_s
        is_known = (
            self.is_found or self._is_mounted or (self._is_mounted is None and now_s - self._first_s > ANGLES_SILENCE_S)
        )
        if is_known and all(map(math.isfinite, (roll, pitch, yaw))):
            self._reported = _ReportedAngles(Quaternion.from_euler(roll, pitch, yaw), now_s)
            self._note_others(pitch, yaw, now_s)

    def on_status(self, message: Message, _: float) -> None:
        """Takes its flags."""
        self._is_mounted = bool(message["mount_status"])
        self._problems = tuple(text for flag, text in _PROBLEMS.items() if message.get(flag))

    def tick(self) -> None:
        """Follows the nose, where its angles count from that."""
        if self._from_nose is None:
            return
        with self._lock:
            followed, heading_rad = self._from_nose, self._heading_rad()
            if followed is None or heading_rad is None or self._why_not() is not None:
                return
            if abs(wrap_angle(heading_rad - followed.heading_rad)) > NOSE_TURN_RAD:
                self._from_nose = followed._replace(heading_rad=heading_rad)
                self._send(followed.angles, heading_rad, AIM_S)

    # --- Requests -----------------------------------------------------------------------------------------------------

    @property
    @override
    def info(self) -> GimbalInfo:
        return GimbalInfo(0, _NAME, _ABILITIES, self._why_not() is None)

    @property
    @override
    def mount_position(self) -> Vector3:
        return Vector3()  # the wrapper does not tell it

    @override
    def attitude(self) -> GimbalAttitude | None:
        reported = self._reported
        if reported is None or self._why_not() is not None:
            return None
        return GimbalAttitude(reported.orientation, GimbalReference.EARTH, reported.time_s)

    @override
    def control(self) -> tuple[GimbalControl | None, str]:
        if self._is_turned_aside and self._around.now_s() - self._aside_s < FOREIGN_CONTROL_S:
            return GimbalControl.OTHER, "the dial of the remote controller, or another program,"
        return None, ""

    @override
    def problems(self) -> Sequence[str]:
        return self._problems

    @override
    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        self._begin()
        error = self._turn(angles, reference, TURN_S)
        return futures.done() if error is None else futures.failed(error)

    @override
    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        if not self._is_turned_aside:
            self._turn(angles, reference, AIM_S)

    @override
    def move_to_neutral(self) -> Future[None]:
        error = self._why_not() or self._why_silent()
        if error is not None:
            return futures.failed(error)
        self._begin()
        answer = self._around.call(RESET, {"payload_index": PAYLOAD_PORT, "reset_mode": PITCH_AND_YAW}, CALL_TIMEOUT_S)
        return then(caught(answer, _explained), _accepted)

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        raise NotImplementedError  # the wrapper adds 90 degrees a second to a rate of yaw

    @override
    def retract(self) -> Future[None]:
        raise NotImplementedError  # it has no such ability

    @override
    def take_control(self) -> Future[None]:
        raise NotImplementedError  # it has no such ability

    @override
    def release_control(self) -> Future[None]:
        raise NotImplementedError  # it has no such ability

    def _begin(self) -> None:
        """Ends what was ordered before, and whatever others have done since."""
        with self._lock:
            self._from_nose = self._target = None
            self._is_turned_aside = False

    def _note_others(self, pitch_rad: float, yaw_rad: float, now_s: float) -> None:
        with self._lock:
            if self._target is not None and self._target.is_left(pitch_rad, yaw_rad, now_s):
                self._from_nose = self._target = None
                self._is_turned_aside, self._aside_s = True, now_s

    # --- How it is done -----------------------------------------------------------------------------------------------

    def _turn(self, angles: GimbalAngles, reference: GimbalReference, duration_s: float) -> LinkLostError | None:
        """Sends angles. Returns why they could not be sent."""
        error = self._why_not() or self._why_silent()
        if error is not None:
            return error
        with self._lock:
            if reference is GimbalReference.EARTH:
                self._from_nose = None
                self._send(angles, 0.0, duration_s)
                return None
            heading_rad = self._heading_rad()
            if heading_rad is None:
                return LinkLostError("gimbal 0: where the nose points is not known")
            self._from_nose = _FromNose(angles, heading_rad)
            self._send(angles, heading_rad, duration_s)
        return None

    def _send(self, angles: GimbalAngles, heading_rad: float, duration_s: float) -> None:
        yaw_rad = wrap_angle(angles.yaw_rad + heading_rad)
        is_reached = self._target is not None and self._target.is_reached
        self._target = _SentTarget(angles.pitch_rad, yaw_rad, self._around.now_s(), is_reached=is_reached)
        message = {
            "payload_index": PAYLOAD_PORT,
            "rotation_mode": ABSOLUTE,
            "roll": angles.roll_rad,
            "pitch": angles.pitch_rad,
            "yaw": yaw_rad,
            "time": duration_s,
        }
        self._publish(ROTATION, message)

    def _why_not(self) -> LinkLostError | None:
        trouble = self._around.trouble() or ("it is not mounted" if self._is_mounted is False else "")
        reported = self._reported
        if not trouble and (reported is None or self._around.now_s() - reported.time_s > ANGLES_SILENCE_S):
            trouble = f"it has not told its angles for {ANGLES_SILENCE_S:g} s"
        return LinkLostError(f"gimbal 0 is not heard: {trouble}") if trouble else None

    def _why_silent(self) -> LinkLostError | None:
        silence = self._around.silence()
        return LinkLostError(f"gimbal 0 is not heard: {silence}") if silence else None


def _explained(error: BaseException) -> Future[Message]:
    future: Future[Message] = Future()
    if isinstance(error, ServiceTimeoutError):
        future.set_exception(UalTimeoutError(f"gimbal 0 has not answered: {error}", {"service": error.service}))
    elif isinstance(error, ServiceError):
        future.set_exception(RejectedByAutopilotError(f"gimbal 0 refused: {error}", {"text": error.text}))
    else:
        future.set_exception(error)
    return future


def _accepted(values: Message) -> None:
    if not values.get("success"):
        reason = "DJI's reason is in the log of the wrapper's gimbal node"
        raise RejectedByAutopilotError(f"gimbal 0 refused its neutral angles: {reason}", {"text": reason})
