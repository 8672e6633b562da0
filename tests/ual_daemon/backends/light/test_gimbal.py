"""The gimbals of a light UAV: they turn at no more than their speed, within their limits, and carry a camera."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual_daemon.backends.light.drone import Drone
from ual.errors import LinkLostError
from ual.geometry import Quaternion, Vector3, wrap_angle
from ual.gimbals import GimbalAngles, GimbalControl, GimbalReference
from ual.simulation import LinkLost
from ual_daemon.backends.light.gimbal import GimbalMoment, LightGimbal
from ual_daemon.backends.light.settings import LightGimbalSettings, LightSettings
from ual_daemon.backends.offers.cameras import CameraDrivers
from ual_daemon.settings import ConfigError, convert

HORIZON, EARTH = GimbalReference.HORIZON, GimbalReference.EARTH
ANGLES = st.floats(-math.pi, math.pi)


class Bench:
    """A gimbal whose time and whose UAV's heading are in the test's hand."""

    def __init__(self, **settings: object) -> None:
        self.moment = GimbalMoment(100.0, 0.0, False)
        self.gimbal = LightGimbal(0, LightGimbalSettings(**settings), lambda: self.moment)  # type: ignore[arg-type]
        self.gimbal.attitude()

    def after(self, passed_s: float, heading_rad: float = 0.0) -> tuple[float, ...]:
        """Returns its angles a time later: roll, pitch, yaw."""
        self.moment = self.moment._replace(time_s=self.moment.time_s + passed_s, heading_rad=heading_rad)
        return astuple(self.gimbal.angles(self.moment))


def test_each_axis_turns_at_no_more_than_its_speed() -> None:
    bench = Bench(speed_rad_s=0.5)
    bench.gimbal.set_angles(GimbalAngles(0.1, 1.0, -0.8), HORIZON).result(0)
    assert bench.after(0.4) == pytest.approx((0.1, 0.2, -0.2))
    assert bench.after(1.0) == pytest.approx((0.1, 0.7, -0.7))
    assert bench.after(9.0) == pytest.approx((0.1, 1.0, -0.8))


def test_rates_go_on_until_a_limit_and_zeros_hold() -> None:
    bench = Bench()
    bench.gimbal.set_rates(0.1, -0.2).result(0)
    assert bench.after(2.0) == pytest.approx((0.0, 0.2, -0.4))
    bench.gimbal.set_rates(0.0, 0.0).result(0)
    assert bench.after(5.0) == pytest.approx((0.0, 0.2, -0.4))
    bench.gimbal.set_rates(-5.0, 0.5).result(0)
    assert bench.after(20.0) == pytest.approx((0.0, -0.5, wrap_angle(-0.4 + 10.0)))


def test_with_the_earth_as_reference_it_does_not_turn_with_the_uav() -> None:
    bench = Bench()
    bench.gimbal.set_angles(GimbalAngles(yaw_rad=0.5), EARTH).result(0)
    assert bench.after(1.0, heading_rad=0.3) == pytest.approx((0.0, 0.0, 0.2))
    assert bench.after(1.0, heading_rad=-0.3) == pytest.approx((0.0, 0.0, 0.8))


def test_neutral_and_retracted() -> None:
    bench = Bench()
    bench.gimbal.set_angles(GimbalAngles(0.0, 1.0, 1.0), HORIZON).result(0)
    bench.after(2.0)
    bench.gimbal.retract().result(0)
    assert bench.after(2.0) == pytest.approx((0.0, -0.5, 0.0))
    bench.gimbal.move_to_neutral().result(0)
    assert bench.after(2.0) == pytest.approx((0.0, 0.0, 0.0))


def test_it_is_free_until_its_control_is_taken() -> None:
    gimbal = Bench().gimbal
    assert gimbal.control() == (GimbalControl.FREE, "")
    gimbal.take_control().result(0)
    assert gimbal.control() == (GimbalControl.OURS, "this daemon")
    gimbal.release_control().result(0)
    assert gimbal.control() == (GimbalControl.FREE, "")


@given(first=ANGLES, second=ANGLES, passed_s=st.floats(0.0, 10.0))
def test_an_axis_without_an_end_takes_the_shorter_path(first: float, second: float, passed_s: float) -> None:
    bench = Bench(speed_rad_s=0.3)
    bench.gimbal.set_angles(GimbalAngles(yaw_rad=first), HORIZON)
    bench.after(100.0)
    bench.gimbal.set_angles(GimbalAngles(yaw_rad=second), HORIZON)
    turned_rad = abs(wrap_angle(bench.after(passed_s)[2] - first))
    assert turned_rad == pytest.approx(min(0.3 * passed_s, abs(wrap_angle(second - first))), abs=1e-6)


@given(pitch_rad=ANGLES, yaw_rad=ANGLES, steps=st.lists(st.floats(0.0, 3.0), max_size=8))
def test_it_stays_within_its_limits(pitch_rad: float, yaw_rad: float, steps: list[float]) -> None:
    bench = Bench(yaw_limits_rad=(-1.0, 2.0))
    bench.gimbal.set_angles(GimbalAngles(0.0, pitch_rad, yaw_rad), EARTH)
    for step_s in steps:
        _, pitch, yaw = bench.after(step_s, heading_rad=step_s)
        assert -0.5 <= pitch <= math.pi / 2.0
        assert -1.0 <= yaw <= 2.0


# --- Of a UAV ---------------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def closed_drones() -> Iterator[None]:
    yield
    while Drone.opened:
        Drone.opened.pop().backend.close()


def test_a_camera_on_a_gimbal_points_where_that_points() -> None:
    """Also where a picture is painted later than it was taken."""
    camera_on_it = {
        "gimbal": 0,
        "mount_pitch_rad": 0.0,
        "mount_position": [0.1, 0.0, 0.0],
        "width_px": 32,
        "height_px": 24,
    }
    drone = Drone(cameras=[camera_on_it], gimbals=[{"position": [0.0, 0.0, -0.2], "speed_rad_s": 100.0}])
    gimbal = drone.backend._gimbals.gimbals[0]
    cameras = drone.backend.offer(CameraDrivers)  # type: ignore[type-abstract]
    assert cameras is not None
    (camera,) = cameras.all()
    photos = []
    for pitch_rad in (0.0, math.pi / 2.0):
        gimbal.set_angles(GimbalAngles(0.0, pitch_rad), HORIZON).result(0)
        drone.run(0.1)
        photos.append(camera.take_photo().result(0))
    ahead, down = (each.viewpoint.mounting for each in photos)
    assert ahead is not None
    assert down is not None
    assert tuple(ahead.position) == pytest.approx((0.1, 0.0, -0.2))
    assert tuple(down.position) == pytest.approx((0.0, 0.0, -0.3), abs=1e-9)
    assert tuple(down.orientation.rotate(Vector3(1.0))) == pytest.approx((0.0, 0.0, -1.0), abs=1e-9)
    images = [camera.image(each.number).result(30.0) for each in photos]
    assert [each.viewpoint.mounting for each in images] == [ahead, down]
    assert images[0].data != images[1].data


def test_while_its_link_is_lost_nothing_is_reported_and_it_goes_on_turning() -> None:
    drone = Drone(gimbals=[{"speed_rad_s": 0.5}])
    gimbal = drone.backend._gimbals.gimbals[0]
    gimbal.set_angles(GimbalAngles(0.0, 1.0), HORIZON).result(0)
    drone.run(0.5)
    drone.sim.begin_fault(LinkLost(), 1.0)
    drone.run(0.2)
    assert gimbal.attitude() is None
    assert not gimbal.info.is_connected
    with pytest.raises(LinkLostError, match="gimbal 0 is not heard"):
        gimbal.set_rates(0.0, 0.0).result(0)
    gimbal.aim(GimbalAngles(), HORIZON)
    drone.run(3.0)
    attitude = gimbal.attitude()
    assert attitude is not None
    assert attitude.reference is HORIZON
    assert attitude.orientation == Quaternion.from_euler(0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        (
            {"gimbals": [{"pitch_limits_rad": [0.1, 1.0]}]},
            "pitch_limits_rad: its neutral angle, 0, is not from 0.1 to 1",
        ),
        ({"cameras": [{"gimbal": 1}]}, "light camera is on gimbal 1, and there are 1"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, object], key: str) -> None:
    with pytest.raises(ConfigError, match=key):
        convert(settings, LightSettings, "light")
