"""Session of the backend on its thread: takes messages of the autopilot, and sends messages that are due."""

from __future__ import annotations

import math
import time
from collections.abc import Hashable

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual_daemon.backends.base import Clock
from ual_daemon.backends.engine.command import Verdict
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.values import (
    Control,
    ControlState,
    Estimator,
    LandedState,
    LinkState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_hover.autopilot import Answer, Autopilot, Packet, Triple

CONTROLS = {"follow": Control.REFERENCES, "land": Control.LAND}
"""Controller of each mode. In the others: its own."""


class Session:
    """Belongs to the loop's thread. `watch` may be asked by any thread."""

    def __init__(self, autopilot: Autopilot, clock: Clock, lost_s: float) -> None:
        self.watch = LinkWatch("hover", lost_s, on_lost=self._discard_state)
        self.runner: CommandRunner[str] = CommandRunner(
            "hover", self._transmit, self._now, self.watch, setpoints_s=lambda _: math.inf
        )
        self._autopilot = autopilot
        self._epoch_s = time.time() - clock.now_s()
        self._plausibility = Plausibility()
        self._readings = Readings()
        self._packet: Reading[Packet] = self._readings.add(Valid.WHILE_HEARD)
        self._boots_count = 0

    # --- What the loop calls: see `Driven` ----------------------------------------------------------------------------

    @property
    def is_urgent(self) -> bool:
        return self.runner.is_any_under_way

    def discard(self, now_s: float, pause_s: float) -> None:
        self._discard_state()
        while self._autopilot.receive(0.0) is not None:
            pass

    def tick(self, now_s: float) -> None:
        self.watch.tick(now_s)
        self.runner.tick(now_s)

    def on_defect(self, error: Exception, now_s: float) -> None:
        """Begins anew. The library of a real autopilot would be connected anew here."""
        self._discard_state()

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        return self._now(now_s)._replace(updated_s=updated_s, scheduling_gap=scheduling_gap)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_message(self, message: Packet | Answer, now_s: float) -> None:
        """Takes what the autopilot has sent."""
        self.watch.on_heard(now_s)
        if isinstance(message, Answer):
            verdict = Verdict.ACCEPTED if message.text == "ok" else Verdict.REFUSED
            self.runner.on_answer(message.command, verdict, now_s, message.text)
            return
        self._readings.order = message.time_s
        if self.watch.on_boot_time(message.time_s, now_s):
            self._boots_count += 1
            self._readings.discard_boot()
            self.runner.drop(now_s)
        if not self.watch.is_boot_doubtful and self._plausibility.accepts_motion(_pose(message), _twist(message)):
            self._packet.on_value(message, now_s)
            self.runner.on_state(now_s)

    def _discard_state(self) -> None:
        self._readings.discard_state()

    def _transmit(self, name: str, sent_before_count: int, key: Hashable) -> None:
        self._autopilot.command(name)

    def _now(self, now_s: float) -> Snapshot:
        newest = self._packet.sample
        if newest is None:
            return Snapshot(now_s, self.watch.heard_s, link=LinkState(boots_count=self._boots_count))
        packet, received_s = newest.value, newest.time_s
        return Snapshot(
            time_s=now_s,
            heard_s=self.watch.heard_s,
            control=ControlState(
                armed=Sample(packet.is_armed, received_s),
                landed=Sample(LandedState.ON_GROUND if packet.is_on_ground else LandedState.IN_AIR, received_s),
                mode=Sample(Mode(packet.mode, CONTROLS.get(packet.mode, Control.OTHER)), received_s),
            ),
            motion=MotionState(
                stamp_s=self._epoch_s + received_s,
                measured_s=packet.time_s,
                estimator=Sample(Estimator(True), received_s),
                pose=Sample(_pose(packet), received_s),
                velocity=Sample(_twist(packet), received_s),
            ),
            link=LinkState(boots_count=self._boots_count),
        )


def _pose(packet: Packet) -> Pose:
    return Pose(ned_to_enu(packet.position), Quaternion.from_yaw(math.radians(90.0 - packet.heading_deg)))


def _twist(packet: Packet) -> Twist:
    return Twist(ned_to_enu(packet.velocity), Vector3(0.0, 0.0, -math.radians(packet.yaw_rate_deg_s)))


def ned_to_enu(triple: Triple) -> Vector3:
    """Converts north, east, down to east, north, up."""
    return Vector3(triple[1], triple[0], -triple[2])
