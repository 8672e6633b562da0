"""Daemons as real processes, simulated autopilots over real sockets, in real time: killed, cut off, three at once."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc
from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.simulators import ArduPilot, Autopilot, BadLink, Faults, Px4, TcpPort, UdpPort, flying
from tests.simulators.px4 import LOITER
from tests.waiting import until, until_state
from ual.geometry import Pose
from ual.types import State

ASKING = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
PATIENT = {"backend": "patient_mavlink", "module": "tests.simulators.daemon"}
SERVING, NOT_SERVING = health_pb2.HealthCheckResponse.SERVING, health_pb2.HealthCheckResponse.NOT_SERVING


@dataclass
class Vehicle:
    """A simulated autopilot that flies, and where a daemon finds it."""

    autopilot: Autopilot
    port: UdpPort | TcpPort
    link: BadLink
    url: str

    def commands_since(self, after_s: float) -> set[int]:
        """Returns the commands to the autopilot, other than to send something."""
        return {command for time_s, command, _, _ in self.autopilot.commands if time_s >= after_s} - ASKING


def vehicle_of(kind: str, system_id: int = 1, of_loss_s: float = 1.0) -> Vehicle:
    """PX4 over UDP, which leaves OFFBOARD when no setpoint came for `of_loss_s`; ArduPilot over TCP."""
    port: UdpPort | TcpPort = UdpPort() if kind == "px4" else TcpPort()
    link = BadLink(port, 0)
    if kind == "px4":
        px4 = Px4(link, system_id=system_id)
        # On a busy computer the daemon or its caller may get no processor for longer than a real PX4 waits.
        px4.parameters.update(COM_OF_LOSS_T=of_loss_s, COM_DISARM_PRFLT=LIMIT_S)
        return Vehicle(px4, port, link, f"udpout://127.0.0.1:{port.address[1]}")
    return Vehicle(ArduPilot(link, system_id=system_id), port, link, f"tcp://127.0.0.1:{port.address[1]}")


@pytest.fixture(params=["px4", "ardupilot"])
def vehicle(request: pytest.FixtureRequest) -> Iterator[Vehicle]:
    vehicle = vehicle_of(request.param, of_loss_s=LIMIT_S)
    with flying(vehicle.autopilot):
        yield vehicle


def take_off(uav: ual.Uav, vehicle: Vehicle) -> None:
    until_state(uav, State.LANDED_DISARMED)
    until(lambda: uav.info().autopilot_version != "", "its version")
    until(lambda: uav.telemetry().position_geo is not None, "its place on Earth")
    assert vehicle.autopilot.pilot_arm()
    until_state(uav, State.LANDED_ARMED)
    uav.take_off(2.0)


def ahead(uav: ual.Uav, distance_m: float) -> Pose:
    here = uav.odometry().pose.position
    return Pose.at(here.x + distance_m, here.y, here.z)


def test_a_daemon_that_is_killed_in_flight_and_started_anew_takes_control_back(
    vehicle: Vehicle, start_daemon: StartDaemon
) -> None:
    daemon = start_daemon("--url", vehicle.url, **PATIENT)
    with ual.Uav(address=daemon.address) as uav:
        take_off(uav, vehicle)
        uav.go_to_waypoint(ahead(uav, 50.0), blocking=False)
        until(lambda: uav.velocity().twist.linear.norm() > 1.0, "its speed")
        daemon.signal(signal.SIGKILL)
        daemon.wait()
    if isinstance(vehicle.autopilot, Px4):  # it returns, and the safety pilot stops that
        vehicle.autopilot.parameters["COM_OF_LOSS_T"] = 1.0  # before, a starved daemon would have lost OFFBOARD
        until(lambda: vehicle.autopilot.heartbeat().custom_mode >> 24 == 5, "PX4's return")
        with vehicle.autopilot.lock:
            assert vehicle.autopilot.request_mode(LOITER)
    started_s = vehicle.autopilot.elapsed_s
    daemon = start_daemon("--url", vehicle.url, **PATIENT)
    told = daemon.wait_for("state", old="UNINITIALIZED")
    state = "FLYING_MANUAL" if isinstance(vehicle.autopilot, Px4) else "FLYING_AUTO"
    assert told["new"] == state
    with ual.Uav(address=daemon.address) as uav:
        assert vehicle.commands_since(started_s) == set()  # nothing is armed and no mode changed unasked
        if uav.state() is State.FLYING_MANUAL:
            uav.recover_from_manual()
        assert uav.state() is State.FLYING_AUTO
        uav.land()
        until_state(uav, State.LANDED_DISARMED)


def test_a_daemon_that_was_not_commanded_ends_cleanly_in_another_flight(start_daemon: StartDaemon) -> None:
    vehicle = vehicle_of("ardupilot")
    with flying(vehicle.autopilot):
        daemon = start_daemon("--url", vehicle.url, **PATIENT)
        with ual.Uav(address=daemon.address) as uav:
            take_off(uav, vehicle)
            daemon.signal(signal.SIGKILL)
            daemon.wait()
        autopilot = vehicle.autopilot
        until(lambda: autopilot.elapsed_s - autopilot.setpoints_s[-1] > 1.0, "the last setpoint that was on its way")
        began_s, count = vehicle.autopilot.elapsed_s, len(vehicle.autopilot.setpoints_s)
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        daemon.wait_for("state", new="FLYING_AUTO")
        daemon.signal(signal.SIGTERM)
        assert daemon.wait() == 0
        daemon.wait_for("ended")
        assert len(vehicle.autopilot.setpoints_s) == count
        assert vehicle.commands_since(began_s) == set()


def test_health_follows_the_link(vehicle: Vehicle, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    stub: Any = health_pb2_grpc.HealthStub(daemon.channel())

    def is_health(status: int) -> bool:
        return bool(stub.Check(health_pb2.HealthCheckRequest(), timeout=LIMIT_S).status == status)

    until(lambda: is_health(SERVING), "SERVING")
    silent = daemon.wait_for("state", old="UNINITIALIZED")
    vehicle.link.down = Faults(is_silent=True)
    daemon.wait_for("state", after=silent, new="UNINITIALIZED")
    until(lambda: is_health(NOT_SERVING), "NOT_SERVING")
    vehicle.link.down = Faults()
    until(lambda: is_health(SERVING), "SERVING again")


def test_a_half_open_connection_is_abandoned_and_made_anew(start_daemon: StartDaemon) -> None:
    vehicle = vehicle_of("ardupilot")
    assert isinstance(vehicle.port, TcpPort)
    with flying(vehicle.autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        ready = daemon.wait_for("state", old="UNINITIALIZED")
        with vehicle.autopilot.lock:
            vehicle.port.leave_half_open()
        lost = daemon.wait_for("state", after=ready, new="UNINITIALIZED")
        daemon.wait_for("state", after=lost, new="LANDED_DISARMED")
        assert vehicle.port.sessions_count == 2


def test_a_reboot_that_closes_the_connection_is_noticed(start_daemon: StartDaemon) -> None:
    vehicle = vehicle_of("ardupilot")
    assert isinstance(vehicle.autopilot, ArduPilot)
    vehicle.autopilot.settle_s = 4.0
    with flying(vehicle.autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        ready = daemon.wait_for("state", old="UNINITIALIZED")
        vehicle.autopilot.reboot()
        daemon.wait_for("autopilot_rebooted", after=ready)
        daemon.wait_for("state", after=ready, old="UNINITIALIZED", new="LANDED_DISARMED")


def test_three_daemons_fly_three_vehicles_for_one_client(start_daemon: StartDaemon) -> None:
    vehicles = [vehicle_of("px4", number, of_loss_s=LIMIT_S) for number in (1, 2, 3)]
    with flying(*(vehicle.autopilot for vehicle in vehicles)), ExitStack() as stack:
        daemons: list[DaemonProcess] = [
            start_daemon("--url", vehicle.url, ns=f"uav_{number}", **PATIENT)
            for number, vehicle in enumerate(vehicles, 1)
        ]
        uavs = [
            stack.enter_context(ual.Uav(f"uav_{number}", address=daemon.address))
            for number, daemon in enumerate(daemons, 1)
        ]
        for uav, vehicle in zip(uavs, vehicles, strict=True):
            until_state(uav, State.LANDED_DISARMED)
            assert vehicle.autopilot.pilot_arm()
            until_state(uav, State.LANDED_ARMED)
        for task in [uav.take_off(2.0, blocking=False) for uav in uavs]:
            task.wait()
        goals = [ahead(uav, 2.0 * number) for number, uav in enumerate(uavs, 1)]
        for task in [uav.go_to_waypoint(goal, blocking=False) for uav, goal in zip(uavs, goals, strict=True)]:
            task.wait()
        for number, (uav, vehicle) in enumerate(zip(uavs, vehicles, strict=True), 1):
            assert uav.ns == f"uav_{number}"
            assert vehicle.autopilot.position[1] == pytest.approx(-0.15 + 2.0 * number, abs=0.5)  # east, by the truth
        for task in [uav.land(blocking=False) for uav in uavs]:
            task.wait()


def test_home_survives_a_daemon_that_is_killed_while_the_uav_is_carried(
    vehicle: Vehicle, start_daemon: StartDaemon
) -> None:
    if isinstance(vehicle.autopilot, ArduPilot):
        vehicle.autopilot.settle_s = 3.0
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_DISARMED)
        until(lambda: uav.info().autopilot_version != "", "its version")
        until(lambda: uav.telemetry().gps is not None, "its satellites")
        uav.set_home()
    daemon.wait_for("command", command="set_home")
    daemon.signal(signal.SIGKILL)
    daemon.wait()
    vehicle.autopilot.reboot((0.0, 20.0, 0.0))
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    daemon.wait_for("home_restored")
    with ual.Uav(address=daemon.address) as uav:
        until(lambda: uav.telemetry().pose is not None, "its pose")
        assert tuple(uav.pose().pose.position)[:2] == pytest.approx((20.0, 0.0), abs=0.05)
        assert uav.telemetry().frame_lost == ""
