"""A UAV on a real autopilot in simulation, with its safety pilot: waiting, taking off, landing in the end."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import Transmitter
from tests.waiting import until
from ual.geometry import Pose, Vector3
from ual.interface import Uav
from ual.types import State

PATIENCE_S = 40.0
HEIGHT_M = 3.0


class Flight:
    """One UAV, through the class or the client."""

    def __init__(self, uav: Uav, pilot: Transmitter) -> None:
        self.uav = uav
        self.pilot = pilot

    def wait_for(self, condition: Callable[[], bool], what: str, limit_s: float = PATIENCE_S) -> float:
        """Waits, and says how long it took."""
        began_s = time.monotonic()
        until(condition, what, seen=self.uav.telemetry, limit_s=limit_s)
        return time.monotonic() - began_s

    def wait_for_state(self, state: State) -> float:
        return self.wait_for(lambda: self.uav.state() is state, state.name)

    def wait_for_speed(self, speed_m_s: float) -> None:
        """Until it flies as fast."""
        self.wait_for(lambda: self.uav.velocity().twist.linear.horizontal_norm() > speed_m_s, f"{speed_m_s} m/s")

    def position(self) -> Vector3:
        return self.uav.pose().pose.position

    def offset(self, dx: float, dy: float = 0.0) -> Pose:
        """A place at its own height."""
        here = self.position()
        return Pose.at(here.x + dx, here.y + dy, here.z)

    def set_home(self, above_m: float) -> None:
        """A ground station sets home so high above where the UAV is; waits until the daemon knows it.

        ArduPilot keeps a home that was set in this way until it boots; without, each arming sets it.
        """
        self.wait_for(lambda: self.uav.telemetry().position_geo is not None, "its position on Earth")
        here = self.uav.telemetry().position_geo
        assert here is not None
        assert here.altitude_amsl_m is not None
        altitude_m = here.altitude_amsl_m + above_m
        place = (here.latitude_deg, here.longitude_deg, altitude_m)
        self.pilot.order(mavlink.MAV_CMD_DO_SET_HOME, (0.0, 0.0, 0.0, 0.0, *place))

        def is_set() -> bool:
            point = self.uav.telemetry().position_geo
            return (
                point is not None and point.altitude_home_m is not None and abs(point.altitude_home_m + above_m) < 1.0
            )

        self.wait_for(is_set, "home")

    def be_armed(self) -> None:
        """The pilot arms."""
        self.wait_for(self.uav.is_ready, "a state")
        if self.pilot.is_terminated:
            pytest.skip(f"{self.pilot.autopilot} was terminated, and flies again once it has booted: start it anew")
        self.pilot.wait_until_ready()
        self.pilot.arm()
        self.wait_for_state(State.LANDED_ARMED)

    def take_off(self) -> None:
        """The pilot arms, and it climbs."""
        self.be_armed()
        self.uav.take_off(HEIGHT_M)

    def end(self) -> None:
        """Lands, however it flies, and waits for the motors to stop."""
        self.pilot.stand_by()
        if self.uav.state() is State.FLYING_MANUAL:
            self.uav.recover_from_manual()
        if self.uav.state() is State.FLYING_AUTO:
            self.uav.land()
        self.wait_for_state(State.LANDED_DISARMED)
