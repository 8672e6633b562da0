"""Gimbal of the autopilot, as MAVROS publishes it. Belongs to the link's thread, but for what says otherwise.

``mount_control/orientation`` has no time, and ``gimbal_control/device/attitude_status`` that of the autopilot. So what
came is as old as its arrival.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.gimbal_protocol import GimbalIdentity, attitude_of, failures_of
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.offers.gimbals import GimbalAttitude
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.fields import number

ATTITUDE_AGE_LIMIT_S = 1.0
"""Seconds after which a gimbal's attitude counts as unknown."""
_AXES = "wxyz"


class GimbalTopics:
    """Last messages of a gimbal, and its parameters. Values are for any thread."""

    def __init__(self, autopilot: Autopilot, parameters: Mapping[str, float]) -> None:
        self._codec = autopilot.gimbal
        self._parameters = parameters
        self._attitude: GimbalAttitude | None = None
        self._problems: tuple[str, ...] = ()
        self._reported_s = -math.inf

    @property
    def handlers(self) -> dict[str, Callable[[Message, float], None]]:
        """Handler of each topic's messages."""
        return {topics.MOUNT: self._on_mount, topics.GIMBAL: self._on_device}

    def discard(self) -> None:
        """Forgets the reports: it has booted."""
        self._attitude, self._problems = None, ()

    @property
    def identity(self) -> GimbalIdentity | None:
        """Identity of the gimbal; None where there is none."""
        return None if self._codec is None else self._codec.identity(self._parameters)

    @property
    def wanted(self) -> tuple[str, ...]:
        """The names of the parameters that say what it is."""
        return () if self._codec is None else self._codec.parameters(self._parameters)

    def attitude(self, now_s: float) -> GimbalAttitude | None:
        """Returns where it looks, if that was reported lately."""
        attitude = self._attitude
        return attitude if attitude is not None and now_s - attitude.time_s <= ATTITUDE_AGE_LIMIT_S else None

    def problems(self, now_s: float) -> Sequence[str]:
        """Returns its recent reports of what fails."""
        return self._problems if now_s - self._reported_s <= ATTITUDE_AGE_LIMIT_S else ()

    def _on_mount(self, message: Message, now_s: float) -> None:
        if self._codec is not None and self._codec.tells_mount(self._parameters):
            self._turn(0, message, now_s)

    def _on_device(self, message: Message, now_s: float) -> None:
        if self._codec is not None and self._codec.tells_attitude(self._parameters):
            self._problems, self._reported_s = failures_of(int(message["failure_flags"])), now_s
            self._turn(int(message["flags"]), message["q"], now_s)

    def _turn(self, flags: int, q: Message, now_s: float) -> None:
        assert self._codec is not None
        found = attitude_of(flags, [number(q[axis]) for axis in _AXES], self._codec.meant(self._parameters))
        self._attitude = None if found is None else GimbalAttitude(*found, now_s)
