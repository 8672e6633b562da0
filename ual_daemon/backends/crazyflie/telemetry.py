"""The newest data of one Crazyflie: from logged values to snapshots. No sockets, no clock of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ual.geometry import Pose, Twist, Vector3
from ual.types import Battery, Health
from ual_daemon.backends.crazyflie.contact import GroundContact
from ual_daemon.backends.crazyflie.ground import KnownGround
from ual_daemon.backends.crazyflie.packets import decompress
from ual_daemon.backends.crazyflie.supervisor import SEVERE_TROUBLES, SupervisorFlags, troubles
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.severe_texts import SEVERE, SevereTexts
from ual_daemon.backends.values import (
    NEVER_S,
    Condition,
    ControlState,
    Estimator,
    LandedState,
    LinkState,
    Mode,
    MotionState,
    Sample,
    SevereText,
    Snapshot,
)

REST_TIME_S = 0.3
"""With its motors off and at rest for this long it stands on the ground: the supervisor says "flying" for 2 s more."""
REST_SPEED_M_S = 0.15
RECENT_CONTACT_S = 0.5
"""While it was received within this time, what is missing of the connection is the reason of the state."""
_WRAP_MS = 1 << 24
_LATE_PACKET_MS = 5000
"""A packet of values that is older than the last one by less than this came late."""
_S_PER_MS = 1e-3
_ASSERTION = "assert failed"
"""Part of a line of its console, in lower case, after which it does not fly on."""
_FLOW = "flow deck"
_DECKS = {
    "deck.bcFlow2": _FLOW,
    "deck.bcFlow": _FLOW,
    "deck.bcLighthouse4": "Lighthouse deck",
    "deck.bcDWM1000": "Loco positioning deck",
    "deck.bcLoco": "Loco positioning deck",
}
POSITIONING_DECKS = tuple(_DECKS)
"""The parameters that say which deck for positioning is there."""
ESTIMATOR = "stabilizer.estimator"
_COMPLEMENTARY_ESTIMATOR_TYPE = 1
_VARIANCES = ("kalman.varPX", "kalman.varPY", "kalman.varPZ")


class BoardTime:
    """The firmware's milliseconds, which begin again after 2^24, as seconds since it booted."""

    def __init__(self) -> None:
        self._last_ms: int | None = None
        self._turns_ms = 0
        self._last_heard_s = 0.0

    def update(self, stamp_ms: int, now_s: float) -> float | None:
        """Returns the time in seconds; None for a packet that came late, or for the second time."""
        last = self._last_ms
        if last is not None:
            step_ms = (stamp_ms - last) % _WRAP_MS
            if step_ms == 0 or step_ms > _WRAP_MS - _LATE_PACKET_MS:
                return None
            if stamp_ms < last:
                self._turns_ms += _WRAP_MS
        self._last_ms, self._last_heard_s = stamp_ms, now_s
        return (self._turns_ms + stamp_ms) * _S_PER_MS

    def fits(self, stamp_ms: int, now_s: float, tolerance_s: float) -> bool:
        """Returns whether a stamp is what the firmware's clock must show now, if it has run on since the last one."""
        if self._last_ms is None:
            return True
        expected_ms = self._last_ms + (now_s - self._last_heard_s) / _S_PER_MS
        error_ms = (stamp_ms - expected_ms + _WRAP_MS / 2) % _WRAP_MS - _WRAP_MS / 2
        return abs(error_ms) <= tolerance_s / _S_PER_MS


class CrazyflieTelemetry:
    """The newest of each value. Not thread-safe: belongs to the thread that receives. Times are the backend's clock."""

    def __init__(self, largest_position_std_m: float) -> None:
        self._largest_std_m = largest_position_std_m
        self.boots_count, self.boots_in_frame_count = 1, 0
        self.heard_s: float | None = None
        self.power_state: int | None = None
        self.parameters: Mapping[str, float] = {}
        """Parameters that were read when it was connected."""
        self._plausibility = Plausibility()
        self._console = _Console()
        self._severe_texts = SevereTexts()
        self._severe: frozenset[str] = frozenset()
        """The newest line and the troubles that were severe at the last snapshot."""
        self._battery: Battery | None = None
        self.rssi_dbm: float | None = None
        self.discard()

    def discard_state(self) -> None:
        """Discards what others may have changed while nothing was read. Where it is and whether it flies grows old."""
        self.info: Sample[SupervisorFlags] | None = None
        self._estimator: Sample[Estimator] | None = None

    def discard(self) -> None:
        """Discards all of the boot before."""
        self.discard_state()
        self.pose: Sample[Pose] | None = None
        self.velocity: Sample[Twist] | None = None
        self._rates = Vector3()
        self._landed: Sample[LandedState] = Sample(LandedState.UNKNOWN, NEVER_S)
        self._moved_s = -math.inf
        self._measured_s = self._stamp_s = 0.0
        self.ground = KnownGround()
        self.contact = GroundContact()

    def on_motion(self, values: Mapping[str, float], measured_s: float, now_s: float, utc_s: float) -> None:
        """Takes the values of the block `MOTION`."""
        position = Vector3(values["stateEstimate.x"], values["stateEstimate.y"], values["stateEstimate.z"])
        linear = Vector3(*(values[f"stateEstimateZ.v{axis}"] * _S_PER_MS for axis in "xyz"))
        pose = Pose(position, decompress(int(values["stateEstimateZ.quat"])))
        velocity = Twist(linear, self._rates)
        if not self._plausibility.accepts_motion(pose, velocity):
            return
        self.info = Sample(SupervisorFlags(int(values["supervisor.info"])), now_s)
        self.pose = Sample(pose, now_s)
        self.velocity = Sample(velocity, now_s)
        self._measured_s, self._stamp_s = measured_s, utc_s
        self._judge_landed(values.get("stabilizer.thrust"), linear, now_s)

    def _judge_landed(self, thrust: float | None, velocity: Vector3, now_s: float) -> None:
        """Judges by several signals: the supervisor says "flying" for 2 s after the motors have stopped."""
        assert self.info is not None
        assert self.pose is not None
        is_flying = bool(self.info.value & SupervisorFlags.FLYING)
        if thrust is not None:
            self.contact.update(thrust, velocity, now_s)
        if velocity.norm() > REST_SPEED_M_S or (thrust is not None and thrust > 0):
            self._moved_s = now_s
        rests = now_s - self._moved_s >= REST_TIME_S
        landed = self._landed_by(thrust, rests=rests, is_flying=is_flying)
        if landed is LandedState.ON_GROUND and rests:
            self.ground = KnownGround.standing_at(self.pose.value.position)
        self._landed = Sample(landed, NEVER_S if landed is LandedState.UNKNOWN else now_s)

    def _landed_by(self, thrust: float | None, *, rests: bool, is_flying: bool) -> LandedState:
        """Returns whether it stands. `is_flying` is what the supervisor says.

        Motion without thrust shows neither ground nor flight, so the last state stays. What stood is lifted by a hand:
        taken for a flight, UAL would start the motors. What flew falls, or its controller cuts the thrust for a moment:
        taken for the ground, its height would be that of the ground. Where neither was seen, it stays unknown, until
        thrust is seen, or the supervisor says that it does not fly (after 2 s).
        """
        if thrust is None:
            return LandedState.IN_AIR if is_flying else LandedState.ON_GROUND
        if thrust > 0:
            return LandedState.IN_AIR
        return LandedState.ON_GROUND if rests or not is_flying else self._landed.value

    def on_jump(self, offset: Vector3) -> None:
        """Takes note that the estimate has jumped (in metres along the local axes), or is about to."""
        self.ground = self.ground.jumped(offset)

    def on_status(self, values: Mapping[str, float], now_s: float) -> None:
        """Takes the values of the block `STATUS`, as far as the firmware has them."""
        rates = [values.get(f"stateEstimateZ.rate{axis}", 0.0) * _S_PER_MS for axis in ("Roll", "Pitch", "Yaw")]
        self._rates = Vector3(rates[0], -rates[1], rates[2])  # this pitch rate is positive upwards
        self._estimator = Sample(self._judge_estimator(values), now_s)
        if "pm.state" in values:
            self.power_state = int(values["pm.state"])
        if "pm.vbat" in values:
            self._battery = Battery(values.get("pm.batteryLevel"), values["pm.vbat"])
        if "radio.rssi" in values:
            self.rssi_dbm = -values["radio.rssi"]

    def _judge_estimator(self, values: Mapping[str, float]) -> Estimator:
        decks = [text for name, text in _DECKS.items() if self.parameters.get(name)]
        if self.parameters.get(ESTIMATOR) == _COMPLEMENTARY_ESTIMATOR_TYPE:
            return Estimator(False, f"its estimator knows no position: set {ESTIMATOR}=2 (Kalman)")
        variances = [values[name] for name in _VARIANCES if name in values]
        if not all(map(math.isfinite, variances)):
            return Estimator(False, "its estimator has diverged: the variance of its position is not finite")
        std_m = math.sqrt(max(0.0, *variances)) if len(variances) == len(_VARIANCES) else None
        if std_m is not None and std_m <= self._largest_std_m:
            return Estimator(True)
        if not decks:
            return Estimator(False, "no positioning: needs a flow deck, Lighthouse or poses from outside")
        if std_m is None:
            return Estimator(True)  # it does not say how sure it is
        return Estimator(False, f"its position with the {decks[0]} is not sure (standard deviation {std_m:.2f} m)")

    def on_console(self, data: bytes) -> None:
        """Takes a piece of the firmware's console."""
        self._console.update(data)

    @property
    def begins_anew(self) -> bool:
        """Whether its local frame may begin again when it boots: with a flow deck, which knows no place.

        Another deck beside it does not show that there is a position from outside: its base stations may be off.
        """
        return any(text == _FLOW and self.parameters.get(name) for name, text in _DECKS.items())

    @property
    def is_on_ground(self) -> bool:
        """Whether it stands on the ground."""
        return self._landed.value is LandedState.ON_GROUND

    @property
    def supervisor(self) -> SupervisorFlags:
        """The newest state of the supervisor; empty if it is not known."""
        return SupervisorFlags(0) if self.info is None else self.info.value

    @property
    def text(self) -> str:
        """Report of its state: causes that keep it from flying, or else the last line of its console."""
        return "; ".join(troubles(self.supervisor, self.power_state)) or self._console.line

    def snapshot(self, now_s: float, mode: Mode, connecting: str) -> Snapshot:
        """Returns all values as of now. `connecting` says, human-readable, what is missing of the connection."""
        info = self.info
        found = troubles(self.supervisor, self.power_state)
        is_in_contact = self.heard_s is not None and now_s - self.heard_s <= RECENT_CONTACT_S
        return Snapshot(
            time_s=now_s,
            heard_s=self.heard_s,
            control=ControlState(
                armed=None if info is None else Sample(bool(info.value & SupervisorFlags.ARMED), info.time_s),
                landed=self._landed,
                mode=None if info is None else Sample(mode, info.time_s),
            ),
            motion=MotionState(
                stamp_s=self._stamp_s,
                measured_s=self._measured_s,
                estimator=self._estimator,
                pose=self.pose,
                velocity=self.velocity,
            ),
            condition=Condition(
                battery=self._battery,
                status_text=connecting or self.text,
                health=None if info is None else self._health(info.value, found),
                severe_texts=self._fresh_severe_texts(now_s, found),
            ),
            link=LinkState(
                boots_count=self.boots_count,
                boots_in_frame_count=self.boots_in_frame_count,
                conflict=connecting if is_in_contact else "",
            ),
        )

    def _fresh_severe_texts(self, now_s: float, found: tuple[str, ...]) -> tuple[SevereText, ...]:
        """Returns what is severe and new: that it has tumbled or crashed, and failed assertions of its firmware."""
        line = self._console.line
        severe = frozenset((*SEVERE_TROUBLES.intersection(found), *((line,) if _ASSERTION in line.lower() else ())))
        for text in sorted(severe - self._severe):
            self._severe_texts.on_text(text, SEVERE, now_s)
        self._severe = severe
        return self._severe_texts.fresh(now_s)

    def _health(self, info: SupervisorFlags, found: tuple[str, ...]) -> Health:
        is_ready = bool(info & (SupervisorFlags.CAN_ARM | SupervisorFlags.ARMED)) and not found
        return Health(is_ready, found)


class _Console:
    """The last whole line of the firmware's console, which comes in pieces."""

    def __init__(self) -> None:
        self.line = ""
        self._part = ""

    def update(self, data: bytes) -> None:
        *lines, self._part = (self._part + data.decode("utf-8", "replace")).split("\n")
        self._part = self._part[-200:]
        self.line = next((each.strip("\0 ") for each in reversed(lines) if each.strip("\0 ")), self.line)
