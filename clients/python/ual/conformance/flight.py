"""The tools of the checks: wait in the vehicle's time, bring the vehicle to a state, and judge what it did.

Positions are in ``<ns>/odom``, as in the odometry. Flights stay within a few metres of where the UAV took off
(`Flight.place`), at most `CEILING_M` above it.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from ual.errors import NotSupportedError, RejectedByAutopilotError, UalError, WrongStateError
from ual.geometry import Pose, Twist, Vector3, wrap_angle
from ual.interface import Task, Uav
from ual.shared.renamed import renamed, renamed_property
from ual.simulation import SimulationPart
from ual.types import State, TaskStatus, Telemetry

E = TypeVar("E", bound=UalError)

HEIGHT_M = 2.0
CEILING_M = 5.0
_NO_SAMPLE_S = 30.0
_OPERATOR_S = 120.0
_DISARM_S = 4.0
# Autopilots disarm by themselves when they are armed and idle; PX4 and ArduPilot after 10 s.
_FRESHLY_ARMED_S = 5.0
_HOLD_CHECK_S = 2.0
_FLYING = (State.FLYING_AUTO, State.FLYING_MANUAL)


class CheckFailedError(AssertionError):
    """The UAV did not do what it must."""


class RunEndedError(CheckFailedError):
    """The UAV must not be flown any more."""


class CannotRunError(Exception):
    """A check cannot run here; the message says why."""


class StaysArmedError(CannotRunError):
    """The autopilot refuses to be disarmed on the ground, as a Crazyflie that arms itself does."""


def require(condition: bool, otherwise: str) -> None:
    """Fails the check unless the condition holds."""
    if not condition:
        raise CheckFailedError(otherwise)


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of a UAV's accuracy. The defaults are for a real UAV outdoors, whose estimate wanders by up to a metre
    and by 0.8 m/s while it hovers (PX4 in its simulator: docs/reference/backends/mavlink.md). `of_simulation` is for
    the light simulation.

    `wander_m` is how far the estimate may drift within some seconds in which nothing corrects it; it is added when a
    path is assessed. Ratios are relative to the length of a leg. `patience` is how many times longer than expected
    something may take.
    """

    position_m: float = 1.2
    wander_m: float = 0.8
    heading_rad: float = 0.2
    speed_m_s: float = 0.8
    line_ratio: float = 0.15
    overshoot_ratio: float = 0.1
    patience: float = 3.0

    @property
    def drift_m(self) -> float:
        """Distance in metres from a path, or beyond it, at which the UAV may end if nothing held its position
        meanwhile.
        """
        return self.position_m + self.wander_m

    way_m = renamed_property(drift_m, "Tolerances.way_m")

    @classmethod
    def of_simulation(cls) -> Tolerances:
        """Returns the tolerances for a simulated UAV without noise and wind."""
        return cls(position_m=0.3, wander_m=0.0, heading_rad=0.12, speed_m_s=0.3, line_ratio=0.02, overshoot_ratio=0.02)


@dataclass
class Observer:
    """Keeps all samples that a UAV sends while it is open, in order."""

    uav: Uav
    samples: list[Telemetry] = field(default_factory=list)
    longest_silence_s: float = 0.0
    """The longest time for which no sample came, by this computer's clock or by their stamps."""
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _came_s: float | None = None

    @contextmanager
    def open(self) -> Iterator[Observer]:
        """Subscribes for as long as the block runs."""
        with self.uav.subscribe(self._on_telemetry):
            yield self

    def caught_up(self) -> list[Telemetry]:
        """Returns all samples up to now. Waits for those that are still on their way to a busy computer."""
        now_s = self.uav.telemetry().stamp_s
        with self._changed:
            self._changed.wait_for(lambda: bool(self.samples) and self.samples[-1].stamp_s >= now_s, _NO_SAMPLE_S)
            return list(self.samples)

    def following(self, first: int) -> Iterator[Telemetry]:
        """Yields the samples from number `first` on, as they come."""
        for number in range(first, first + 10**9):
            with self._changed:
                there = self._changed.wait_for(lambda n=number: len(self.samples) > n, _NO_SAMPLE_S)  # type: ignore[misc]
            require(there, f"no telemetry came for {_NO_SAMPLE_S:g} s")
            yield self.samples[number]

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        now_s = time.monotonic()
        with self._changed:
            if self._came_s is not None:
                missed_s = telemetry.stamp_s - self.samples[-1].stamp_s
                self.longest_silence_s = max(self.longest_silence_s, now_s - self._came_s, missed_s)
            self._came_s = now_s
            self.samples.append(telemetry)
            self._changed.notify_all()


class Flight:
    """One UAV under test. Made once for each run; `observing` wraps each check."""

    def __init__(
        self,
        uav: Uav,
        tolerances: Tolerances | None = None,
        ask_operator: Callable[[str], None] | None = None,
    ) -> None:
        self.uav = uav
        self.info = uav.info()
        self.has_pilot = _offers(uav, SimulationPart.PILOT)
        # A simulation that offers noise has none unless it is requested, as the light one.
        is_exact = _offers(uav, SimulationPart.NOISE)
        self.tolerances = tolerances or (Tolerances.of_simulation() if is_exact else Tolerances())
        self._ask_operator = ask_operator
        self.longest_silence_s = 0.0
        """The longest time for which nothing was seen of the UAV in the last check, or a command was on its way."""
        self._observer: Observer | None = None
        self._ground = Vector3()
        self._yaw_rad = 0.0
        self._armed_s = -math.inf

    @contextmanager
    def observing(self) -> Iterator[None]:
        """Keeps all samples while the block runs."""
        with Observer(self.uav).open() as observer:
            self._observer = observer
            try:
                yield
            finally:
                self.longest_silence_s = observer.longest_silence_s
                self._observer = None

    # What the UAV does

    def wait(self, condition: Callable[[Telemetry], bool], what: str, limit_s: float = 30.0) -> Telemetry:
        """Returns the first sample from now on that fulfils a condition. Fails the check after `limit_s` of the
        vehicle's time, times `Tolerances.patience`.
        """
        assert self._observer is not None
        limit_s *= self.tolerances.patience
        start_s: float | None = None
        for sample in self._observer.following(max(0, len(self._observer.samples) - 1)):
            if condition(sample):
                return sample
            start_s = sample.stamp_s if start_s is None else start_s
            if sample.stamp_s - start_s > limit_s:
                raise CheckFailedError(f"{what}: not within {limit_s:.0f} s; {describe(sample)}")
        raise AssertionError("samples never end")

    def wait_until_rests_at(self, where: Vector3, what: str) -> None:
        """Blocks until it has been slow and at a position for 1 s of the vehicle's time."""
        since_s: float | None = None

        def rests(sample: Telemetry) -> bool:
            nonlocal since_s
            if (position(sample) - where).norm() > self.tolerances.position_m or not self.is_slow(sample):
                since_s = None
                return False
            since_s = sample.stamp_s if since_s is None else since_s
            return sample.stamp_s - since_s >= 1.0

        self.wait(rests, what)

    def wait_for_state(self, *states: State, limit_s: float = 30.0) -> Telemetry:
        """Returns the first sample from now on in one of the states."""
        names = " or ".join(state.name for state in states)
        return self.wait(lambda sample: sample.state in states, f"state {names}", limit_s)

    def let_pass(self, duration_s: float) -> list[Telemetry]:
        """Returns the samples of the next `duration_s` of the vehicle's time."""
        now_s = self.now_s()
        with self.recording() as samples:
            self.wait(lambda sample: sample.stamp_s >= now_s + duration_s, "time passing", duration_s + 10.0)
        return samples()

    def now_s(self) -> float:
        """Returns the vehicle's time."""
        return self.uav.telemetry().stamp_s

    @contextmanager
    def recording(self) -> Iterator[Callable[[], list[Telemetry]]]:
        """Provides a function that returns the samples since the block began, up to now."""
        assert self._observer is not None
        observer = self._observer
        first = len(observer.caught_up())  # what is still on its way tells of the motion before
        yield lambda: observer.caught_up()[first:]

    def position(self) -> Vector3:
        """Returns where it is."""
        return position(self.uav.telemetry())

    def is_slow(self, sample: Telemetry) -> bool:
        """Returns whether it moves slower than `Tolerances.speed_m_s`."""
        return speed(sample) < self.tolerances.speed_m_s

    def give_at_once(self, command: Callable[[], object], seen: Telemetry) -> None:
        """Gives a command that is worth nothing later than what was seen. The vehicle's time from then on, until it was
        accepted, counts as silence.
        """
        assert self._observer is not None
        command()
        self._observer.longest_silence_s = max(self._observer.longest_silence_s, self.now_s() - seen.stamp_s)

    # Bringing it to where a check starts

    @property
    def ground(self) -> Vector3:
        """The ground where it took off."""
        return self._ground

    place = renamed_property(ground, "Flight.place")

    @property
    def start(self) -> Pose:
        """Start of checks in the air: above the point of its take-off."""
        return self.goal(0.0, 0.0)

    def goal(self, dx: float, dy: float, dz: float = 0.0, turn_rad: float = 0.0) -> Pose:
        """Returns a pose relative to `start`, in ``<ns>/odom``."""
        p = self._ground
        return Pose.at(p.x + dx, p.y + dy, p.z + HEIGHT_M + dz, self._yaw_rad + turn_rad)

    def bring_to(self, states: Sequence[State]) -> None:
        """Brings the UAV to the first of these states if it is in none of them. In the air, also flies to `start`."""
        if not states:
            return
        try:
            state = self.wait(lambda sample: sample.state is not State.UNINITIALIZED, "ready").state
        except CheckFailedError as error:
            raise RunEndedError(str(error)) from error
        if state in (State.TAKING_OFF, State.LANDING):
            state = self.wait_for_state(*READY_STATES, limit_s=60.0).state
        if state not in states or state is states[0] is State.LANDED_ARMED:
            steps = {
                State.LANDED_DISARMED: self._be_disarmed,
                State.LANDED_ARMED: self._be_armed,
                State.FLYING_AUTO: self._be_flying,
            }
            steps[states[0]]()
        if self.uav.state() is State.FLYING_AUTO:
            self.return_to_start()

    def return_to_start(self) -> None:
        """Flies to `start` and waits until it rests there."""
        self.uav.go_to_waypoint(self.start)
        self.wait_until_rests_at(self.start.position, "rest at the start")

    def land(self) -> None:
        """Lands, from any state in the air."""
        if self.uav.state() in _FLYING:
            self._take_control()
            self.uav.land()
        self.wait_for_state(State.LANDED_ARMED, State.LANDED_DISARMED, limit_s=60.0)

    def _come_down(self) -> None:
        """Lands, and waits a little: if the autopilot disarms by itself after a landing, it must not do so in the next
        check.
        """
        has_flown = self.uav.state() in _FLYING
        self.land()
        if has_flown:
            until_s = self.now_s() + _DISARM_S
            self.wait(lambda sample: sample.state is State.LANDED_DISARMED or sample.stamp_s > until_s, "time passing")

    def _take_control(self) -> None:
        if self.uav.state() is not State.FLYING_MANUAL:
            return
        if not self.has_pilot:
            raise RunEndedError("the safety pilot or another mode of the autopilot controls the UAV: the checks end")
        self.uav.recover_from_manual()

    def _be_disarmed(self) -> None:
        self._come_down()
        if self.uav.state() is State.LANDED_ARMED:
            if self.has_pilot:
                self.uav.simulation.pilot_disarm()
            elif self.info.is_arming_allowed:
                self._disarm()
            else:
                self._ask("disarm the UAV")
        self.wait_for_state(State.LANDED_DISARMED, limit_s=_OPERATOR_S)

    def _disarm(self) -> None:
        try:
            self.uav.disarm()
        except RejectedByAutopilotError as error:
            raise StaysArmedError(f"it cannot be disarmed: {error.message}") from error

    def _be_armed(self) -> None:
        self._come_down()
        if self.uav.state() is State.LANDED_ARMED:
            if self.now_s() - self._armed_s <= _FRESHLY_ARMED_S:
                return
            try:
                self._be_disarmed()
            except StaysArmedError:  # some seconds after a landing it may disarm, and arm itself again
                self.let_pass(_DISARM_S)
                self.wait_for_state(State.LANDED_ARMED)
                return
        if self.has_pilot:
            self.uav.simulation.pilot_arm()
        elif self.info.is_arming_allowed:
            self.uav.arm()
        else:
            self._ask("arm the UAV")
        self._armed_s = self.wait_for_state(State.LANDED_ARMED, limit_s=_OPERATOR_S).stamp_s

    def _be_flying(self) -> None:
        state = self.uav.state()
        if state is State.FLYING_MANUAL:
            self._take_control()
        elif state is not State.FLYING_AUTO:
            self._be_armed()
            self.take_off()
        self.wait_for_state(State.FLYING_AUTO)

    def take_off(self) -> None:
        """Takes off to `start`, and remembers the position."""
        self.remember_position()
        self.uav.take_off(HEIGHT_M)

    def remember_position(self) -> None:
        """Makes the present position the one that flights stay close to."""
        odometry = self.uav.odometry()
        self._ground, self._yaw_rad = odometry.pose.position, odometry.pose.yaw_rad

    remember_place = renamed(remember_position, "Flight.remember_place")

    def _ask(self, what: str) -> None:
        if self._ask_operator is None:
            raise CannotRunError(f"there is no operator to {what}")
        self._ask_operator(what)

    # What must hold

    def refuses(self, kind: type[E], action: Callable[[], object], what: str) -> E:
        """Requires an action to raise an error, and returns the error."""
        try:
            action()
        except UalError as error:
            if isinstance(error, kind):
                require(bool(error.message) and "\n" not in error.message, f"{what}: the message is not one line")
                return error
            raise CheckFailedError(f"{what}: expected {kind.__name__}, got {error.reason}: {error.message}") from error
        raise CheckFailedError(f"{what}: expected {kind.__name__}, but it was accepted")

    def refuses_during(self, task: Task, actions: Iterable[tuple[Callable[[], object], str]]) -> None:
        """Requires each action to be refused in this state for as long as a task runs. One that is given in the moment
        in which the task ends may be accepted: that proves nothing.
        """
        for action, what in actions:
            if task.done():
                return
            try:
                self.refuses(WrongStateError, action, what)
            except CheckFailedError:
                if task.info().status is not TaskStatus.SUCCEEDED:
                    raise

    def require_at(self, goal: Pose, what: str) -> None:
        """Requires it to be at a pose, in position and heading."""
        sample = self.uav.telemetry()
        off_m = (position(sample) - goal.position).norm()
        require(off_m <= self.tolerances.position_m, f"{what}: {off_m:.2f} m from the goal")
        if goal.orientation.norm() > 0.0:
            self.require_heading(goal, what)

    def require_heading(self, goal: Pose, what: str) -> None:
        """Requires its heading to be that of the pose."""
        off_rad = abs(wrap_angle(yaw_rad(self.uav.telemetry()) - goal.yaw_rad))
        require(off_rad <= self.tolerances.heading_rad, f"{what}: {math.degrees(off_rad):.0f}° off the heading")

    def require_holds(self, where: Vector3, what: str) -> None:
        """Requires it to stay at a position for a while; uses the mean, because an estimate wanders."""
        off_m = (mean(map(position, self.let_pass(_HOLD_CHECK_S))) - where).norm()
        require(off_m <= self.tolerances.position_m, f"{what}: it is {off_m:.2f} m from its position")

    def require_stays(self, what: str) -> None:
        """Requires it to stay where it is."""
        self.require_holds(mean(map(position, self.let_pass(_HOLD_CHECK_S))), what)

    def require_straight(self, samples: Iterable[Telemetry], start: Vector3, goal: Vector3) -> None:
        """Requires it to have stayed on the line from start to goal, and not to have gone beyond the goal."""
        along = goal - start
        length_m = along.norm()
        direction = along / length_m
        widest_m = farthest_m = 0.0
        for sample in samples:
            offset = position(sample) - start
            done_m = offset.dot(direction)
            widest_m = max(widest_m, (offset - direction * done_m).norm())
            farthest_m = max(farthest_m, done_m - length_m)
        t = self.tolerances
        allowed_m = max(0.05, t.line_ratio * length_m) + t.wander_m
        require(widest_m <= allowed_m, f"{widest_m:.2f} m beside the line, more than {allowed_m:.2f} m")
        allowed_m = max(0.05, t.overshoot_ratio * length_m) + t.wander_m
        require(farthest_m <= allowed_m, f"{farthest_m:.2f} m beyond the goal, more than {allowed_m:.2f} m")

    def fly_velocity(self, send: Callable[[], None], until: Callable[[Telemetry], bool], what: str) -> Telemetry:
        """Sends a velocity repeatedly, as programs do, until a condition is fulfilled. Returns that sample."""
        assert self._observer is not None
        start_s: float | None = None
        limit_s = 10.0 * self.tolerances.patience
        for sample in self._observer.following(max(0, len(self._observer.samples) - 1)):
            if until(sample):
                return sample
            start_s = sample.stamp_s if start_s is None else start_s
            require(sample.stamp_s - start_s <= limit_s, f"{what}: not within {limit_s:.0f} s; {describe(sample)}")
            send()
        raise AssertionError("samples never end")

    def stop(self) -> None:
        """Stops the UAV and waits until it is slow."""
        self.uav.set_velocity(Twist())
        self.wait(self.is_slow, "rest")


READY_STATES = (State.LANDED_DISARMED, State.LANDED_ARMED, State.FLYING_AUTO, State.FLYING_MANUAL)


def position(sample: Telemetry) -> Vector3:
    """Returns the position in ``<ns>/odom``."""
    require(sample.odometry is not None, "the telemetry has no odometry")
    assert sample.odometry is not None
    return sample.odometry.pose.position


def mean(vectors: Iterable[Vector3]) -> Vector3:
    """Returns the mean of at least one vector."""
    every = list(vectors)
    return sum(every, Vector3()) / len(every)


def yaw_rad(sample: Telemetry) -> float:
    """Returns the heading in ``<ns>/odom``."""
    require(sample.odometry is not None, "the telemetry has no odometry")
    assert sample.odometry is not None
    return sample.odometry.pose.yaw_rad


def velocity(sample: Telemetry) -> Vector3:
    """Returns the velocity along the axes of ``<ns>/odom``."""
    require(sample.odometry is not None, "the telemetry has no odometry")
    assert sample.odometry is not None
    return sample.odometry.pose.orientation.rotate(sample.odometry.twist.linear)


def speed(sample: Telemetry) -> float:
    """Returns the speed."""
    return velocity(sample).norm()


def describe(sample: Telemetry) -> str:
    """Describes a sample in a few words, human-readable."""
    if sample.odometry is None:
        return f"state {sample.state.name} ({sample.state_reason})"
    p = position(sample)
    return (
        f"state {sample.state.name} ({sample.state_reason}), at {p.x:.2f} {p.y:.2f} {p.z:.2f}, {speed(sample):.2f} m/s"
    )


def _offers(uav: Uav, part: SimulationPart) -> bool:
    try:
        return part in uav.simulation.parts()
    except NotSupportedError:
        return False
