"""The gimbal of the autopilot through MAVROS: orders by its service cmd/command, what follows by cmd/command_int.

MAVROS waits for the autopilot's acknowledgement of the one, and does not wait for that of the other. So nothing is held
up while a gimbal follows something, and an acknowledgement that is lost then delays no command.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace

from typing_extensions import override

from ual.errors import NotSupportedError, UalError
from ual.geometry import Vector3
from ual.gimbals import GimbalAngles, GimbalControl, GimbalInfo, GimbalReference
from ual_daemon.backends import futures
from ual_daemon.backends.engine.command import Command
from ual_daemon.backends.firmwares.gimbal_codec import GimbalCodec
from ual_daemon.backends.firmwares.gimbal_protocol import GimbalIdentity
from ual_daemon.backends.firmwares.gripper_codec import PayloadOrder
from ual_daemon.backends.mavros import commands, topics
from ual_daemon.backends.mavros.commands import MavrosCall
from ual_daemon.backends.mavros.offers.services import MavrosAccess
from ual_daemon.backends.mavros.session import MavrosSession
from ual_daemon.backends.offers.gimbals import FindableGimbal, GimbalAttitude
from ual_daemon.backends.rosbridge import Message

AIM_S = 0.1
"""Seconds between two aims of a gimbal that follows something."""
AIM_LIMIT_S = 2.0
"""Seconds that MAVROS may take to pass an aim on."""
LATE_ANSWER_S = 0.3
"""Seconds for which an order waits after that: the acknowledgement of the one would be taken for that of the other."""
_UNTOLD = "MAVROS does not tell where it looks"
_NOTHING = GimbalIdentity(frozenset(), None, None, None)


class MavrosGimbal(FindableGimbal):
    """The first gimbal of the autopilot. From any thread.

    Args:
        reach: The way to MAVROS.
        command: Passes a command to the autopilot, with a human-readable name.
        now_s: The backend's clock.

    """

    def __init__(
        self,
        access: MavrosAccess,
        command: Callable[[str, Command[MavrosCall]], Future[None]],
        now_s: Callable[[], float],
    ) -> None:
        self._access = access
        self._command = command
        self._now_s = now_s
        self._lock = threading.Lock()
        self._aim: Future[Message] | None = None
        self._aimed_s = -math.inf
        self._trouble = ""
        self._identity = _NOTHING

    @property
    @override
    def is_found(self) -> bool:
        """Whether the autopilot has one, as far as it is known."""
        self._learn()
        return self._identity is not _NOTHING

    @property
    @override
    def info(self) -> GimbalInfo:
        is_known = self._learn()
        identity = self._identity
        untold = "" if self.attitude() is not None else _UNTOLD
        return GimbalInfo(
            0,
            "gimbal of the autopilot",
            identity.abilities,
            is_known and isinstance(self._access.session_in_reach("turn its gimbal"), MavrosSession),
            "",
            identity.roll,
            identity.pitch,
            identity.yaw,
            "; ".join(filter(None, (identity.note, untold))),
        )

    def _learn(self) -> bool:
        """Returns whether the autopilot that is known now has one. What it was stays known."""
        session = self._access.session()
        identity = None if session is None else session.telemetry.gimbal.identity
        if identity is not None:
            self._identity = identity
        return identity is not None

    @property
    @override
    def mount_position(self) -> Vector3:
        return Vector3()  # nothing tells it

    @override
    def attitude(self) -> GimbalAttitude | None:
        session = self._access.session()
        return None if session is None else session.telemetry.gimbal.attitude(self._now_s())

    @override
    def control(self) -> tuple[GimbalControl | None, str]:
        return None, ""  # the commands that are sent need none

    @override
    def problems(self) -> Sequence[str]:
        session = self._access.session()
        failures = () if session is None else session.telemetry.gimbal.problems(self._now_s())
        return [*failures, *([self._trouble] if self._trouble else [])]

    @override
    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        return self._order(lambda codec: codec.turning(angles, reference))

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        return self._order(lambda codec: codec.turning_at(pitch_rad_s, yaw_rad_s))

    @override
    def move_to_neutral(self) -> Future[None]:
        return self._order(lambda codec: codec.resting(is_retracted=False))

    @override
    def retract(self) -> Future[None]:
        return self._order(lambda codec: codec.resting(is_retracted=True))

    @override
    def take_control(self) -> Future[None]:
        raise NotImplementedError  # it has no such ability

    @override
    def release_control(self) -> Future[None]:
        raise NotImplementedError  # it has no such ability

    def _order(self, make: Callable[[GimbalCodec], PayloadOrder]) -> Future[None]:
        try:
            order = make(self._codec())
        except UalError as error:
            return futures.failed(error)
        command = replace(commands.move(order), waits=lambda _: self._why_wait())
        self._trouble = ""
        return self._command(order.what, command)

    def _codec(self) -> GimbalCodec:
        session = self._access.session_in_reach("turn its gimbal")
        if isinstance(session, UalError):
            raise session
        if session.autopilot.gimbal is None:
            raise NotSupportedError(f"UAL turns no gimbal of {session.autopilot.name}")
        return session.autopilot.gimbal

    def _why_wait(self) -> str:
        return "it was just aimed" if self._now_s() - self._aimed_s < LATE_ANSWER_S else ""

    # --- What follows something ---------------------------------------------------------------------------------------

    @override
    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        """Has MAVROS send it, unless it was just aimed, or MAVROS has not passed on the last time yet."""
        with self._lock:
            is_passed_on = self._aim is None or self._aim.done()
            if not is_passed_on or self._now_s() - self._aimed_s < AIM_S:
                return
            try:
                order = self._codec().turning(angles, reference)
            except UalError:
                return  # nothing answers to what follows: the state tells it
            self._aimed_s = self._now_s()
            self._aim = self._access.call(topics.COMMAND_INT, commands.as_int(order), AIM_LIMIT_S)
        self._aim.add_done_callback(self._on_aimed)

    def _on_aimed(self, aimed: Future[Message]) -> None:
        error = None if aimed.cancelled() else aimed.exception()
        self._trouble = "" if error is None else f"it does not follow: {error}"
