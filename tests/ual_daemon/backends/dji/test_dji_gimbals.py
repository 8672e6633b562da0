"""The gimbal of an aircraft behind a simulated psdk_ros2."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import pytest

from tests.simulators.dji import Psdk
from tests.simulators.dji_cameras import GimbalModule
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, wait
from tests.waiting import until
from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError
from ual.geometry import PointStamped, Pose, Vector3
from ual.gimbals import GimbalReference, GimbalStatus
from ual_daemon import UAL
from ual_daemon.backends.dji import gimbals


@pytest.fixture
def flight() -> Iterator[tuple[UAL, LockstepDji]]:
    with ready() as (uav, backend):
        yield uav, backend


@pytest.fixture
def uav(flight: tuple[UAL, LockstepDji]) -> UAL:
    return flight[0]


@pytest.fixture
def backend(flight: tuple[UAL, LockstepDji]) -> LockstepDji:
    return flight[1]


@pytest.fixture
def gimbal(uav: UAL, backend: LockstepDji) -> GimbalModule:
    """Gimbal at the first port."""
    [front] = [node for node in backend.bridge.nodes if isinstance(node, Psdk)]
    with backend.lock:
        front.gimbal_module.is_mounted = True
    until(uav.gimbals.get_all, "the gimbal")
    until(lambda: uav.gimbals.get_all()[0].is_connected, "that it is mounted")
    return front.gimbal_module


def test_without_one_none_is_listed(uav: UAL, backend: LockstepDji) -> None:
    wait(backend, 3.0)
    assert uav.gimbals.get_all() == []


def test_angles_from_the_nose_are_kept_from_it_while_the_aircraft_turns(
    uav: UAL, backend: LockstepDji, gimbal: GimbalModule
) -> None:
    fly(uav)
    found = uav.gimbals[0]
    found.set_angles(0.5, 0.3)
    heading_rad = uav.pose().pose.yaw_rad
    until(lambda: gimbal.rotations, "the order")
    assert gimbal.pitch_rad == 0.5
    assert math.cos(gimbal.yaw_rad - heading_rad - 0.3) == pytest.approx(1.0, abs=1e-3)
    turn(uav, heading_rad + 1.0)
    wait(backend, 0.5)
    turned_rad = uav.pose().pose.yaw_rad
    assert math.cos(turned_rad - heading_rad - 1.0) == pytest.approx(1.0, abs=0.02)
    assert math.cos(gimbal.yaw_rad - turned_rad - 0.3) == pytest.approx(1.0, abs=1e-3)
    until(lambda: is_about(found.status(), 0.5, 0.3), "where it looks")
    found.set_angles(0.1, 0.7, reference=GimbalReference.EARTH)
    until(lambda: gimbal.pitch_rad == 0.1, "the order")
    assert gimbal.yaw_rad == pytest.approx(0.7)
    count = len(gimbal.rotations)
    turn(uav, heading_rad)
    assert len(gimbal.rotations) == count  # it does not turn with the nose


@pytest.mark.parametrize("reference", [GimbalReference.HORIZON, GimbalReference.EARTH])
def test_what_the_pilots_dial_has_turned_is_left_to_him(
    uav: UAL, backend: LockstepDji, gimbal: GimbalModule, reference: GimbalReference
) -> None:
    fly(uav)
    found = uav.gimbals[0]
    found.set_angles(0.5, 0.3, reference=reference)
    until(lambda: found.status().activity is not None, "the order")
    wait(backend, 2.0)
    with backend.lock:
        gimbal.pitch_rad = -0.2
    until(lambda: found.status().activity is None, "that it was taken")
    assert "the dial of the remote controller, or another program, has taken" in " ".join(found.status().problems)
    count = len(gimbal.rotations)
    turn(uav, uav.pose().pose.yaw_rad + 1.0)
    assert len(gimbal.rotations) == count
    assert gimbal.pitch_rad == -0.2
    wait(backend, 2.0)
    found.set_angles(0.4, 0.0)
    until(lambda: gimbal.pitch_rad == 0.4, "the next order")
    wait(backend, 2.0)
    assert found.status().activity is not None


def turn(uav: UAL, yaw_rad: float) -> None:
    here = uav.pose().pose.position
    uav.go_to_waypoint(Pose.at(here.x, here.y, here.z, yaw_rad))


def is_about(status: GimbalStatus, pitch_rad: float, yaw_rad: float) -> bool:
    angles = status.angles
    return angles is not None and max(abs(angles.pitch_rad - pitch_rad), abs(angles.yaw_rad - yaw_rad)) < 0.05


def test_it_points_at_a_position(uav: UAL, gimbal: GimbalModule) -> None:
    fly(uav)
    here = uav.pose().pose.position
    uav.gimbals[0].point_at(PointStamped(Vector3(here.x, here.y + 3.0, 0.0), "uav_1/odom"))
    until(lambda: gimbal.rotations, "the order")
    assert gimbal.pitch_rad == pytest.approx(math.pi / 4.0, abs=0.1)
    assert gimbal.yaw_rad == pytest.approx(math.pi / 2.0, abs=0.1)


def test_neutral_and_what_is_refused(uav: UAL, gimbal: GimbalModule) -> None:
    found = uav.gimbals[0]
    found.set_angles(0.5)
    until(lambda: gimbal.pitch_rad == 0.5, "the order")
    found.move_to_neutral()
    assert gimbal.pitch_rad == 0.0
    gimbal.refuses_reset = True
    with pytest.raises(RejectedByAutopilotError, match="log of the wrapper's gimbal node"):
        found.move_to_neutral()
    for order in (partial(found.set_rates, 0.1), found.retract, partial(found.set_angles, 0.0, 0.0, 0.1)):
        with pytest.raises(NotSupportedError):
            order()


def test_what_is_wrong_with_it_is_reported(uav: UAL, backend: LockstepDji, gimbal: GimbalModule) -> None:
    gimbal.is_pitch_limited = True
    until(lambda: "its pitch is at a limit" in uav.gimbals[0].status().problems, "the limit")
    gimbal.is_mounted = False
    until(lambda: not uav.gimbals.get_all()[0].is_connected, "that it is gone")
    with pytest.raises(LinkLostError):
        uav.gimbals[0].set_angles(0.1)
    gimbal.is_mounted = True
    until(lambda: uav.gimbals.get_all()[0].is_connected, "that it is back")
    with backend.lock:
        backend.bridge.faults.silent_topics.add("/psdk_ros2/gimbal_angles")
    until(lambda: not uav.gimbals.get_all()[0].is_connected, "its silence")
    assert gimbals.ANGLES_SILENCE_S > 1.0  # as the wrapper tells its angles once a second


def test_the_older_wrapper_has_none() -> None:
    with ready(LockstepOsdk) as (uav, backend):
        wait(backend, 2.0)
        assert uav.gimbals.get_all() == []
