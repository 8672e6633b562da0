"""Allowed orders to gimbals, and their effects, with a UAV of light whose gimbals are made up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, TypeVar

import pytest

from tests.ual_daemon.services.limits import limit
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    RejectedByAutopilotError,
    UalTimeoutError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import IDENTITY, PointStamped, Pose, Quaternion, Transform, Vector3
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
)
from ual_daemon import UAL
from ual_daemon.backends import futures
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.offers.gimbals import GimbalAttitude, GimbalDriver, GimbalDrivers
from ual_daemon.backends.values import Snapshot
from ual_daemon.vehicle.gimbals import aimed, angles_of

T = TypeVar("T")
ALL = frozenset(GimbalAbility)
BODY, HORIZON, EARTH = GimbalReference.BODY, GimbalReference.HORIZON, GimbalReference.EARTH
STEP_S = 0.02
DOWN = math.pi / 2.0


def near(angle_rad: float) -> Any:
    """Equals an angle that differs by rounding."""
    return pytest.approx(angle_rad, abs=1e-6)


class MadeUp(GimbalDriver):
    """Notes what it is ordered, and looks there at once."""

    def __init__(self, number: int = 0, abilities: frozenset[GimbalAbility] = ALL) -> None:
        self.orders: list[tuple[Any, ...]] = []
        self.facts = GimbalInfo(number, "made up", abilities, pitch=AngleRange(-0.5, 1.6), yaw=AngleRange(-2.0, 2.0))
        self.control_of: tuple[GimbalControl | None, str] = (GimbalControl.FREE, "")
        self.looks: GimbalAttitude | None = None
        self.answers: Future[None] = futures.done()
        self.on_control: Callable[[], object] = lambda: None
        self.troubles: list[str] = []

    @property
    def info(self) -> GimbalInfo:
        return self.facts

    @property
    def mount_position(self) -> Vector3:
        return Vector3(0.0, 0.0, -0.1)

    def attitude(self) -> GimbalAttitude | None:
        return self.looks

    def control(self) -> tuple[GimbalControl | None, str]:
        self.on_control()
        return self.control_of

    def problems(self) -> Sequence[str]:
        return self.troubles

    def _order(self, *order: Any) -> Future[None]:
        self.orders.append(order)
        return self.answers

    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        return self._order("angles", angles, reference)

    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        return self._order("rates", pitch_rad_s, yaw_rad_s)

    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        self._order("aim", angles, reference)

    def move_to_neutral(self) -> Future[None]:
        return self._order("neutral")

    def retract(self) -> Future[None]:
        return self._order("retract")

    def take_control(self) -> Future[None]:
        self.control_of = (GimbalControl.OURS, "this daemon")
        return self._order("take")

    def release_control(self) -> Future[None]:
        self.control_of = (GimbalControl.FREE, "")
        return self._order("release")


class Offer(GimbalDrivers):
    """The gimbals of a test."""

    def __init__(self, *found: GimbalDriver) -> None:
        self.found = list(found)

    def all(self) -> Sequence[GimbalDriver]:
        return self.found


class Carrier(LightBackend):
    """A light UAV, whose time stands still, with other gimbals."""

    def __init__(self, offer: GimbalDrivers | None) -> None:
        self.offered = offer
        self.boots_count = 0
        super().__init__(BackendOptions("uav_1", settings={"speed_factor": 0.0, "start": [1.0, 2.0, 0.0]}))

    def offer(self, kind: type[T]) -> T | None:
        if kind is GimbalDrivers:
            return self.offered if isinstance(self.offered, kind) else None
        return super().offer(kind)

    def snapshot(self) -> Snapshot:
        found = super().snapshot()
        return found._replace(link=found.link._replace(boots_count=self.boots_count))


class Lab:
    """A UAV with made-up gimbals."""

    def __init__(self, *found: MadeUp, watch_only: bool = False) -> None:
        self.found = found or (MadeUp(),)
        self.offer = Offer(*self.found)
        self.backend = Carrier(self.offer)
        self.uav = UAL(self.backend, watch_only=watch_only)
        self.uav.simulation.step(STEP_S)
        self.made_up, self.gimbal = self.found[0], self.uav.gimbals[0]

    def step(self, duration_s: float = STEP_S) -> None:
        self.uav.simulation.step(duration_s)

    @property
    def last(self) -> tuple[Any, ...]:
        return self.made_up.orders[-1]


@pytest.fixture
def labs() -> Iterator[list[Lab]]:
    opened: list[Lab] = []
    yield opened
    for each in opened:
        each.uav.vehicle.close()


@pytest.fixture
def lab(labs: list[Lab]) -> Lab:
    labs.append(Lab())
    return labs[0]


# --- What is refused --------------------------------------------------------------------------------------------------


def test_a_backend_without_gimbals_refuses() -> None:
    uav = UAL(Carrier(None))
    with pytest.raises(NotSupportedError, match="gimbals: the backend light of uav_1 does not offer them"):
        uav.gimbals.get_all()
    uav.vehicle.close()


def test_one_that_is_not_there_and_one_that_is_not_received_are_refused(lab: Lab) -> None:
    with pytest.raises(InvalidArgumentError, match="there is no gimbal 1: 0 to 0"):
        lab.uav.gimbals[1].status()
    lab.made_up.facts = replace(lab.made_up.facts, is_connected=False)
    with pytest.raises(LinkLostError, match=r"gimbal 0 \(made up\) is not heard"):
        lab.gimbal.status()
    with pytest.raises(LinkLostError):
        lab.gimbal.move_to_neutral()
    assert [each.is_connected for each in lab.uav.gimbals.get_all()] == [False]
    assert lab.made_up.orders == []


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (lambda it: it.set_angles(math.nan), "pitch_rad: nan is not a finite number"),
        (lambda it: it.set_angles(4.0), r"pitch_rad: 4 is out of range \(at most 3.1416\): give radians, not degrees"),
        (lambda it: it.set_angles("1"), "pitch_rad: '1' is not a number"),
        (
            lambda it: it.set_angles(-0.7),
            r"pitch_rad: -0.700 is beyond the limits of gimbal 0 \(-0.500 to 1.600 rad; posi",
        ),
        (
            lambda it: it.set_angles(0.0, 2.1),
            r"yaw_rad: 2.100 is beyond the limits of gimbal 0 \(-2.000 to 2.000 rad\)",
        ),
        (lambda it: it.set_angles(0.0, 3.0, reference=EARTH), r"yaw_rad: 3.000 is beyond"),
        (lambda it: it.set_angles(0.0, frame_id="map"), "frame_id: only angles with the reference EARTH"),
        (lambda it: it.set_angles(0.0, reference="earth"), "reference: 'earth' is not of type GimbalReference"),
        (lambda it: it.set_rates(0.1, math.inf), "yaw_rad_s: inf is not a finite number"),
        (lambda it: it.set_rates(11.0), "pitch_rad_s: 11 is out of range"),
        (lambda it: it.point_at(PointStamped(Vector3(math.nan))), r"point.point.x: nan"),
        (lambda it: it.watch(51.0), "rate_hz: 51 is out of range"),
        (lambda it: it.watch(0.01), "rate_hz: 0.01 is not from 0.1 to 50"),
    ],
)
def test_what_cannot_be_meant_is_refused_and_not_sent(lab: Lab, order: Any, words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        order(lab.gimbal)
    assert lab.made_up.orders == []


@pytest.mark.parametrize(
    ("lacks", "order"),
    [
        (GimbalAbility.ROLL, lambda it: it.set_angles(0.0, 0.0, 0.1)),
        (GimbalAbility.YAW, lambda it: it.set_angles(0.0, 0.1)),
        (GimbalAbility.PITCH, lambda it: it.set_rates(0.1)),
        (GimbalAbility.BODY, lambda it: it.set_angles(0.0, reference=BODY)),
        (GimbalAbility.EARTH, lambda it: it.set_angles(0.0, reference=EARTH)),
        (GimbalAbility.RATES, lambda it: it.set_rates(0.0)),
        (GimbalAbility.NEUTRAL, lambda it: it.move_to_neutral()),
        (GimbalAbility.RETRACT, lambda it: it.retract()),
        (GimbalAbility.CONTROL, lambda it: it.take_control()),
    ],
)
def test_what_it_cannot_do_is_refused(labs: list[Lab], lacks: GimbalAbility, order: Any) -> None:
    labs.append(lab := Lab(MadeUp(abilities=ALL - {lacks})))
    with pytest.raises(NotSupportedError, match=lacks.name.lower()):
        order(lab.gimbal)
    assert lab.made_up.orders == []


def test_a_daemon_that_only_watches_orders_nothing(labs: list[Lab]) -> None:
    labs.append(lab := Lab(watch_only=True))
    for order in (lab.gimbal.move_to_neutral, lab.gimbal.take_control, lambda: lab.gimbal.point_at(Vector3(9.0))):
        with pytest.raises(PermissionDeniedError):
            order()
    assert lab.made_up.orders == []
    assert lab.gimbal.status().control is GimbalControl.FREE


def test_one_that_another_program_controls_is_refused_until_it_is_taken(lab: Lab) -> None:
    lab.made_up.control_of = (GimbalControl.OTHER, "system 255, component 190")
    with pytest.raises(
        WrongStateError, match="system 255, component 190 has the control of gimbal 0; take its control"
    ):
        lab.gimbal.set_angles(0.1)
    assert lab.gimbal.status().controller == "system 255, component 190"
    lab.gimbal.take_control()
    lab.gimbal.set_angles(0.1)
    assert [each[0] for each in lab.made_up.orders] == ["take", "angles"]


def test_one_that_is_free_is_taken_first_and_only_then(lab: Lab) -> None:
    lab.gimbal.set_angles(0.2)
    lab.gimbal.retract()
    assert [each[0] for each in lab.made_up.orders] == ["take", "angles", "retract"]
    assert lab.gimbal.status().activity is GimbalActivity.RETRACTED
    lab.gimbal.release_control()
    assert lab.gimbal.status().activity is None


def test_one_that_never_answers_is_not_waited_for_without_an_end(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, "SetGimbalAngles", 0.01)
    lab.made_up.answers = Future()
    with pytest.raises(UalTimeoutError):
        lab.gimbal.set_rates(0.0)
    assert lab.gimbal.status().activity is None


def test_one_that_refuses_says_so_and_does_not_count_as_ordered(lab: Lab) -> None:
    lab.gimbal.set_angles(0.2)
    lab.made_up.answers = futures.failed(RejectedByAutopilotError("it is folded"))
    with pytest.raises(RejectedByAutopilotError, match="it is folded"):
        lab.gimbal.set_angles(0.3)
    assert lab.gimbal.status().activity is None


# --- Angles -----------------------------------------------------------------------------------------------------------


def test_yaw_counts_from_the_x_axis_of_a_frame(lab: Lab) -> None:
    lab.uav.add_frame(Transform(Vector3(3.0), Quaternion.from_yaw(0.5), "map", "hall"))
    lab.gimbal.set_angles(0.1, 0.25, reference=EARTH, frame_id="hall")
    assert lab.last == ("angles", GimbalAngles(0.0, 0.1, 0.75), EARTH)
    with pytest.raises(UnknownFrameError):
        lab.gimbal.set_angles(0.1, reference=EARTH, frame_id="nowhere")


def test_more_than_half_a_turn_is_the_same_as_less(lab: Lab) -> None:
    lab.gimbal.set_angles(0.0, 3.0 * math.pi / 2.0)
    _, angles, _ = lab.last
    assert angles.yaw_rad == pytest.approx(-math.pi / 2.0)


@pytest.mark.parametrize(
    "orientation",
    [
        IDENTITY,
        Quaternion.from_euler(0.1, 0.4, -2.0),
        Quaternion.from_euler(0.0, DOWN, 0.7),
        Quaternion.from_euler(0.0, -DOWN, -1.0),
    ],
)
def test_angles_are_those_of_the_orientation_also_straight_down(orientation: Quaternion) -> None:
    found = angles_of(orientation).orientation
    same = abs(sum(a * b for a, b in zip(found, orientation, strict=True)))
    assert same == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("reference", "in_odom"),
    [(BODY, (0.0, 0.3, 0.5 + 0.4)), (HORIZON, (0.0, 0.3, 0.5 + 0.4)), (EARTH, (0.0, 0.3, 0.4))],
)
def test_where_it_points_is_reported_in_all_axes(
    labs: list[Lab], reference: GimbalReference, in_odom: tuple[float, float, float]
) -> None:
    labs.append(lab := Lab())
    backend = lab.backend
    backend.place_on_ground(Vector3(), 0.5)
    lab.step()
    lab.made_up.looks = GimbalAttitude(Quaternion.from_euler(0.0, 0.3, 0.4), reference, backend.clock.now_s() - 0.25)
    status = lab.gimbal.status()
    assert status.in_odom is not None
    assert status.in_body is not None
    assert status.angles is not None
    assert status.in_odom.to_euler() == pytest.approx(in_odom, abs=1e-9)
    in_body = (in_odom[0], in_odom[1], in_odom[2] - 0.5)
    assert status.in_body.to_euler() == pytest.approx(in_body, abs=1e-9)
    assert (status.angles.pitch_rad, status.angles.yaw_rad) == pytest.approx(in_body[1:], abs=1e-9)
    assert status.stamp_s == pytest.approx(backend.utc_s() - 0.25)
    frame = lab.uav.transform("uav_1/base_link", "uav_1/gimbal_0")
    assert frame.rotation.to_euler() == pytest.approx(in_body, abs=1e-9)
    assert frame.translation == Vector3(0.0, 0.0, -0.1)


def test_what_is_not_known_is_not_reported(lab: Lab) -> None:
    status = lab.gimbal.status()
    assert (status.angles, status.in_body, status.in_odom, status.stamp_s) == (None, None, None, None)
    with pytest.raises(WrongStateError, match="it is not known yet where the frame uav_1/gimbal_0 is"):
        lab.uav.transform("map", "uav_1/gimbal_0")


# --- Pointing ---------------------------------------------------------------------------------------------------------


def test_it_follows_a_frame_that_moves_until_the_next_order(lab: Lab) -> None:
    """The UAV is at 1, 2 m, and its gimbal 0.1 m below it."""
    lab.uav.add_frame(Transform(Vector3(4.0, 2.0, -3.1), IDENTITY, "map", "car"))
    lab.gimbal.point_at(PointStamped(Vector3(), "car"))
    assert lab.last == ("angles", GimbalAngles(0.0, near(math.pi / 4.0), 0.0), EARTH)
    assert lab.gimbal.status().target == PointStamped(Vector3(), "car")
    lab.uav.add_frame(Transform(Vector3(1.0, 5.0, -0.1), IDENTITY, "map", "car"))
    lab.step(2.0)
    assert lab.last == ("aim", GimbalAngles(0.0, near(0.0), near(math.pi / 2.0)), EARTH)
    aims = [each for each in lab.made_up.orders if each[0] == "aim"]
    assert 33 <= len(aims) <= 41  # 20 times a second, at the next step
    lab.gimbal.set_rates(0.0)
    lab.step(1.0)
    assert lab.made_up.orders[-1] == ("rates", 0.0, 0.0)
    assert lab.gimbal.status().target is None


def test_how_far_it_points_next_to_its_target_is_reported(lab: Lab) -> None:
    now_s = lab.backend.clock.now_s()
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, -0.1)))
    lab.made_up.looks = GimbalAttitude(Quaternion.from_euler(0.0, 0.1, 0.0), HORIZON, now_s)
    assert lab.gimbal.status().off_target_rad == pytest.approx(0.1)


def test_beyond_its_limits_it_points_as_near_as_it_can_and_says_so(lab: Lab) -> None:
    lab.gimbal.point_at(PointStamped(Vector3(1.0, 2.0, 10.0)))
    lab.step(0.1)
    assert lab.last == ("aim", GimbalAngles(0.0, -0.5, 0.0), EARTH)
    (problem,) = lab.gimbal.status().problems
    assert problem == "its pitch ends at -0.500 rad, and -1.571 rad are needed"


def test_one_without_a_yaw_axis_only_pitches(labs: list[Lab]) -> None:
    labs.append(lab := Lab(MadeUp(abilities=ALL - {GimbalAbility.YAW})))
    lab.gimbal.point_at(PointStamped(Vector3(1.0, 5.0, -3.1)))
    assert lab.last == ("angles", GimbalAngles(0.0, near(math.pi / 4.0), 0.0), HORIZON)
    lab.step(0.1)
    assert lab.gimbal.status().problems == ("it has no yaw axis",)


def test_while_the_position_of_the_target_is_not_known_it_stays_and_says_so(lab: Lab) -> None:
    lab.uav.add_frame(Transform(Vector3(4.0, 2.0, 0.0), IDENTITY, "map", "car"))
    lab.gimbal.point_at(PointStamped(Vector3(), "car"))
    lab.uav.remove_frame("car")
    count = len(lab.made_up.orders)
    lab.step(0.2)
    assert len(lab.made_up.orders) == count
    (problem,) = lab.gimbal.status().problems
    assert problem.startswith("it stays as it is: there is no frame car")
    lab.uav.add_frame(Transform(Vector3(4.0, 2.0, 0.0), IDENTITY, "map", "car"))
    lab.step(0.2)
    assert lab.last[0] == "aim"
    assert lab.gimbal.status().problems == ()


def test_it_ends_where_another_program_takes_the_control(lab: Lab) -> None:
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, 0.0)))
    lab.made_up.control_of = (GimbalControl.OTHER, "system 255")
    count = len(lab.made_up.orders)
    lab.step(0.2)
    assert len(lab.made_up.orders) == count
    status = lab.gimbal.status()
    assert (status.activity, status.control) == (None, GimbalControl.OTHER)
    assert status.problems == ("system 255 has taken the control of it: what this daemon ordered has ended",)


def test_an_order_that_comes_while_it_is_aimed_counts(lab: Lab) -> None:
    """Angles that were computed for the target before must not turn it away from those of the newer order."""
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, 0.0)))

    def another_thread() -> None:
        lab.made_up.on_control = lambda: None
        lab.gimbal.set_angles(0.3)

    lab.made_up.on_control = another_thread
    lab.step(0.2)
    assert lab.last == ("angles", GimbalAngles(0.0, 0.3, 0.0), HORIZON)


def test_it_follows_nothing_over_a_boot_of_the_autopilot(lab: Lab) -> None:
    following, lab.backend.boots_count = lab.uav.vehicle.gimbals, 1
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, 0.0)))
    following.update(lab.backend.snapshot())
    assert lab.last[0] == "aim"
    lab.backend.boots_count = 2
    count = len(lab.made_up.orders)
    following.update(lab.backend.snapshot())
    assert len(lab.made_up.orders) == count
    status = lab.gimbal.status()
    assert (status.activity, status.target) == (None, None)
    assert status.problems == ("the autopilot has booted: what this daemon ordered before has ended",)
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, 0.0)))
    following.update(lab.backend.snapshot())
    assert lab.last[0] == "aim"


def test_a_point_in_no_frame_is_refused_and_what_was_ordered_goes_on(lab: Lab) -> None:
    lab.gimbal.point_at(PointStamped(Vector3(6.0, 2.0, 0.0)))
    with pytest.raises(UnknownFrameError):
        lab.gimbal.point_at(PointStamped(Vector3(), "nowhere"))
    assert lab.gimbal.status().activity is GimbalActivity.POINT


def test_what_turns_with_it_cannot_be_looked_at(lab: Lab) -> None:
    lab.uav.add_frame(Transform(Vector3(1.0), IDENTITY, "uav_1/gimbal_0", "lens"))
    for frame_id in ("uav_1/gimbal_0", "lens"):
        with pytest.raises(InvalidArgumentError, match=f"{frame_id} turns with the gimbal itself"):
            lab.gimbal.point_at(PointStamped(Vector3(5.0), frame_id))
    lab.gimbal.point_at(PointStamped(Vector3(5.0), "uav_1/base_link"))


def test_a_limit_that_is_reached_again_and_again_is_logged_once(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.uav.add_frame(Transform(Vector3(), IDENTITY, "map", "kite"))
    lab.gimbal.point_at(PointStamped(Vector3(), "kite"))
    for i in range(20):
        lab.uav.add_frame(Transform(Vector3(1.5, 2.0, 5.0 * (i % 2)), IDENTITY, "map", "kite"))
        lab.step(0.2)
    assert caplog.text.count("does not see what it follows") == 1


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -3.0])
def test_straight_below_it_points_down(yaw_rad: float) -> None:
    aim = aimed(MadeUp().info, Pose.at(0.0, 0.0, 5.0, yaw_rad), Vector3(0.0, 0.0, -5.0))
    assert aim.angles == GimbalAngles(0.0, DOWN, near(yaw_rad))
    assert not aim.limit


# --- Frames -----------------------------------------------------------------------------------------------------------


def test_one_that_is_found_later_has_a_frame_from_then_on(lab: Lab) -> None:
    assert "uav_1/gimbal_1" not in {each.frame_id for each in lab.uav.frames()}
    second = MadeUp(1)
    second.looks = GimbalAttitude(IDENTITY, BODY, 0.0)
    lab.offer.found.append(second)
    listed = lab.uav.gimbals.get_all()
    (frame,) = (each for each in lab.uav.frames() if each.frame_id == "uav_1/gimbal_1")
    assert (frame.parent_frame_id, frame.is_static) == ("uav_1/base_link", False)
    assert [each.frame_id for each in listed] == ["uav_1/gimbal_0", "uav_1/gimbal_1"]


def test_its_frame_belongs_to_it_and_others_may_hang_below(lab: Lab) -> None:
    with pytest.raises(InvalidArgumentError, match="built in"):
        lab.uav.add_frame(Transform(Vector3(), IDENTITY, "map", "uav_1/gimbal_0"))
    with pytest.raises(InvalidArgumentError, match="built in"):
        lab.uav.remove_frame("uav_1/gimbal_0")
    lab.uav.add_frame(Transform(Vector3(1.0), IDENTITY, "uav_1/gimbal_0", "lens"))
    down = Quaternion.from_euler(0.0, DOWN, 0.0)
    lab.made_up.looks = GimbalAttitude(down, HORIZON, lab.backend.clock.now_s())
    lens = lab.uav.transform("uav_1/base_link", "lens")
    assert tuple(lens.translation) == pytest.approx((0.0, 0.0, -1.1), abs=1e-9)


def test_the_links_stay_the_same_while_it_turns(lab: Lab) -> None:
    """Values that follow from the links are computed anew only where the links are others."""
    tree = lab.uav.vehicle._resolver.tree
    links = tree.links
    lab.made_up.looks = GimbalAttitude(IDENTITY, HORIZON, 0.0)
    lab.step(0.1)
    assert tree.links is links


def test_it_is_watched(lab: Lab) -> None:
    assert next(iter(lab.gimbal.watch(50.0))) == lab.gimbal.status()
    assert [repr(each) for each in lab.uav.gimbals] == ["<Gimbal 0>"]
