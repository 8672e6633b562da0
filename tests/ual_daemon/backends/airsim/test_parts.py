"""The parts of the backend that need no simulator."""

from __future__ import annotations

import errno
import math
import os
import time
from typing import Any

import pytest

from tests.simulators.airsim import quaternion
from ual.geometry import Vector3
from ual_daemon.backends.airsim.clock import SimulatorClock
from ual_daemon.backends.airsim.link import SimulatorLink
from ual_daemon.backends.airsim.pilot import Hands, RcSticks
from ual_daemon.backends.airsim.setpoints import led, move_arguments
from ual_daemon.backends.airsim.settings import AirsimAddress, parse_address
from ual_daemon.backends.airsim.state import Rotation, Vector
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S
from ual_daemon.backends.values import VelocitySetpoint
from ual_daemon.settings import ConfigError


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("10.0.0.2:41452", AirsimAddress("10.0.0.2", 41452)),
        ("simulator", AirsimAddress("simulator", 41451)),
        ("[::1]:41453", AirsimAddress("::1", 41453)),
    ],
)
def test_addresses(url: str, address: AirsimAddress) -> None:
    assert parse_address(url) == address


@pytest.mark.parametrize("url", ["", "host:0", "host:99999", "tcp://host:1", "a b", "::1:5"])
def test_what_is_no_address_is_refused(url: str) -> None:
    with pytest.raises(ConfigError, match="HOST:PORT"):
        parse_address(url)


@pytest.mark.parametrize(("north_rad", "east_rad"), [(0.0, math.pi / 2), (math.pi / 2, 0.0), (1.0, math.pi / 2 - 1.0)])
def test_headings_are_counted_from_east(north_rad: float, east_rad: float) -> None:
    rotation = Rotation(**quaternion(0.0, 0.0, north_rad)).to_enu()
    assert rotation.yaw_rad == pytest.approx(east_rad)


def test_the_nose_and_the_left_wing_point_where_the_simulator_says() -> None:
    rotation = Rotation(**quaternion(0.1, 0.2, 0.3)).to_enu()
    nose = Vector(
        math.cos(0.2) * math.cos(0.3), math.cos(0.2) * math.sin(0.3), -math.sin(0.2)
    ).to_enu()  # the first column of the rotation by yaw, pitch and roll
    assert tuple(rotation.rotate(Vector3(1.0, 0.0, 0.0))) == pytest.approx(tuple(nose))
    assert rotation.rotate(Vector3(0.0, 1.0, 0.0)).z == pytest.approx(math.cos(0.2) * -math.sin(0.1) * -1.0, abs=1e-9)


def test_velocities_are_sent_as_north_east_down_and_degrees_clockwise() -> None:
    setpoint = VelocitySetpoint(Vector3(1.0, 2.0, 3.0), math.radians(30.0))
    north, east, down, duration_s, _, yaw, name = move_arguments(setpoint, "Drone1")
    assert (north, east, down, duration_s, name) == (2.0, 1.0, -3.0, 0.5, "Drone1")
    assert yaw == {"is_rate": True, "yaw_or_rate": pytest.approx(-30.0)}


def test_what_is_sent_leads_by_what_is_missing_and_not_more_than_it_may() -> None:
    wanted = VelocitySetpoint(Vector3(1.0, 0.0, 0.0))
    assert led(wanted, Vector3(1.0, 0.0, 0.0)).velocity == Vector3(1.0, 0.0, 0.0)
    assert led(wanted, Vector3(0.0, 0.0, 0.0)).velocity == Vector3(2.0, 0.0, 0.0)
    assert led(wanted, Vector3(-9.0, 0.0, 9.0)).velocity == Vector3(4.0, 0.0, -2.0)


class Wall:
    """The wall's clock, as a test sets it."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.clock = SimulatorClock(lambda: self.now_s)


@pytest.fixture
def wall() -> Wall:
    return Wall()


def test_the_clock_is_the_simulators(wall: Wall) -> None:
    began_s = wall.clock.advance(5000.0)
    wall.now_s += 0.1
    assert wall.clock.now_s() == began_s  # nothing was heard since
    assert wall.clock.advance(5000.3) - began_s == pytest.approx(0.3)


def test_the_clock_goes_on_while_the_simulator_is_silent(wall: Wall) -> None:
    began_s = wall.clock.advance(5000.0)
    wall.now_s += BLIND_SILENCE_S + 0.01
    assert wall.clock.now_s() - began_s == pytest.approx(BLIND_SILENCE_S + 0.01)
    wall.now_s += 3.0 - BLIND_SILENCE_S - 0.01
    assert wall.clock.now_s() - began_s == pytest.approx(3.0)
    assert wall.clock.advance(5000.1) - began_s == pytest.approx(3.0)  # it never goes back
    assert wall.clock.advance(5000.2) - began_s == pytest.approx(3.1)


@pytest.mark.parametrize("later_s", [-4000.0, 4000.0])
def test_a_simulator_that_was_started_anew_does_not_make_the_clock_jump(wall: Wall, later_s: float) -> None:
    began_s = wall.clock.advance(5000.0)
    assert wall.clock.advance(5000.0 + later_s) == began_s
    assert wall.clock.advance(5000.0 + later_s + 0.5) == pytest.approx(began_s + 0.5)


def channels(**arguments: Any) -> RcSticks:
    values = {"sticks": RcSticks(), "velocity": Vector3(), "yaw_rad": 0.0, "is_on_ground": False, "step_s": 0.02}
    return Hands().channels(**{**values, **arguments})


def test_the_pilot_hovers_with_centred_sticks() -> None:
    assert tuple(channels()) == pytest.approx((0.0, 0.0, 0.61, 0.0))


def test_the_pilot_flies_ahead_where_the_nose_points() -> None:
    assert channels(sticks=RcSticks(forward=1.0)).forward > 0.0
    assert channels(velocity=Vector3(0.0, 2.0, 0.0), yaw_rad=math.pi / 2).forward < 0.0
    assert channels(velocity=Vector3(0.0, 2.0, 0.0)).left < 0.0


def test_the_pilot_leaves_the_throttle_alone_on_the_ground() -> None:
    assert channels(is_on_ground=True) == RcSticks()
    assert channels(is_on_ground=True, sticks=RcSticks(up=1.0)).up > 0.61


def test_why_the_simulator_is_not_reached_names_its_address() -> None:
    def refuse(_: AirsimAddress) -> Any:
        raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))

    link = SimulatorLink(AirsimAddress("hall", 41451), "", 50.0, refuse, time.monotonic)
    link.receive(0.0)
    assert link.trouble == "hall:41451: Connection refused"
