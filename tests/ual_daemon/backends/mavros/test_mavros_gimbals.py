"""The gimbal of the autopilot, through a simulated MAVROS: what is ordered, what follows, and what is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple

import pytest

from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.mount import MOUNT_CONTROL, PITCH_YAW, Mount
from tests.ual_daemon.backends.mavros.test_mavros_faults import make
from tests.waiting import until
from ual import conformance
from ual.conformance import CannotRunError, Flight, own_gimbals
from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import PointStamped, Vector3
from ual.gimbals import GimbalAbility, GimbalActivity, GimbalAngles, GimbalReference
from ual.types import State
from ual_daemon import UAL

KINDS = {"px4": ("px4", 2), "px4-ros1": ("px4", 1), "ardupilot": ("ardupilot", 1), "ardupilot-ros2": ("ardupilot", 2)}
TELLS = ["px4", "px4-ros1", "ardupilot-ros2"]
NOWHERE = GimbalAngles()
AHEAD = PointStamped(Vector3(5.0, 1.0, -1.0), "uav_1/base_link")


@pytest.fixture(params=list(KINDS))
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    backend = make(*KINDS[request.param])
    Mount(backend.autopilot)
    return backend


@pytest.fixture
def uav(backend: LockstepMavros) -> Iterator[UAL]:
    with UAL(backend) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        until(uav.gimbals.get_all, "the gimbal")
        yield uav


@pytest.fixture
def mount(backend: LockstepMavros) -> Mount:
    assert backend.autopilot.mount is not None
    return backend.autopilot.mount


def ordered(backend: LockstepMavros, *commands: int) -> list[tuple[float, ...]]:
    """The parameters of what was ordered, or of what follows."""
    return [params for _, command, params, _ in backend.autopilot.commands if command in commands]


@pytest.mark.parametrize("backend", TELLS, indirect=True)
@pytest.mark.parametrize("check", own_gimbals.ON_GROUND, ids=lambda check: check.name)
def test_conformance(uav: UAL, check: conformance.Check) -> None:
    until(lambda: uav.gimbals[0].status().angles, "where it looks")
    conformance.run_check(Flight(uav), check)


@pytest.mark.parametrize("backend", ["ardupilot"], indirect=True)
def test_a_gimbal_that_does_not_tell_where_it_points_says_so(uav: UAL, mount: Mount) -> None:
    """ArduPilot says it by a message that MAVROS of ROS 1 does not know."""
    [info] = uav.gimbals.get_all()
    assert info.note == "MAVROS does not tell where it looks"
    uav.gimbals[0].set_angles(0.5, 0.25)
    assert mount.degrees == pytest.approx((0.0, math.degrees(-0.5), math.degrees(-0.25)))
    status = uav.gimbals[0].status()
    assert (status.angles, status.activity) == (None, GimbalActivity.ANGLES)
    with pytest.raises(CannotRunError, match="does not tell where it looks"):
        conformance.run_check(Flight(uav), own_gimbals.turns_a_gimbal)


@pytest.mark.parametrize("backend", ["ardupilot", "ardupilot-ros2"], indirect=True)
def test_ardupilot_is_ordered_as_a_manager_and_never_turns_itself(
    uav: UAL, backend: LockstepMavros, mount: Mount
) -> None:
    gimbal = uav.gimbals[0]
    heading_rad = backend.autopilot.body.yaw_rad
    gimbal.set_angles(0.5, 0.2, reference=GimbalReference.EARTH)
    assert mount.degrees[2] == pytest.approx(math.degrees(math.pi / 2 - 0.2 - heading_rad))
    gimbal.set_rates(0.1, -0.2)
    assert mount.rates == pytest.approx((math.degrees(-0.1), math.degrees(0.2)))
    gimbal.retract()
    assert mount.is_retracted
    gimbal.move_to_neutral()
    assert (mount.is_retracted, mount.degrees) == (False, (0.0, 0.0, 0.0))
    assert ordered(backend, MOUNT_CONTROL) == []
    assert len(ordered(backend, PITCH_YAW)) == 4
    with pytest.raises(NotSupportedError, match="no roll axis"):
        gimbal.set_angles(0.0, 0.0, 0.1)


@pytest.mark.parametrize("backend", ["px4", "px4-ros1"], indirect=True)
def test_px4_is_ordered_without_its_control(uav: UAL, backend: LockstepMavros, mount: Mount) -> None:
    gimbal, [info] = uav.gimbals[0], uav.gimbals.get_all()
    assert info.pitch is not None
    assert info.pitch.most_rad == pytest.approx(math.pi / 2)
    gimbal.set_angles(0.5, 0.25, 0.1)
    assert mount.degrees == pytest.approx(tuple(map(math.degrees, (0.1, -0.5, -0.25))))
    until(lambda: astuple(gimbal.status().angles or NOWHERE) == pytest.approx((0.1, 0.5, 0.25), abs=1e-3), "its angles")
    for ability in (GimbalAbility.RATES, GimbalAbility.EARTH, GimbalAbility.RETRACT, GimbalAbility.CONTROL):
        assert ability not in info.abilities
    assert ordered(backend, PITCH_YAW) == []


def test_what_follows_holds_up_no_command(uav: UAL, backend: LockstepMavros) -> None:
    """MAVROS does not wait for the acknowledgement of a command_int. One is sent at most ten times a second."""
    gimbal = uav.gimbals[0]
    gimbal.point_at(AHEAD)
    before, begun_s = len(ordered(backend, PITCH_YAW, MOUNT_CONTROL)), backend.clock.now_s()
    backend.autopilot.ignored |= {PITCH_YAW, MOUNT_CONTROL}
    until(lambda: backend.clock.now_s() - begun_s > 3.0, "three seconds")
    count = len(ordered(backend, PITCH_YAW, MOUNT_CONTROL)) - before
    took_s = backend.clock.now_s() - begun_s
    assert 0.3 * took_s / 0.1 <= count <= took_s / 0.1 + 2
    backend.autopilot.ignored.clear()
    gimbal.move_to_neutral()
    assert gimbal.status().activity is GimbalActivity.NEUTRAL
    assert gimbal.status().problems == ()


def test_an_order_that_is_refused_or_not_answered_is_reported(uav: UAL, backend: LockstepMavros) -> None:
    gimbal = uav.gimbals[0]
    backend.autopilot.ignored |= {PITCH_YAW, MOUNT_CONTROL}
    with pytest.raises(UalTimeoutError, match="MAVROS has not answered the command to turn the gimbal"):
        gimbal.set_angles(0.3)
    backend.autopilot.ignored.clear()
    backend.autopilot.mount = None
    with pytest.raises(RejectedByAutopilotError):
        gimbal.set_angles(0.3)


@pytest.mark.parametrize("backend", ["ardupilot-ros2"], indirect=True)
def test_where_it_points_is_not_known_for_long(uav: UAL, backend: LockstepMavros, mount: Mount) -> None:
    gimbal = uav.gimbals[0]
    mount.failures = 2
    until(lambda: gimbal.status().problems == ("its pitch is at a limit",), "its failure")
    backend.bridge.faults.silent_topics.add("/mavros/gimbal_control/device/attitude_status")
    until(lambda: gimbal.status().angles is None, "the silence")
    assert gimbal.status().problems == ()


@pytest.mark.parametrize("backend", ["ardupilot"], indirect=True)
def test_a_bridge_that_is_gone_ends_orders(uav: UAL, backend: LockstepMavros) -> None:
    backend.is_bridge_gone = True
    until(lambda: not uav.gimbals.get_all()[0].is_connected, "the loss")
    with pytest.raises(LinkLostError):
        uav.gimbals[0].set_angles(0.3)
    backend.is_bridge_gone = False


def test_a_uav_without_a_gimbal_has_none() -> None:
    with UAL(make("ardupilot")) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        assert uav.gimbals.get_all() == []
