from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat
from ual.errors import PermissionDeniedError, RejectedByAutopilotError, UalTimeoutError
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.firmwares.safety_pilot import LinkPilot
from ual_daemon.backends.mavlink import MavlinkBackend

SIMULATOR_UID = int.from_bytes(b"ONIDLATI", "little")  # of system 1
OFFBOARD, LOITER = 6 << 16, 4 << 16 | 3 << 24


def version(uid: int) -> Any:
    return mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 1, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid)


def status(*, is_ready: bool) -> Any:
    health = mavlink.MAV_SYS_STATUS_PREARM_CHECK if is_ready else 0
    return mavlink.MAVLink_sys_status_message(0, 0, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


class Pilot:
    """The pilot of a scripted PX4."""

    def __init__(self) -> None:
        self.harness = Harness()
        self.armings: list[Future[None]] = []
        self.pilot = LinkPilot(lambda: self.harness.discovery.session, self._arm)

    def _arm(self) -> Future[None]:
        self.armings.append(Future())
        return self.armings[-1]


def test_nothing_may_be_armed_before_it_says_that_it_is_a_simulator_and_ready() -> None:
    it = Pilot()
    assert not it.pilot.may_arm()
    it.harness.receive(heartbeat(LOITER), status(is_ready=True))
    assert not it.pilot.may_arm()
    it.harness.receive(version(SIMULATOR_UID), status(is_ready=False))
    assert not it.pilot.may_arm()
    it.harness.receive(status(is_ready=True))
    assert it.pilot.may_arm()


def test_in_a_mode_in_which_it_cannot_be_armed_it_is_ready_all_the_same_since_arming_leaves_that() -> None:
    it = Pilot()
    it.harness.receive(heartbeat(OFFBOARD), version(SIMULATOR_UID), status(is_ready=False))
    assert it.pilot.may_arm()


def test_the_id_of_a_flight_controller_is_refused() -> None:
    it = Pilot()
    it.harness.receive(heartbeat(LOITER), version(0x3130_5110_3332_3438), status(is_ready=True))
    with pytest.raises(PermissionDeniedError, match="no simulator: its unique id is 0x3130511033323438"):
        it.pilot.may_arm()
    with pytest.raises(PermissionDeniedError):
        it.pilot.arm()
    assert it.armings == []


def test_hardware_in_the_loop_is_hardware() -> None:
    it = Pilot()
    beat = heartbeat(LOITER)
    beat.base_mode |= mavlink.MAV_MODE_FLAG_HIL_ENABLED
    it.harness.receive(beat, version(SIMULATOR_UID), status(is_ready=True))
    with pytest.raises(PermissionDeniedError, match="hardware in the loop"):
        it.pilot.may_arm()
    assert it.harness.session.info().is_simulation  # though what flies is simulated


def test_an_autopilot_that_is_not_known_is_refused() -> None:
    it = Pilot()
    it.harness.receive(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_GENERIC))
    with pytest.raises(PermissionDeniedError):
        it.pilot.may_arm()


def ready() -> Pilot:
    it = Pilot()
    it.harness.receive(heartbeat(LOITER), version(SIMULATOR_UID), status(is_ready=True))
    return it


def test_it_arms_and_reports_what_the_autopilot_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ual_daemon.backends.firmwares.safety_pilot.ARMING_LIMIT_S", 0.01)
    it = ready()
    with pytest.raises(UalTimeoutError):
        it.pilot.arm()
    assert it.armings[0].cancelled()  # and is not sent again
    refusing = LinkPilot(lambda: it.harness.discovery.session, refused)
    with pytest.raises(RejectedByAutopilotError, match="no GPS"):
        refusing.arm()


def refused() -> Future[None]:
    future: Future[None] = Future()
    future.set_exception(RejectedByAutopilotError("no GPS"))
    return future


def test_what_is_at_a_serial_link_is_real_before_anything_is_sent() -> None:
    assert MavlinkBackend(BackendOptions("uav_1", "serial:///dev/ttyACM0:57600")).safety_pilot() is None
    assert MavlinkBackend(BackendOptions("uav_1", "udpin://127.0.0.1:14540")).safety_pilot()
