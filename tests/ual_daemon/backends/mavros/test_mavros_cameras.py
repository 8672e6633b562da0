"""The camera that the autopilot triggers, through a simulated MAVROS: orders, reports, and pictures by distance."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.mavros import BEGIN_UTC_S
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.simulators.trigger import SHOOT, START_CAPTURE, Trigger
from tests.waiting import LIMIT_S, until
from ual import conformance
from ual.cameras import CameraAbility, Photo
from ual.conformance import Flight, own_cameras
from ual.errors import InvalidArgumentError, LinkLostError, NotSupportedError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Pose, Vector3
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.futures import OpenFutures
from ual_daemon.backends.mavros.offers.cameras import AcknowledgedCamera, CameraServices
from ual_daemon.backends.offers.cameras import Viewpoint
from ual_daemon.backends.values import LinkState, MotionState, Sample, Snapshot

DISTANCE_M = 3.0


def make(kind: str, ros: int, **settings: object) -> LockstepMavros:
    port = MemoryPort()
    autopilot = Px4(port, is_terse=True) if kind == "px4" else ArduPilot(port)
    return LockstepMavros(BackendOptions("uav_1", None, settings), autopilot, port, ros)


@pytest.fixture(params=["px4-2", "px4-1", "ardupilot-1", "ardupilot-2"])
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    kind, ros = request.param.split("-")
    return make(kind, int(ros), has_camera_trigger=True)


@pytest.fixture
def trigger(backend: LockstepMavros) -> Trigger:
    return Trigger(backend.autopilot)


@pytest.fixture
def uav(backend: LockstepMavros, trigger: Trigger) -> Iterator[UAL]:
    assert backend.autopilot.trigger is trigger
    with UAL(backend, allow_arming=True) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        until(lambda: has_altitude(uav), "a place with its altitude")
        yield uav


def has_altitude(uav: UAL) -> bool:
    geo = uav.telemetry().position_geo
    return geo is not None and geo.altitude_amsl_m is not None


@pytest.mark.parametrize("check", own_cameras.ON_GROUND[:2], ids=lambda check: check.name)
def test_conformance(uav: UAL, check: conformance.Check) -> None:
    conformance.run_check(Flight(uav), check)


def test_a_picture_is_ordered_once_and_reported_with_its_position(
    uav: UAL, backend: LockstepMavros, trigger: Trigger
) -> None:
    before_s = backend.utc_s()
    photo = uav.cameras[0].take_photo()
    assert len(trigger.places) == 1
    orders = [command for _, command, _, _ in backend.autopilot.commands if command in (SHOOT, START_CAPTURE)]
    assert len(orders) == 1
    assert before_s - 0.5 < photo.stamp_s <= backend.utc_s() + 0.1
    assert photo.stamp_s > BEGIN_UTC_S
    latitude, longitude, altitude = backend.autopilot.geo(trigger.places[0])
    geo = photo.position_geo
    assert geo is not None
    assert (geo.latitude_deg, geo.longitude_deg) == pytest.approx((latitude / 1e7, longitude / 1e7), abs=1e-6)
    assert geo.altitude_amsl_m == pytest.approx(altitude / 1e3, abs=1.0)
    assert photo.body is not None
    [info] = uav.cameras.get_all()
    assert (set(info.abilities), info.is_connected) == ({CameraAbility.PHOTO}, True)
    with pytest.raises(NotSupportedError, match="takes no pictures by time"):
        uav.cameras[0].start_photos(interval_s=1.0)


@pytest.mark.parametrize("backend", ["px4-2", "ardupilot-1"], indirect=True)
def test_by_distance_each_picture_is_reported_where_it_was_taken(
    uav: UAL, backend: LockstepMavros, trigger: Trigger
) -> None:
    fly(uav, backend)
    pose = uav.telemetry().pose
    assert pose is not None
    camera, begin = uav.cameras[0], pose.position
    camera.start_photos(distance_m=DISTANCE_M)
    assert camera.status().distance_m == DISTANCE_M
    uav.go_to_waypoint(Pose(begin + Vector3(0.0, 10.0, 0.0)))
    until(lambda: len(camera.photos()) == len(trigger.places), "the reports")
    assert 3 <= len(trigger.places) <= 4
    for photo, (north, east, _) in zip(camera.photos(), trigger.places, strict=True):
        assert (where(photo) - Vector3(east, north)).horizontal_norm() < 0.5
    camera.stop_photos()
    count = len(trigger.places)
    uav.go_to_waypoint(Pose(begin))
    assert (len(trigger.places), camera.status().missed_count) == (count, 0)
    assert not camera.status().is_taking_photos


def fly(uav: UAL, backend: LockstepMavros) -> None:
    backend.autopilot.pilot_readies()
    until(uav.is_ready, "readiness", seen=uav.telemetry)
    uav.arm()
    uav.take_off(3.0)


def where(photo: Photo) -> Vector3:
    assert photo.body is not None
    return photo.body.pose.position


@pytest.mark.parametrize("backend", ["px4-2"], indirect=True)
def test_reports_that_are_lost_are_missed_and_waited_for_in_vain(uav: UAL, trigger: Trigger) -> None:
    camera = uav.cameras[0]
    camera.take_photo()
    trigger.unreported = {1}
    with pytest.raises(UalTimeoutError, match="it is not known whether it took one"):
        camera.take_photo()
    assert camera.take_photo().number == 1
    assert camera.status().missed_count == 1


@pytest.mark.parametrize("backend", ["px4-2"], indirect=True)
def test_after_a_boot_the_numbers_begin_again_and_what_was_ordered_is_forgotten(
    uav: UAL, backend: LockstepMavros, trigger: Trigger
) -> None:
    camera = uav.cameras[0]
    camera.take_photo()
    trigger.unreported = {1, 2}
    camera.start_photos(distance_m=DISTANCE_M)
    boots_count = backend.snapshot().link.boots_count
    waiting = ThreadPoolExecutor(1).submit(camera.take_photo)
    until(lambda: len(trigger.places) == 3, "the picture that is not told")
    with backend.autopilot.lock:
        backend.autopilot.reboot()
        trigger.boot()
    until(lambda: backend.snapshot().link.boots_count > boots_count, "the boot")
    with pytest.raises(LinkLostError, match="booted"):
        waiting.result(LIMIT_S)
    until(lambda: not camera.status().is_taking_photos, "the end of the pictures by distance")
    until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
    assert camera.take_photo().number == len(camera.photos()) - 1
    assert camera.status().missed_count == 0


@pytest.mark.parametrize("backend", ["ardupilot-1", "ardupilot-2"], indirect=True)
def test_ardupilot_says_by_its_answer_whether_it_has_triggered(
    uav: UAL, backend: LockstepMavros, trigger: Trigger
) -> None:
    camera = uav.cameras[0]
    trigger.works = False
    with pytest.raises(RejectedByAutopilotError, match="FAILED"):
        camera.take_photo()
    backend.autopilot.ignored.add(START_CAPTURE)
    with pytest.raises(UalTimeoutError, match="MAVROS has not answered the command to take a photo"):
        camera.take_photo()
    assert camera.photos() == []


def at(x: float, boots_count: int = 1) -> Snapshot:
    motion = MotionState(pose=Sample(Pose.at(x, 0.0, 2.0), 0.0))
    return Snapshot(0.0, motion=motion, link=LinkState(boots_count=boots_count))


def test_what_is_due_while_an_order_waits_is_missed_and_a_boot_ends_it() -> None:
    answers: list[Future[None]] = []

    def order(_what: str, _command: int, _params: tuple[float, ...]) -> Future[None]:
        answers.append(Future())
        return answers[-1]

    def poll_once() -> Viewpoint:
        return Viewpoint(boots_count=1)

    means = CameraServices(
        lambda _: Future(),
        lambda act: act(),
        OpenFutures().give,
        lambda _: None,
        lambda: at(0.0),
        poll_once,
        lambda: 1.9e9,
        bool,
        int,
    )
    camera = AcknowledgedCamera(order, means)
    camera.start_distance(DISTANCE_M).result(0)
    for x in (0.0, 1.0, 3.5, 6.5):  # the first order is not answered yet
        camera.step(at(x))
    assert (len(answers), camera.status().result(0).missed_count) == (1, 2)
    answers[0].set_result(None)
    camera.step(at(9.5))
    assert len(answers) == 2
    assert len(camera.photos(0)) == 1
    camera.step(at(30.0, boots_count=2))
    assert (len(answers), camera.is_busy) == (2, False)


@pytest.mark.parametrize("backend", ["ardupilot-1", "px4-1"], indirect=True)
def test_a_bridge_that_is_gone_refuses_orders(uav: UAL, backend: LockstepMavros) -> None:
    backend.is_bridge_gone = True
    until(lambda: not uav.cameras.get_all()[0].is_connected, "the loss")
    with pytest.raises(LinkLostError):
        uav.cameras[0].take_photo()
    with pytest.raises(LinkLostError):
        uav.cameras[0].start_photos(distance_m=1.0)
    backend.is_bridge_gone = False


def test_without_the_setting_there_is_none() -> None:
    with UAL(make("ardupilot", 1)) as uav:
        assert uav.cameras.get_all() == []
        with pytest.raises(InvalidArgumentError):
            uav.cameras[0].take_photo()
