"""Velocities within the clearance are those that the rules admit, and are sent as they send them.

Two vehicles live through the same: one may use the clearance, the other one judges each setpoint by every rule.
"""

from __future__ import annotations

import logging
import math
import os
import random
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from typing_extensions import override

from tests.snapshots import changed, value_of
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from ual.types import Capability, GeoPoint, Limits
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import (
    NO_FENCE,
    AutopilotFence,
    Control,
    ControlState,
    EarthReference,
    Estimator,
    FenceLimit,
    Freshness,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Setpoint,
    Snapshot,
    VehicleInfo,
    Zone,
)
from ual_daemon.flight.manoeuvres.fly_reference import FlyReference
from ual_daemon.flight.policy.autopilot_fence import RESERVE_M
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.setpoint_sender import LONGEST_BLIND_S
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.settings import GeofenceSettings, LimitSettings, VehicleSettings
from ual_daemon.tracker.references import Velocity
from ual_daemon.vehicle.vehicle import Vehicle

SETPOINTS = int(os.environ.get("UAL_TEST_SETPOINTS", "0")) or (
    100_000 if os.environ.get("UAL_TEST_HYPOTHESIS") == "thorough" else 2_500
)
ORIGIN = (47.0, 8.0, 400.0)
EARTH = EarthReference(EllipsoidProjection(*ORIGIN), GeoPoint(*ORIGIN[:2]), ORIGIN[2])
LIMITS = Limits(10.0, 4.0, 2.0, 5.0, 3.0, 1.5)
CORNERS = ((-20.0, -20.0), (25.0, -20.0), (25.0, 5.0), (5.0, 5.0), (5.0, 20.0), (-20.0, 20.0))
PLACES = {
    "no fence": VehicleSettings(),
    "a fence": VehicleSettings(geofence=GeofenceSettings(polygon=CORNERS, min_height_m=1.0, max_height_m=30.0)),
    "a fence in map": VehicleSettings(geofence=GeofenceSettings(polygon=CORNERS, frame_id="map"), floor_m=-3.0),
    "users' limits": VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=2.0), floor_m=None, ceiling_m=12.0),
}
REFERENCES = Mode("OFFBOARD", Control.REFERENCES)
MODES = (REFERENCES, Mode("GUIDED", Control.REFERENCES), Mode("HOLD", Control.OTHER), Mode("LAND", Control.LAND))


class _Clock(MonotonicClock):
    time_s = 100.0

    @override
    def now_s(self) -> float:
        return self.time_s


class _Scripted(LightBackend):
    """A backend that says what a test has it say, and notes what is sent."""

    def __init__(self) -> None:
        super().__init__(BackendOptions("uav_1", settings={"speed_factor": 0}))
        self.clock: Any = _Clock()
        self.freshness = Freshness(link_s=1.0, pose_s=0.6, mode_s=1.5, landed_s=1.2, estimator_s=2.0)
        self.told: VehicleInfo = replace(super().info(), limits=LIMITS)
        self.said = Snapshot(0.0)
        self.sent: list[Setpoint] = []

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self.on_update = on_update

    @override
    def info(self) -> VehicleInfo:
        return self.told

    @override
    def snapshot(self) -> Snapshot:
        return self.said.at(self.clock.now_s())

    @override
    def newest(self) -> tuple[Snapshot, float]:
        return self.said, self.clock.now_s()

    @override
    def send(self, setpoint: Setpoint) -> None:
        self.sent.append(setpoint)


class _Twin:
    """One of two vehicles that live through the same."""

    def __init__(self, settings: VehicleSettings, *, has_clearance: bool) -> None:
        self.backend = _Scripted()
        self.vehicle = Vehicle(self.backend, settings)
        self.vehicle.open()
        self.flight = self.vehicle._flight
        self.leases = [NOBODY]
        self.renewed_count = 0
        renew = self.flight.renew_velocity

        def counted(twist: Twist, lease_id: str) -> bool:
            is_renewed = has_clearance and renew(twist, lease_id)
            self.renewed_count += is_renewed
            return is_renewed

        self.flight.renew_velocity = counted  # type: ignore[method-assign]

    def state(self) -> tuple[object, ...]:
        """All that a setpoint may have changed."""
        flight, sent = self.flight, tuple(map(repr, self.backend.sent))
        manoeuvre = flight.manoeuvre
        flown: tuple[object, ...] = (type(manoeuvre), manoeuvre and manoeuvre.name, manoeuvre and manoeuvre.is_timed)
        if isinstance(manoeuvre, FlyReference) and isinstance(manoeuvre.reference, Velocity):
            flown += (repr(manoeuvre.reference.twist), manoeuvre.reference.expires_s, manoeuvre.reference._in_body)
        self.backend.sent.clear()
        newest = repr(flight.sender.newest[1]), flight.sender.newest[0] is manoeuvre, flight.sender._sent_s
        return sent, flown, flight.last_command, newest, flight.authority.is_ours


class Twins:
    """Both vehicles, and what chance makes of their world."""

    def __init__(self, settings: VehicleSettings, seed: int) -> None:
        self.both = tuple(_Twin(settings, has_clearance=each) for each in (True, False))
        self.chance = random.Random(seed)
        self.now_s = 100.0
        self.place, self.own = Vector3(0.0, 0.0, 5.0), Vector3()
        self.armed, self.mode, self.landed, self.is_good = True, REFERENCES, LandedState.IN_AIR, True
        self.fence: AutopilotFence | None = None
        self.earth = EARTH
        self.stale_s = {"mode": 0.0, "armed": 0.0, "landed": 0.0, "estimator": 0.0, "pose": 0.0, "heard": 0.0}
        self.updated_s = 0.0
        self.conflict = ""
        self.calm, self.is_disturbed = 0, True
        self.untaken: Snapshot | None = None
        self.publish()

    def each(self, act: Callable[[_Twin], object]) -> tuple[object, object]:
        """Does the same with both, and returns what became of it."""
        one, other = (_outcome(act, twin) for twin in self.both)
        return one, other

    def publish(self, *, is_taken: bool | None = None) -> None:
        """A snapshot comes, and mostly its update: else a setpoint comes between."""
        now_s, old_s = self.now_s, self.stale_s
        snapshot = Snapshot(
            now_s,
            now_s - old_s["heard"],
            now_s - self.updated_s,
            control=ControlState(
                armed=Sample(self.armed, now_s - old_s["armed"]),
                landed=Sample(self.landed, now_s - old_s["landed"]),
                mode=Sample(self.mode, now_s - old_s["mode"]),
            ),
            motion=MotionState(
                estimator=Sample(
                    Estimator(self.is_good, "" if self.is_good else "it drifts"), now_s - old_s["estimator"]
                ),
                pose=Sample(Pose(self.place, Quaternion.from_yaw(0.3)), now_s - old_s["pose"]),
                velocity=Sample(Twist(self.own), now_s - old_s["pose"]),
                stamp_s=now_s,
            ),
            earth=self.earth,
            autopilot_fence=self.fence,
        )
        snapshot = changed(snapshot, conflict=self.conflict, boots_count=1)
        if self.untaken is not None:
            self._take(self.untaken)
        for twin in self.both:
            twin.backend.said = snapshot
        self.untaken = snapshot
        if is_taken or (is_taken is None and self.chance.random() < 0.75):
            self._take(snapshot)

    def _take(self, snapshot: Snapshot) -> None:
        self.untaken = None
        for twin in self.both:
            twin.backend.on_update(snapshot)

    def let_pass(self, duration_s: float) -> None:
        self.now_s += duration_s
        for twin in self.both:
            twin.backend.clock.time_s = self.now_s

    # --- What changes -------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Time passes, the UAV moves, and at times something else changes."""
        chance = self.chance
        passed_s = chance.choice((0.01, 0.02, 0.02, 0.03, 0.1, 0.3))
        self.let_pass(passed_s)
        self._move(passed_s)
        self.calm -= 1
        if self.calm < 0:
            self.is_disturbed = not self.is_disturbed
            self.calm = chance.randrange(6 if self.is_disturbed else 24)
            if self.is_disturbed:
                chance.choice(self._changes)(self)
                self.publish(is_taken=False)
                return
            self._calm_down()
        if chance.random() < 0.8:
            self.publish()

    def _move(self, passed_s: float) -> None:
        chance = self.chance
        if chance.random() < 0.02:  # elsewhere, likely near an edge
            x, y = chance.choice(CORNERS)
            x, y = chance.choice(((x, chance.uniform(-20, 20)), (chance.uniform(-20, 25), y), (0.0, 0.0)))
            heights = chance.uniform(-1.0, 3.0), 5.0, chance.gauss(12.0, 0.5), 28.0, 115.0, chance.gauss(120.0, 0.5)
            z = chance.choice(heights)
            self.place = Vector3(x + chance.gauss(0.0, 1.5), y + chance.gauss(0.0, 1.5), z)
            self.publish()  # the estimate has jumped
            if chance.random() < 0.95:
                self._set_home(Vector3())
        if chance.random() < 0.1:
            fast = chance.choice((0.0, 0.3, 0.3, 0.3, 0.3, 1.0, 1.0, 4.0, 12.0))
            self.own = Vector3(*(chance.gauss(0.0, fast) for _ in range(3)))
        self.place += self.own * passed_s

    def _calm_down(self) -> None:
        self.armed, self.mode, self.landed, self.is_good = True, REFERENCES, LandedState.IN_AIR, True
        self.conflict, self.updated_s = "", 0.0
        self.stale_s = dict.fromkeys(self.stale_s, 0.0)
        if self.chance.random() < 0.7:
            if self.chance.random() < 0.5:
                self.fence, self.earth = None, EARTH
            x, y = (self.chance.choice((0.0, self.chance.uniform(-9.0, 9.0))) for _ in range(2))
            self.place, self.own = Vector3(x, y, 5.0), Vector3(0.2, 0.1, 0.0)
            self.publish()
            self._set_home(Vector3())
            for twin in self.both:
                twin.flight.geofence.ground.place = Vector3()
        for twin in self.both:
            twin.flight.following.why = ""
            twin.backend.told = replace(twin.backend.told, capabilities=frozenset(Capability))

    def _change_mode(self) -> None:
        self.mode = self.chance.choice(MODES)

    def _change_landed(self) -> None:
        self.landed = self.chance.choice(list(LandedState))

    def _disarm(self) -> None:
        self.armed = False

    def _lose_estimate(self) -> None:
        self.is_good = False

    def _grow_old(self) -> None:
        self.stale_s[self.chance.choice(list(self.stale_s))] = self.chance.choice((0.5, 0.9, 1.1, 1.4, 1.9, 2.5))

    def _turn_away(self) -> None:
        self.updated_s = self.chance.choice((0.2, 0.24, 0.26, 0.5))

    def _near_autopilots_edge(self) -> None:
        """The autopilot has a radius, at whose edge it flies."""
        radius_m, angle = self.chance.uniform(6.0, 12.0), self.chance.uniform(-3.0, 3.0)
        self.earth, self.fence = EARTH, AutopilotFence(radius=FenceLimit(radius_m, "a radius"))
        x, y = (radius_m - RESERVE_M) * math.cos(angle), (radius_m - RESERVE_M) * math.sin(angle)
        self._glide((x, y, 5.0))

    def _glide(self, to: tuple[float, float, float] | None = None) -> None:
        """It flies on without a command, to near an edge."""
        corner, chance = self.chance.choice(CORNERS), self.chance
        places = (*corner, 5.0), (corner[0], 0.0, 5.0), (0.0, 0.0, chance.choice((1.0, 12.0)))
        way = Vector3(*(to or chance.choice(places))) - self.place
        way += Vector3(*(chance.gauss(0.0, 0.7) for _ in range(3)))
        self.own = way / (0.1 * 30)
        for _ in range(30):
            self.let_pass(0.1)
            self.place += self.own * 0.1
            self.publish()
        self.own = Vector3()
        self.publish()

    def _lose_home(self) -> None:
        if self.fence is None:
            self._fence_in()
        elsewhere = GeoPoint(ORIGIN[0] + 1e-4, ORIGIN[1] - 1e-4)
        self.earth = self.earth._replace(home_geo=self.chance.choice((None, elsewhere)))

    def _conflict(self) -> None:
        self.conflict = "two vehicles"

    def _not_follow(self) -> None:
        for twin in self.both:
            twin.flight.following.why = "its motors are stopped"

    def _learn(self) -> None:
        chance = self.chance
        factor = chance.choice((0.1, 0.5, 1.0, 1.0, 3.0))
        limits = Limits(10.0 * factor, 4.0 * factor, 2.0 * factor, 5.0 * factor, 3.0 * factor, 1.5 * factor)
        has_velocity = chance.random() < 0.5
        for twin in self.both:
            told = twin.backend.told
            kept = {*told.capabilities, Capability.VELOCITY} - (set() if has_velocity else {Capability.VELOCITY})
            twin.backend.told = replace(told, limits=limits, capabilities=frozenset(kept))

    def _fence_in(self) -> None:
        chance = self.chance
        ring = tuple((ORIGIN[0] + 1e-4 * a, ORIGIN[1] + 1.5e-4 * b) for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1)))
        self.fence = chance.choice(
            (
                None,
                NO_FENCE,
                AutopilotFence(radius=FenceLimit(chance.uniform(4.0, 16.0), "a radius")),
                AutopilotFence(highest=FenceLimit(chance.uniform(4.0, 9.0), "a height")),
                AutopilotFence(zones=(Zone("a zone", True, ring),)),
            )
        )

    def _move_home(self) -> None:
        chance = self.chance
        self.earth = chance.choice(
            (
                self.earth._replace(home_altitude_amsl_m=ORIGIN[2] + chance.uniform(-3.0, 6.0)),
                self.earth._replace(home_geo=None),
                EarthReference(),
                EARTH,
            )
        )

    def _move_odom(self) -> None:
        self._set_home(Vector3(self.chance.uniform(-22.0, 22.0), 0.0, self.chance.uniform(-2.0, 5.0)))

    def _set_home(self, at: Vector3) -> None:
        self.each(lambda twin: twin.vehicle._resolver.set_home(at, twin.backend.snapshot(), set_z=True))

    def _jump(self) -> None:
        by = Vector3(self.chance.uniform(-5.0, 5.0), 0.0, 1.0)
        for twin in self.both:
            twin.vehicle._resolver.estimate_jumped(by)
            twin.flight.geofence.estimate_jumped(by)

    def _stand(self) -> None:
        self.armed, self.landed = False, LandedState.ON_GROUND

    def _lease(self) -> None:
        is_taken = self.chance.random() < 0.5
        for twin in self.both:
            if is_taken:
                twin.leases.append(twin.vehicle.acquire_lease("tests", "me", take=True, lasts_s=1e9))
            else:
                twin.vehicle.release_lease(twin.leases[-1])

    def _command(self) -> None:
        pose = PoseStamped(Pose(Vector3(1.0, 1.0, 5.0)))
        lease = self.chance.randrange(2)
        what = self.chance.choice(("pose", "abort"))

        def act(twin: _Twin) -> None:
            lease_id = twin.leases[-1 - lease % len(twin.leases)]
            if what == "pose":
                twin.vehicle.commands.setpoints.set_pose(pose, lease_id)
            else:
                twin.vehicle.commands.abort(lease_id=lease_id)

        self.each(act)

    _changes = (
        _change_mode,
        _change_landed,
        _disarm,
        _lose_estimate,
        _grow_old,
        _grow_old,
        _turn_away,
        _glide,
        _glide,
        _lose_home,
        _lose_home,
        _near_autopilots_edge,
        _near_autopilots_edge,
        _conflict,
        _not_follow,
        _learn,
        _fence_in,
        _fence_in,
        _move_home,
        _move_odom,
        _jump,
        _stand,
        _lease,
        _command,
    )

    # --- What is commanded --------------------------------------------------------------------------------------------

    def velocity(self) -> object:
        """A velocity: mostly a plain one, near and far from each limit, and at times a strange one."""
        chance, limits = self.chance, self.both[0].vehicle._limits.get()
        size = chance.choice((0.0, 0.1, 0.3, 0.3, 0.3, 0.8, 0.8, 2.0, 5.0))
        v = Vector3(*(chance.gauss(0.0, size) for _ in range(3)))
        turn = chance.choice((0.0, 0.0, chance.gauss(0.0, 1.0)))
        strange = chance.random()
        if strange < 0.08:  # at a limit, to the last bit
            edge = chance.choice((-1, 0, 1))
            ulp = 1.0 + edge * 2.0**-52 * chance.choice((1, 4))
            h, angle = limits.horizontal_speed_m_s * ulp, chance.uniform(-4.0, 4.0)
            v = chance.choice(
                (
                    Vector3(h, 0.0, 0.0),
                    Vector3(h * math.cos(angle), h * math.sin(angle), 0.0),
                    Vector3(0.0, 0.0, limits.climb_speed_m_s * ulp),
                    Vector3(0.0, 0.0, -limits.descent_speed_m_s * ulp),
                )
            )
            turn = chance.choice((turn, limits.yaw_rate_rad_s * ulp, -limits.yaw_rate_rad_s * ulp))
        elif strange < 0.1:
            odd: Any = chance.choice((math.nan, math.inf, -math.inf, 1, True, "2", None, 1e30, -0.0))
            v = Vector3(*chance.sample((odd, 0.1, 0.0), 3))
        w = Vector3(math.nan if strange > 0.995 else 0.1 if strange > 0.98 else 0.0, 0.0, turn)
        twist = Twist(v, w)
        frame_id = chance.choice(("", "", "", "uav_1/odom", "uav_1/odom", "uav_1/base_link", "map", "nowhere"))
        return twist if chance.random() < 0.7 else TwistStamped(twist, frame_id)

    def command(self) -> None:
        """Both get a velocity, and what becomes of it is compared."""
        velocity: Any = self.velocity()
        newest = self.chance.random() < 0.97
        results = self.each(
            lambda twin: twin.vehicle.commands.setpoints.set_velocity(
                velocity, twin.leases[-1] if newest else twin.leases[0]
            )
        )
        assert results[0] == results[1], velocity
        one, other = (twin.state() for twin in self.both)
        assert one == other, velocity


def _outcome(act: Callable[[_Twin], object], twin: _Twin) -> str:
    try:
        act(twin)
    except (UalError, TypeError, ValueError) as error:
        text = re.sub(r"\(since [^)]*\)", "", str(error))
        return f"{type(error).__name__}: {'' if 'lease' in text else text}"
    return ""


@pytest.mark.parametrize("place", PLACES)
def test_each_velocity_is_sent_or_refused_as_without_the_clearance(
    place: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL)
    renewed_count = 0
    for seed in range(max(1, SETPOINTS // 2_500)):
        twins = Twins(PLACES[place], seed)
        for _ in range(min(SETPOINTS, 2_500) // len(PLACES)):
            twins.step()
            twins.command()
        twins.each(lambda twin: twin.vehicle.prepare_shutdown())
        for _ in range(5):
            twins.command()
        renewed_count += twins.both[0].renewed_count
    assert renewed_count > 0.1 * SETPOINTS / len(PLACES)


def test_who_only_watches_goes_on_with_no_velocity(monkeypatch: pytest.MonkeyPatch) -> None:
    flies = Twins(VehicleSettings(), 0).both[0]
    flies.vehicle.commands.setpoints.set_velocity(Twist(Vector3(0.1, 0.0, 0.0)))
    flight = Vehicle(flies.backend, watch_only=True)._flight
    flight._flown.manoeuvre, flight.authority.is_ours = flies.flight.manoeuvre, True
    monkeypatch.setattr(flight._clearance, "admits", lambda *_: True)
    assert not flight.renew_velocity(Twist(), NOBODY)
    flight.is_watch_only = False
    assert flight.renew_velocity(Twist(), NOBODY)


# --- Each rule by itself ----------------------------------------------------------------------------------------------

SLOW = Twist(Vector3(0.2, 0.1, 0.0))


@pytest.fixture
def streaming() -> _Twin:
    """A UAV that flies a stream, far from each bound: the next velocity is renewed."""
    return stream_in("users' limits")


def stream_in(place: str) -> _Twin:
    twins = Twins(PLACES[place], 0)
    twins.place = Vector3(0.0, 0.0, 8.0)
    twins.publish(is_taken=True)
    twin = twins.both[0]
    for _ in range(8):
        twin.vehicle.commands.setpoints.set_velocity(SLOW)
    assert twin.flight.renew_velocity(SLOW, NOBODY)
    return twin


def says(twin: _Twin, **values: object) -> None:
    twin.backend.said = changed(twin.backend.said, **values)


def grow_old(name: str, limit: str) -> Callable[[_Twin], None]:
    """All is heard at the present moment but one value, which is older than its limit."""

    def act(twin: _Twin) -> None:
        now_s = twin.backend.clock.time_s
        old_s = now_s - getattr(twin.backend.freshness, limit) - 0.01
        says(twin, **{name: old_s if name == "heard_s" else Sample(value_of(twin.backend.said, name).value, old_s)})

    return act


def learn(**values: Any) -> Callable[[_Twin], None]:
    def act(twin: _Twin) -> None:
        twin.backend.told = replace(twin.backend.told, **values)

    return act


def say(**values: object) -> Callable[[_Twin], None]:
    return lambda twin: says(twin, **values)


def raise_ground(twin: _Twin) -> None:
    twin.flight.geofence.ground.place = Vector3(0.0, 0.0, -8.0)


def fly_a_pose(twin: _Twin) -> None:
    twin.vehicle.commands.setpoints.set_pose(PoseStamped(Pose(Vector3(1.0, 1.0, 5.0))))


CHANGES: dict[str, Callable[[_Twin], object]] = {
    "the pilot's mode": say(mode=Sample(MODES[2], 100.0)),
    "on the ground": say(landed=Sample(LandedState.ON_GROUND, 100.0)),
    "it takes off": say(landed=Sample(LandedState.TAKING_OFF, 100.0)),
    "it lands": say(landed=Sample(LandedState.LANDING, 100.0)),
    "it may be on the ground": say(landed=Sample(LandedState.UNKNOWN, 100.0)),
    "no landed state": say(landed=None),
    "disarmed": say(armed=Sample(False, 100.0)),
    "a doubtful estimate": say(estimator=Sample(Estimator(False, "it drifts"), 100.0)),
    "no pose": say(pose=None),
    "two vehicles": say(conflict="two vehicles"),
    "an old mode": grow_old("mode", "mode_s"),
    "an old armed": grow_old("armed", "mode_s"),
    "an old landed state": grow_old("landed", "landed_s"),
    "an old estimator": grow_old("estimator", "estimator_s"),
    "an old pose": grow_old("pose", "pose_s"),
    "an old link": grow_old("heard_s", "link_s"),
    "what came was not read": say(updated_s=100.0 - LONGEST_BLIND_S - 0.01),
    "slower limits": learn(limits=replace(LIMITS, horizontal_speed_m_s=0.2)),
    "no velocities": learn(capabilities=frozenset()),
    "another fence": say(autopilot_fence=AutopilotFence(radius=FenceLimit(1.5, "a radius")), earth=EARTH),
    "the ground is elsewhere": raise_ground,
    "it does not follow": lambda twin: setattr(twin.flight.following, "why", "its motors are stopped"),
    "only watched": lambda twin: setattr(twin.flight, "is_watch_only", True),
    "shutting down": lambda twin: setattr(twin.flight, "is_closing", True),
    "the flight of others": lambda twin: setattr(twin.flight.authority, "is_ours", False),
    "a lease": lambda twin: twin.vehicle.acquire_lease("tests", "me", take=True, lasts_s=1e9),
    "a pose is flown": fly_a_pose,
    "nothing is flown": lambda twin: setattr(twin.flight._flown, "manoeuvre", None),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_stream_does_not_go_on_unjudged_once_this_has_changed(
    streaming: _Twin, change: Callable[[_Twin], object]
) -> None:
    change(streaming)
    streaming.backend.sent.clear()
    assert not streaming.flight.renew_velocity(SLOW, NOBODY)
    assert not streaming.backend.sent


def test_nor_once_the_fence_has_moved_with_home() -> None:
    twin = stream_in("a fence")
    twin.vehicle._resolver.set_home(Vector3(22.0, 0.0, 0.0), twin.backend.snapshot(), set_z=True)
    assert not twin.flight.renew_velocity(SLOW, NOBODY)


@pytest.mark.parametrize("part", ["links", "home", "start", "map_loss", "ground", "fence", "earth"])
def test_each_part_of_the_world_counts(streaming: _Twin, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    geofence, snapshot = streaming.flight.geofence, streaming.backend.said
    world, frame = geofence.world(snapshot), streaming.vehicle._resolver.local_frame
    assert geofence.holds(world, snapshot)
    another = object()
    if part == "links":
        monkeypatch.setattr(streaming.vehicle._resolver.tree, "links", another)
    elif part == "ground":
        monkeypatch.setattr(geofence.ground, "place", another)
    elif part == "fence":
        snapshot = snapshot._replace(autopilot_fence=AutopilotFence())
    elif part == "earth":
        snapshot = changed(snapshot, home_altitude_amsl_m=1.0)
    else:
        monkeypatch.setattr(frame, part, another)
    assert not geofence.holds(world, snapshot)


@pytest.mark.parametrize(
    "limits",
    [
        replace(LIMITS, horizontal_acceleration_m_s2=0.0),
        replace(LIMITS, vertical_acceleration_m_s2=0.0),
        replace(LIMITS, horizontal_speed_m_s=1e4),
        replace(LIMITS, climb_speed_m_s=1e4),
        replace(LIMITS, descent_speed_m_s=1e4),
    ],
)
def test_with_strange_limits_each_velocity_is_assessed(limits: Limits) -> None:
    twin = stream_in("no fence")
    twin.backend.told = replace(twin.backend.told, limits=limits)
    assert not twin.flight.renew_velocity(SLOW, NOBODY)


_ULP = 1.0 + 2.0**-40
BEYOND: dict[str, Any] = {
    "too fast": Twist(Vector3(2.0 * _ULP, 0.0, 0.0)),
    "too fast aslant": Twist(Vector3(1.5, -1.5, 0.0)),
    "climbs too fast": Twist(Vector3(0.0, 0.0, LIMITS.climb_speed_m_s * _ULP)),
    "sinks too fast": Twist(Vector3(0.0, 0.0, -LIMITS.descent_speed_m_s * _ULP)),
    "turns too fast": Twist(Vector3(), Vector3(0.0, 0.0, LIMITS.yaw_rate_rad_s * _ULP)),
    "turns too fast to the right": Twist(Vector3(), Vector3(0.0, 0.0, -LIMITS.yaw_rate_rad_s * _ULP)),
    "no number": Twist(Vector3(math.nan, 0.0, 0.0)),
    "no number upwards": Twist(Vector3(0.0, 0.0, math.nan)),
    "no turn": Twist(Vector3(), Vector3(0.0, 0.0, math.nan)),
    "rolls": Twist(Vector3(), Vector3(0.1, 0.0, 0.0)),
    "pitches": Twist(Vector3(), Vector3(0.0, 0.1, 0.0)),
    "integers": Twist(Vector3(1, 0.0, 0.0)),
    "integers upwards": Twist(Vector3(0.0, 0.0, 1)),
    "an integer to turn": Twist(Vector3(), Vector3(0.0, 0.0, 1)),
    "no vector": Twist(None),  # type: ignore[arg-type]  # a mistake of the caller
    "no vector to turn": Twist(Vector3(), None),  # type: ignore[arg-type]  # as above
    "leads through the ceiling": Twist(Vector3(0.0, 0.0, 3.9)),
}


@pytest.mark.parametrize("twist", BEYOND.values(), ids=BEYOND)
def test_a_velocity_beyond_a_bound_is_assessed_by_every_rule(streaming: _Twin, twist: Any) -> None:
    assert not streaming.flight.renew_velocity(twist, NOBODY)


def test_the_uavs_own_speed_counts_where_it_is_the_higher_one(streaming: _Twin) -> None:
    fast = Sample(Twist(Vector3(9.0, 9.0, 9.0)), 100.0)
    says(streaming, velocity=fast)
    assert not streaming.flight.renew_velocity(SLOW, NOBODY)


@pytest.mark.parametrize("offset", [Vector3(0.0, 0.0, 2.9), Vector3(0.0, 0.0, 3.9)])
def test_near_a_bound_the_position_counts(streaming: _Twin, offset: Vector3) -> None:
    """The ceiling is at 12 m, and it was at 8 m when the stream began."""
    up = Twist(Vector3(0.0, 0.0, 1.5))
    assert streaming.flight.renew_velocity(up, NOBODY)
    here = value_of(streaming.backend.said, "pose").value
    says(streaming, pose=Sample(replace(here, position=here.position + offset), 100.0))
    assert not streaming.flight.renew_velocity(up, NOBODY)


def test_after_one_near_an_edge_a_few_do_not_ask(streaming: _Twin) -> None:
    assert not streaming.flight.renew_velocity(Twist(Vector3(0.0, 0.0, 3.9)), NOBODY)
    asked = [streaming.flight.renew_velocity(SLOW, NOBODY) for _ in range(5)]
    assert asked == [False, False, False, True, True]


def test_a_velocity_by_another_lease_is_assessed(streaming: _Twin) -> None:
    assert not streaming.flight.renew_velocity(SLOW, "another")
