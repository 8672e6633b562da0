"""Whether the UAV follows: what is flown is compared with what was asked, in hold, tasks and streams.

Each rule needs two signs that agree, or one that lasts, by measured velocities: late data of a busy computer is no
fall.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from ual.errors import WrongStateError
from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, Mode, Sample, Snapshot
from ual_daemon.flight.policy.touch_down import STANDING_SPEED_M_S
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Hold, Reference, Velocity

FALL_M_S = 2.5
"""Excess in m/s over the requested descent that counts as a fall: 0.25 s without lift. A controller overshoots by less
than 1 m/s.
"""
OWN_DESCENT_M_S = 2.0
"""Speed in m/s at which an autopilot may descend by itself (PX4 1.5 m/s, ArduPilot 1.5 m/s), if its limits do not say
more.
"""
CARRIED_SPEED_M_S = 6.0
"""Faster than a disarmed UAV is carried, as in a lift."""
_DEPTH_M = 1.0
"""Metres below the UAV from which a pose requests a descent."""
_DESCENT_BRAKING_M_S2 = 0.7
"""A descent that is asked no more may end so slowly: less than the least acceleration of any autopilot's limits."""
_VELOCITY_PERIOD_S = 0.09
"""Between two looks: a velocity that comes sooner shows no more."""
_DESCENT_SPEED_M_S = 0.5
"""Speed of descent in m/s below which nothing counts as a fall, whatever was asked."""
_SPEED_GAIN_M_S = 0.5
"""A descent that has become faster by so much since the look before may be a fall: each velocity is looked at then."""
_RECENT_VELOCITIES_COUNT = 9
"""Velocities that are kept, `_VELOCITY_PERIOD_S` apart: those of `_OLDEST_S`."""
_FALL_TIME_S = 0.1
"""Seconds that a fall must last: three velocities at 30 Hz."""
GAIN_S, _OLDEST_S = 0.35, 0.75
"""Age in seconds of the newest descent that is compared, and its largest age."""
LEAST_FALL_GAIN_M_S = 2.2
"""Gain of descent in m/s since then that counts as a fall: 6.3 m/s^2 for 0.35 s. No controller brakes so late."""
_ACCELERATION_SHARE = 1.5
"""The same, of what the autopilot may gain by its own acceleration in that time."""
_DROP_SHARE = 0.4
"""The part of a fall by the velocities that must show in the positions: a wrong estimate of the velocity is no fall."""
TILT_RAD = math.radians(70.0)
"""Beyond what an autopilot tilts by itself: PX4 45 deg at most (MPC_TILTMAX_AIR), ArduPilot 30 deg (ANGLE_MAX)."""
_TILT_TIME_S = 0.3
ASTRAY_M = 3.0
"""Distance in metres from its reference at which a UAV does not follow: a reference that leads waits for it within 2
m.
"""
_ASTRAY_SHARE_S = 0.5
"""Seconds by which a fast reference may be farther ahead."""
_ASTRAY_S = 0.5
_MOVES_M_S, _TOWARDS_SHARE = 0.5, 0.5
"""One that stands, or comes back, lags: that is for its task to judge (no way)."""
_LOOK_S, _LOOK_AT_REST_S = 0.2, 0.5
"""Between two comparisons of the place, of a UAV that moves, and of one that does not."""
_LEAST_BRAKING_M_S2 = 1.0
_RETURN_DISTANCE_M = 0.5
"""Once it has come nearer by this it flies to the pose."""
_OFF_M_S, _OFF_SHARE, _OFF_S = 2.0, 0.3, 2.5
"""Error in m/s, error as a share, and seconds after which a velocity that does not come nearer is not followed."""
_SPEED_RECOVERY_M_S = 0.3
NAMED_M, NAMED_M_S, _NAMED_S = 1.0, 1.0, 0.3
"""The same where the autopilot shows another sender's targets: two signs agree then."""
_STILL_M_S, _STILL_S = 0.4, 1.0
"""Speed in m/s below which, and seconds after which, it stands still."""
_LEVEL_M_S, _GROUND_DRIFT_M_S, _LEVEL_S = 0.4, 1.5, 1.5
"""Vertical speed and speed in m/s below which, and seconds after which, a UAV near the ground has fallen onto it. After
an impact PX4's estimate drifts along the ground for 7 s.
"""
DISARMED_TIME_S = 3.0
"""Seconds after the disarming in the air within which it may begin to fall."""
_STOPPED_DROP_M, _STOPPED_S = 1.0, 8.0
"""Drop in metres, or seconds without a disarming, after which the motors are stopped in the air, in a landing
(COM_KILL_DISARM is 5 s).
"""
_LONGEST_VELOCITY_GAP_S = 1.0
"""Seconds without a velocity after which nothing follows from those before."""
_UNSEEN_M, _UNSEEN_S = 1.5, 30.0
"""Metres below its possible descent that prove a fall while the UAV was not observed, and the most seconds of that
time.
"""
_LED_ON_S = 3.0
"""Seconds for which ArduPilot follows the last velocity where no setpoint comes (GUID_TIMEOUT)."""
_IN_AIR = (State.FLYING_AUTO, State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING)
_IMPACT_M_S, _IMPACT_S = 3.0, 0.2
"""Descent in m/s that ends within this time at the ground only: 15 m/s^2, by an estimate that smooths it."""
_SINCE_IMPACT_S = 3.0
"""Seconds after an impact from which it lies, however it tumbles: motors that run on may turn it over and over."""
_GROUND_NOISE_M = 1.2
_UNKNOWN_GROUND_M = 3.0


ENDS_TERMINATION = (
    "secure it, then end what stops the motors (the kill switch), have it disarmed by force, or cut its power"
)
"""The remedy for stopped motors. An autopilot that takes itself to be in the air refuses an ordinary disarming."""
ENDS_LYING = "land it, or have it disarmed by force, and then take off"
"""The remedy for what may lie on the ground. Its autopilot takes it to be in the air, and would lift it off at once."""
_MAY_LIE = f"it may lie on the ground: {ENDS_LYING}"


class Trouble(Enum):
    """Form in which a UAV does not follow; the value is the metadata `by` of errors."""

    FALL = "fall"
    TILT = "tilt"
    STOPPED = "flight termination"
    DISARMED = "disarmed in the air"
    ASTRAY = "does not follow"


class _ReceivedVelocity(NamedTuple):
    """A velocity that came, and where it was then."""

    time_s: float
    z_m: float
    down_m_s: float


class Following:
    """Detection of a UAV that does not follow its references. Only the update thread calls `observe`.

    Once it does not, that holds until somebody requests the control, or until it lies disarmed. A daemon that is new
    finds it by the same data.
    """

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.why = ""
        """Why it does not follow, human-readable; empty while it does. An attribute, because each setpoint looks."""
        self.trouble: Trouble | None = None
        self.is_still = False
        """Whether it stands or lies still."""
        self.lies = False
        """Whether it lies on the ground, whatever the autopilot says: without motors nothing stands in the air."""
        self.may_lie = False
        """Whether it has fallen, and is so near to the ground that it may lie there."""
        self.count = 0
        """Times at which it has ceased to follow."""
        self._is_now = self._is_released = False
        """Whether a rule shows it at present, and whether the next update is to forget the motion from before."""
        self._worst = 0.0
        self.due_s = -math.inf
        """Time of the next check, by the backend's clock. An attribute, because each update looks."""
        self._seen_s = -math.inf
        """Time of the newest velocity, by the autopilot's clock. All that follows is by that clock."""
        self._speed_squared = 0.0
        self._asked_down_m_s, self._asked_s = 0.0, -math.inf
        self._fall: _ReceivedVelocity | None = None
        self._stopped: _ReceivedVelocity | None = None
        """Since when, in a landing, the motors are stopped."""
        self._tilted_s = self._astray_s = self._slow_s = math.inf
        self._still_s: float | None = None
        self._impact_s = math.inf
        """Time of the impact that has ended its fall; infinity while there was none."""
        self._level_s = math.inf
        """Since when it neither sinks nor climbs; infinity while it does."""
        self._looked_s = self._placed_s = -math.inf
        self._hold: Hold | None = None
        self._nearest = self._furthest = self._turn_m = 0.0
        """Least and largest distance from a pose, in metres, and the distance it may fly on until it has turned to
        it.
        """
        self._off: tuple[float, float] = (-math.inf, math.inf)
        """Since when a velocity is off, and by how much it was then."""
        self._armed_s = -math.inf
        """Last time at which it was in the air and armed."""
        self._recent: deque[_ReceivedVelocity] = deque(maxlen=_RECENT_VELOCITIES_COUNT)
        self._before: _ReceivedVelocity | None = None
        """Last observation, where that was in the air."""
        self._boot = 0

    # --- What is known ------------------------------------------------------------------------------------------------

    def with_reason(self, found: Estimate) -> Estimate:
        """Returns the state of a UAV that does not follow, with its reason."""
        state = State.LANDED_ARMED if self.lies and found.state in _IN_AIR else found.state
        return Estimate(state, f"{self.why}{self._now()}; {self._remedy(state)} ({found.why})", found.is_link_up)

    def _now(self) -> str:
        if self.trouble is Trouble.ASTRAY:
            return ""
        return "; it lies or stands still now" if self.is_still or self.lies else ""

    def _remedy(self, state: State) -> str:
        if self.trouble is Trouble.DISARMED:
            return "it is armed again once it lies still"
        if self.trouble is Trouble.STOPPED and self._is_now:
            return f"new motions are refused: {ENDS_TERMINATION}"
        if self.may_lie and state in _IN_AIR:
            return f"new motions are refused: {_MAY_LIE}"
        once = "" if self.is_still else "it stands still or follows, and "
        possible = "land, abort and disarm are possible"
        return f"new motions are refused until {once}recover_from_manual is called ({possible})"

    def refusal(self, command: str, state: State) -> WrongStateError | None:
        """Returns the refusal of a new motion or of an arming; None where it follows."""
        if not self.why:
            return None
        needed = "recover_from_manual" if state is not State.LANDED_DISARMED else "standing still"
        needed = "land" if self.may_lie and state in _IN_AIR else needed
        metadata = {"state": state.name, "needed": needed, "command": command, "by": self._by}
        return WrongStateError(f"{command}: {self.why}; {self._remedy(state)}", metadata)

    @property
    def _by(self) -> str:
        trouble = self.trouble
        return "" if trouble is None else trouble.value

    @property
    def metadata(self) -> dict[str, str]:
        """The metadata of the error of a task that has ended because it does not follow."""
        return {"by": self._by}

    def why_not_recoverable(self, state: State) -> str:
        """Returns why the control cannot be asked back yet; empty where it can."""
        if self._is_now and self.trouble is Trouble.STOPPED:
            return f"the motors are still stopped: {ENDS_TERMINATION}"
        if self.may_lie and state in _IN_AIR:
            return _MAY_LIE
        follows = not self._is_now and self.trouble is not Trouble.ASTRAY  # its present pose is no measure of that
        return "" if self.is_still or follows else "it still moves, or does not follow"

    def note_height(self, height_m: float, *, is_ground_known: bool) -> None:
        """Notes the height over the ground of one that does not follow."""
        has_fallen = self.trouble is not None and self.trouble is not Trouble.ASTRAY
        near_m = _GROUND_NOISE_M if is_ground_known and self._impact_s == math.inf else _UNKNOWN_GROUND_M
        self.may_lie = has_fallen and height_m < near_m

    @property
    def has_hit(self) -> bool:
        """Whether its fall has ended at the ground, where it may still tumble."""
        return self.may_lie and self._impact_s != math.inf

    @property
    def is_down(self) -> bool:
        """Whether it has fallen, and lies on the ground."""
        is_level = self._seen_s - self._level_s >= _LEVEL_S
        is_at_rest = self.is_still or self.lies or is_level or self._seen_s - self._impact_s >= _SINCE_IMPACT_S
        return self.may_lie and is_at_rest

    def release(self) -> None:
        """Begins again: somebody has asked for the control, or it lies disarmed. Any thread may call."""
        self._is_released = True
        self.why, self.trouble, self._is_now, self._worst, self.lies = "", None, False, 0.0, False
        self.may_lie, self._impact_s = False, math.inf

    def forget(self) -> None:
        """Forgets the motion and the place from before: the estimate has jumped."""
        self._before = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Forgets the motion from before a gap."""
        self._recent.clear()
        self._forget_distance()
        self._fall = self._stopped = self._still_s = None
        self._tilted_s = self._slow_s = self._level_s = math.inf
        self._looked_s = self._placed_s = -math.inf

    # --- Updates ------------------------------------------------------------------------------------------------------

    def observe(self, snapshot: Snapshot, raw: Estimate, current: Callable[[], Reference | None] | None) -> None:
        """Takes an update that is due; `current` returns the reference that is flown.

        It is short: in ordinary flight it compares numbers, and requests the reference at few updates.
        """
        self.due_s = snapshot.time_s + _VELOCITY_PERIOD_S
        if self._is_released:
            self._is_released, self.why, self.trouble = False, "", None  # an update may have reported it meanwhile
            self.forget()
        if snapshot.link.boot != self._boot:
            self._begin_boot(snapshot.link.boot)
        motion = snapshot.motion
        velocity, pose = motion.velocity, motion.pose
        if velocity is None or pose is None or raw.state is State.UNINITIALIZED:
            self._note_blind(snapshot)
            return
        now_s = motion.measured_s or velocity.time_s
        passed_s = now_s - self._seen_s
        if passed_s == 0.0:
            return
        self._seen_s = now_s
        if passed_s < 0.0:  # it has booted
            self._asked_s, self._armed_s, self._before = -math.inf, -math.inf, None
        if not 0.0 < passed_s <= _LONGEST_VELOCITY_GAP_S or snapshot.time_s - velocity.time_s > _LONGEST_VELOCITY_GAP_S:
            self._begin_anew()
        x, y, z = velocity.value.linear
        self._speed_squared = x * x + y * y + z * z
        self._note_stillness(z, now_s)
        if self.why:
            self._note_impact(-z, now_s)
        found = self._find(snapshot, raw.state, current) or self._fell_unseen(snapshot, raw.state)
        self._before = _ReceivedVelocity(now_s, pose.value.position.z, -z) if raw.state in _IN_AIR else None
        if found is not None:
            self._note(*found)
            if self.trouble is Trouble.STOPPED and not self.lies:
                self._note_lying(now_s)
        elif self.why:
            self._is_now = self.lies = False
            self._settle(raw.state)

    def _note_stillness(self, climb_m_s: float, now_s: float) -> None:
        """Notes since when it stands still, and since when it neither sinks nor climbs."""
        if self._speed_squared > _STILL_M_S * _STILL_M_S:
            self._still_s, self.is_still = None, False
        elif self._still_s is None:
            self._still_s = now_s
        else:
            self.is_still = now_s - self._still_s >= _STILL_S
        if abs(climb_m_s) > _LEVEL_M_S or self._speed_squared > _GROUND_DRIFT_M_S * _GROUND_DRIFT_M_S:
            self._level_s = math.inf
        elif self._level_s == math.inf:
            self._level_s = now_s

    def _note_impact(self, down_m_s: float, now_s: float) -> None:
        """Notes that a fall has ended at the ground. After that the estimate of the height may be off by a metre."""
        last = self._recent[-1] if self._recent else None
        if last is not None and now_s - last.time_s <= _IMPACT_S and last.down_m_s - down_m_s >= _IMPACT_M_S:
            self._impact_s = now_s

    def _note_blind(self, snapshot: Snapshot) -> None:
        """Notes that it is not known how it moves: once it is known again, it may have fallen meanwhile.

        Where the autopilot had lost its place, it may take itself to be elsewhere then.
        """
        self._begin_anew()
        estimator = snapshot.motion.estimator
        if estimator is not None and not estimator.value.is_good:
            self._before = None

    def _settle(self, state: State) -> None:
        """Tells what was in the past tense, and ends it where it lies disarmed."""
        trouble = self.trouble  # another thread may release it
        if trouble is not None:
            self.why = _PAST[trouble].format(self._worst)
        if state is State.LANDED_DISARMED and self.is_still:
            self.release()

    def _note(self, trouble: Trouble, size: float) -> None:
        if self.trouble is None:
            self.count += 1
        is_worse = self.trouble is None or trouble is not self.trouble
        if is_worse and not (self.trouble in _LEADING and trouble not in _LEADING):
            self.trouble, self._worst, self.lies = trouble, 0.0, False
            self._still_s, self.is_still = None, False  # as it may stand in the air until now
            self._slow_s = self._level_s = math.inf
        self._is_now = True
        if trouble is self.trouble:
            self._worst = max(self._worst, size)
            self.why = _WORDS[trouble].format(size)

    def _note_lying(self, now_s: float) -> None:
        """Notes that it lies, after the motors were stopped. The estimate is bad after an impact."""
        if self._speed_squared > STANDING_SPEED_M_S * STANDING_SPEED_M_S:
            self._slow_s = math.inf
        elif self._slow_s == math.inf:
            self._slow_s = now_s
        else:
            self.lies = now_s - self._slow_s >= _STILL_S

    def _find(
        self, snapshot: Snapshot, state: State, current: Callable[[], Reference | None] | None
    ) -> tuple[Trouble, float] | None:
        """Returns the rule that shows that it does not follow, and by how much; None while none does."""
        motion, control, now_s = snapshot.motion, snapshot.control, self._seen_s
        assert motion.velocity is not None
        assert motion.pose is not None
        down_m_s, z_m = -motion.velocity.value.linear.z, motion.pose.value.position.z
        is_in_air = state in _IN_AIR
        if is_in_air:
            self._armed_s = now_s
        if state is State.LANDED_DISARMED:
            is_new = now_s - self._armed_s <= DISARMED_TIME_S or self.trouble is Trouble.DISARMED
            fall = self._falls(now_s, z_m, down_m_s, FALL_M_S if is_new else CARRIED_SPEED_M_S)
            return (Trouble.DISARMED, down_m_s) if fall else None
        is_stopped = Cause.TERMINATION in (control.failsafe, control.held_by)
        if not is_stopped:
            self._stopped = None
        elif self.trouble is Trouble.STOPPED or (is_in_air and self._is_stopped_in_air(state, now_s, z_m)):
            return Trouble.STOPPED, down_m_s
        if _is_by_hand(state, control.mode):
            self._begin_anew()
            return None  # its pilot may fly freely
        self._keep(snapshot.time_s, _ReceivedVelocity(now_s, z_m, down_m_s))
        if down_m_s <= _DESCENT_SPEED_M_S:
            self._fall = None
        else:
            is_pilots = state is State.FLYING_MANUAL and not _is_autonomous(control.mode)
            asked_m_s = (
                math.inf
                if is_pilots
                else self._commanded_descent_m_s(snapshot, state, None if current is None else current())
            )
            most_m_s = (0.0 if is_stopped else asked_m_s) + FALL_M_S
            if self._falls(now_s, z_m, down_m_s, min(most_m_s, self._may_have_gained(now_s))):
                return (Trouble.STOPPED if is_stopped else Trouble.FALL), down_m_s
        if not is_in_air or now_s - self._looked_s < _LOOK_S:
            return None
        self._looked_s = now_s
        return self._tilted_or_astray(snapshot, state, current)

    def _keep(self, time_s: float, seen: _ReceivedVelocity) -> None:
        """Keeps a velocity, to compare later ones with. One that may be of a fall lets the next look come at once: a
        fall from 1.5 m lasts for half a second.
        """
        last = self._recent[-1] if self._recent else seen
        if self._fall is not None or seen.down_m_s > max(last.down_m_s, 0.0) + _SPEED_GAIN_M_S:
            self.due_s = time_s
        if last is seen or seen.time_s - last.time_s >= _VELOCITY_PERIOD_S:
            self._recent.append(seen)

    def _tilted_or_astray(
        self, snapshot: Snapshot, state: State, current: Callable[[], Reference | None] | None
    ) -> tuple[Trouble, float] | None:
        now_s, pose = self._seen_s, snapshot.motion.pose
        assert pose is not None
        x, y, *_ = pose.value.orientation
        level = 1.0 - 2.0 * (x * x + y * y)
        if level >= _TILT_COSINE:
            self._tilted_s = math.inf
        elif self._tilted_s == math.inf:
            self._tilted_s = now_s
        elif now_s - self._tilted_s >= _TILT_TIME_S:
            return Trouble.TILT, math.degrees(math.acos(max(-1.0, level)))
        if current is None or state is not State.FLYING_AUTO:
            self._forget_distance()
            return None
        moves = self._speed_squared > _MOVES_M_S * _MOVES_M_S
        if not moves:
            self._astray_s = math.inf
            if now_s - self._placed_s < _LOOK_AT_REST_S:
                return None
        self._placed_s = now_s
        reference = current()
        if reference is None:
            self._forget_distance()
            return None
        return self._astray(snapshot, reference)

    def _forget_distance(self) -> None:
        """Forgets how far it is from what is asked: nothing is, or others fly."""
        self._hold, self._off, self._astray_s = None, (-math.inf, math.inf), math.inf

    def _is_stopped_in_air(self, state: State, now_s: float, z_m: float) -> bool:
        """Returns whether motors that are stopped are so in the air: at a touch-down the pilot may stop them before the
        autopilot notices the ground. An autopilot that does not, tells so for ever.
        """
        if state is not State.LANDING:
            return True
        if self._stopped is None:
            self._stopped = _ReceivedVelocity(now_s, z_m, 0.0)
        return self._stopped.z_m - z_m > _STOPPED_DROP_M or now_s - self._stopped.time_s > _STOPPED_S

    def _commanded_descent_m_s(self, snapshot: Snapshot, state: State, reference: Reference | None) -> float:
        """Returns how fast it is to descend at most: what was asked of late ends slowly."""
        own_m_s = max(OWN_DESCENT_M_S, self._backend.info().limits.descent_speed_m_s)
        if state is State.LANDED_ARMED:
            asked_m_s = 0.0
        elif reference is None or state is not State.FLYING_AUTO:
            asked_m_s = own_m_s
        elif isinstance(reference, Hold):
            assert snapshot.motion.pose is not None
            asked_m_s = own_m_s if snapshot.motion.pose.value.position.z - reference.position.z > _DEPTH_M else 0.0
        elif isinstance(reference, Velocity):
            asked_m_s = -reference.velocity(snapshot).z
        else:
            asked_m_s = -reference.motion(snapshot).velocity.z
        left_m_s = self._asked_down_m_s - _DESCENT_BRAKING_M_S2 * (self._seen_s - self._asked_s)
        self._asked_down_m_s, self._asked_s = max(asked_m_s, left_m_s, 0.0), self._seen_s
        return self._asked_down_m_s

    def _may_have_gained(self, now_s: float) -> float:
        """Returns how fast it may descend by its descent shortly before; infinite where that is not known."""
        seen = next((each for each in reversed(self._recent) if now_s - each.time_s >= GAIN_S), None)
        if seen is None or now_s - seen.time_s > _OLDEST_S:
            return math.inf
        own_m_s = _ACCELERATION_SHARE * self._backend.info().limits.vertical_acceleration_m_s2 * (now_s - seen.time_s)
        return max(seen.down_m_s, 0.0) + max(LEAST_FALL_GAIN_M_S, own_m_s)

    def _fell_unseen(self, snapshot: Snapshot, state: State) -> tuple[Trouble, float] | None:
        """Returns that it is lower after a gap than it can have descended in it; None where it need not have fallen."""
        before, now_s = self._before, self._seen_s
        if (
            before is None
            or _is_by_hand(state, snapshot.control.mode)
            or not _LONGEST_VELOCITY_GAP_S < now_s - before.time_s <= _UNSEEN_S
        ):
            return None
        passed_s, mode = now_s - before.time_s, snapshot.control.mode
        assert snapshot.motion.pose is not None
        lost_m = before.z_m - snapshot.motion.pose.value.position.z
        own_m_s = max(OWN_DESCENT_M_S, self._backend.info().limits.descent_speed_m_s, before.down_m_s)
        if state is State.FLYING_AUTO and mode is not None and mode.value.control is Control.REFERENCES:
            # Nobody has led it meanwhile, but where it was led down it may have gone on.
            passed_s = min(passed_s, _LED_ON_S) if before.down_m_s > _STILL_M_S else 0.0
        may_m = own_m_s * passed_s
        return (Trouble.FALL, lost_m / (now_s - before.time_s)) if lost_m > may_m + _UNSEEN_M else None

    def _begin_boot(self, boot: int) -> None:
        """A UAV whose autopilot boots stands: whatever was reported of the boot before is over."""
        if self._boot:
            self.release()
            self._is_released = False
            self.forget()
        self._boot = boot

    def _falls(self, now_s: float, z_m: float, down_m_s: float, most_m_s: float) -> bool:
        """Returns whether it has descended faster than `most_m_s` for long enough, by its velocities and its
        heights.
        """
        if down_m_s <= most_m_s:
            self._fall = None
            return False
        fall = self._fall
        if fall is None or down_m_s < fall.down_m_s:  # one that gets slower brakes
            self._fall = _ReceivedVelocity(now_s, z_m, down_m_s)
            return False
        passed_s = now_s - fall.time_s
        if passed_s < _FALL_TIME_S:
            return False
        return fall.z_m - z_m >= _DROP_SHARE * passed_s * fall.down_m_s

    # --- The place ----------------------------------------------------------------------------------------------------

    def _astray(self, snapshot: Snapshot, reference: Reference) -> tuple[Trouble, float] | None:
        """Compares the place, or the velocity, with the reference."""
        if isinstance(reference, Velocity):
            self._hold, self._astray_s = None, math.inf
            return self._off_velocity(snapshot, reference)
        self._off = (-math.inf, math.inf)
        assert snapshot.motion.pose is not None
        asked = reference.motion(snapshot)
        assert snapshot.motion.velocity is not None
        back, velocity = asked.position - snapshot.motion.pose.value.position, snapshot.motion.velocity.value.linear
        off_m, speed_m_s = back.norm(), velocity.norm()
        is_away = speed_m_s > _MOVES_M_S and velocity.dot(back) < _TOWARDS_SHARE * speed_m_s * off_m
        is_named = bool(snapshot.control.other_sender)
        free_m = (NAMED_M if is_named else ASTRAY_M) + _ASTRAY_SHARE_S * asked.velocity.norm()
        if isinstance(reference, Hold):  # it may be far: how near it has come counts
            free_m += self._nearest_m(snapshot, reference, off_m)
        else:
            self._hold = None
        self._astray_s = min(self._astray_s, self._seen_s) if is_away and off_m > free_m else math.inf
        lasts_s = _NAMED_S if is_named else _ASTRAY_S
        return (Trouble.ASTRAY, off_m) if self._seen_s - self._astray_s >= lasts_s else None

    def _nearest_m(self, snapshot: Snapshot, hold: Hold, off_m: float) -> float:
        """Returns how near it has come to a pose, and at first the way that it needs to turn round."""
        if self._hold is None or (moved_m := (hold.position - self._hold.position).norm()) > ASTRAY_M:
            assert snapshot.motion.velocity is not None
            speed_m_s = snapshot.motion.velocity.value.linear.norm()
            self._nearest, self._furthest = off_m, off_m
            self._turn_m = speed_m_s * speed_m_s / (2.0 * _LEAST_BRAKING_M_S2)
        else:
            self._nearest, self._furthest = min(self._nearest + moved_m, off_m), max(self._furthest, off_m)
            if off_m < self._furthest - _RETURN_DISTANCE_M:
                self._turn_m = 0.0
        self._hold = hold
        return self._nearest + self._turn_m

    def _off_velocity(self, snapshot: Snapshot, reference: Velocity) -> tuple[Trouble, float] | None:
        assert snapshot.motion.velocity is not None
        asked = reference.velocity(snapshot)
        off_m_s = (snapshot.motion.velocity.value.linear - asked).norm()
        since_s, began_m_s = self._off
        is_named = bool(snapshot.control.other_sender)
        if off_m_s <= (NAMED_M_S if is_named else _OFF_M_S) + _OFF_SHARE * asked.norm():
            self._off = (-math.inf, math.inf)
        elif since_s == -math.inf or off_m_s < began_m_s - _SPEED_RECOVERY_M_S or off_m_s > began_m_s + FALL_M_S:
            self._off = (self._seen_s, off_m_s)
        elif self._seen_s - since_s >= (_NAMED_S if is_named else _OFF_S):
            return Trouble.ASTRAY, off_m_s
        return None


def _is_autonomous(mode: Sample[Mode] | None) -> bool:
    return mode is not None and mode.value.is_autonomous


def _is_by_hand(state: State, mode: Sample[Mode] | None) -> bool:
    """Returns whether a pilot flies it in a mode in which nothing bounds its descent."""
    return state is State.FLYING_MANUAL and not (
        mode is not None and (mode.value.is_autonomous or mode.value.keeps_height)
    )


_TILT_COSINE = math.cos(TILT_RAD)
_STOPS = "the autopilot {} stopped its motors in the air (flight termination, or a kill switch)"
_LEADING = (Trouble.STOPPED, Trouble.DISARMED)
"""Troubles that name the cause, and not only its consequence."""
_WORDS = {
    Trouble.FALL: "the UAV does not follow: it falls at {:.0f} m/s",
    Trouble.TILT: "the UAV does not follow: it is tilted by {:.0f} deg",
    Trouble.STOPPED: f"the UAV does not follow: {_STOPS.format('has')}",
    Trouble.DISARMED: "the motors were disarmed in the air, and the UAV falls at {:.0f} m/s",
    Trouble.ASTRAY: "another sender, or the UAV does not follow: it is {:.1f} (m, or m/s) beside what is asked",
}
_PAST = {
    Trouble.FALL: "the UAV did not follow: it fell at {:.0f} m/s",
    Trouble.TILT: "the UAV did not follow: it was tilted by {:.0f} deg",
    Trouble.STOPPED: f"the UAV did not follow: {_STOPS.format('had')}",
    Trouble.DISARMED: "the motors were disarmed in the air, and the UAV fell at {:.0f} m/s",
    Trouble.ASTRAY: "another sender, or the UAV did not follow: it was {:.1f} (m, or m/s) beside what was asked",
}
