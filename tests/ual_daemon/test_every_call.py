"""Every unary method of every service, whatever is not known of the autopilot: no caller meets a defect of UAL."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest
from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.ports import free_port
from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot
from tests.simulators.ports import UdpPort
from tests.simulators.px4 import Px4
from tests.simulators.runner import flying
from tests.ual_daemon.plausible_requests import METHODS, call_all, defects_among, requests_of
from tests.waiting import until
from ual.errors import LinkLostError, UalError, WrongStateError
from ual.geometry import Pose, PoseStamped, Twist, Vector3
from ual.missions.items import Waypoint
from ual.types import State
from ual_daemon import UAL

HOST = "127.0.0.1"
PLACES = frozenset({mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN})
POSITIONS = PLACES | {mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT}


@contextmanager
def nobody(_: int) -> Iterator[None]:
    """Nothing is heard."""
    yield


def silent_about(
    make: Callable[..., Autopilot], silent: frozenset[int]
) -> Callable[[int], AbstractContextManager[None]]:
    """An autopilot that never sends these messages."""

    def run(port: int) -> AbstractContextManager[None]:
        link = UdpPort((HOST, 0), (HOST, port))
        autopilot = make(link) if make is Px4 else make([link])
        for message_id in silent:
            autopilot.builders[message_id] = lambda: None
        if silent is ALL:
            autopilot.ignored |= {mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ}
        return flying(autopilot)

    return run


class _All(frozenset[int]):
    """All messages but the heartbeat."""


ALL = _All(set(mavlink.mavlink_map) - {mavlink.MAVLINK_MSG_ID_HEARTBEAT})
HEARD = {
    "nobody": nobody,
    "px4, heartbeats only": silent_about(Px4, ALL),
    "ardupilot, heartbeats only": silent_about(ArduPilot, ALL),
    "px4 without a position": silent_about(Px4, POSITIONS),
    "ardupilot without a position": silent_about(ArduPilot, POSITIONS),
    "px4 without home": silent_about(Px4, PLACES),
    "ardupilot without home": silent_about(ArduPilot, PLACES),
}


def wait_until_received(uav: ual.Uav | UAL) -> None:
    until(lambda: not uav.telemetry().state_reason.startswith("nothing heard"), seen=uav.telemetry)


def require_no_defect(daemon: DaemonProcess) -> None:
    outcomes = call_all(daemon.address)
    assert defects_among(outcomes) == []
    assert [each for each in daemon.events if "Traceback" in str(each) or each.get("level") == "error"] == []
    # The calls came through: they were not all refused for the same thing.
    assert len(Counter(each.status for each in outcomes)) > 2


def test_there_are_requests_for_every_method() -> None:
    assert len(METHODS) > 75
    for method in METHODS.values():
        assert len(list(requests_of(method))) == 5


@pytest.mark.slow
@pytest.mark.parametrize("heard", HEARD)
def test_no_call_meets_a_defect_while_little_is_known(heard: str, start_daemon: StartDaemon) -> None:
    port = free_port()
    daemon = start_daemon("--url", f"udpin://{HOST}:{port}", "--allow-arming", backend="mavlink")
    with HEARD[heard](port):
        if heard != "nobody":
            with ual.Uav(address=daemon.address) as uav:
                wait_until_received(uav)
        require_no_defect(daemon)


@pytest.mark.slow
@pytest.mark.parametrize("flags", [(), ("--auto-arm",)])
def test_no_call_meets_a_defect_on_a_light_uav(flags: tuple[str, ...], start_daemon: StartDaemon) -> None:
    daemon = start_daemon(*flags)
    if flags:
        with ual.Uav(address=daemon.address) as uav:
            uav.wait_for(State.LANDED_ARMED)
            uav.take_off(5.0)
    require_no_defect(daemon)


@pytest.mark.usefixtures("runtime_dir")
@pytest.mark.parametrize("heard", ["nobody", "px4 without a position", "ardupilot without a position"])
def test_the_class_says_what_a_plan_lacks(heard: str) -> None:
    port = free_port()
    items = [Waypoint(47.3978, 8.5457, 10.0)]
    with HEARD[heard](port), UAL(backend="mavlink", url=f"udpin://{HOST}:{port}", ns="uav_1") as uav:
        if heard != "nobody":
            wait_until_received(uav)
        kind, why = (LinkLostError, "heard") if heard == "nobody" else (WrongStateError, "where the UAV is: the autop")
        with pytest.raises(kind, match=why):
            uav.mission.plan(items)
        if heard == "px4 without a position":  # it is uploaded, and judged at its start
            assert uav.mission.upload(items).items
        for ask in _plans(uav):
            with pytest.raises(UalError):
                ask()


def _plans(uav: UAL) -> list[Callable[[], object]]:
    dry_run, goal = uav.dry_run, PoseStamped(Pose(Vector3(1.0, 2.0, 3.0)))
    return [
        lambda: dry_run.take_off(3.0),
        lambda: dry_run.go_to_waypoint(goal),
        lambda: dry_run.go_to_waypoint_geo(47.3978, 8.5457, 10.0),
        lambda: dry_run.follow_path([goal, goal]),
        dry_run.return_to_launch,
        dry_run.land,
        dry_run.recover_from_manual,
        lambda: dry_run.set_pose(goal),
        lambda: dry_run.set_velocity(Twist(Vector3(1.0, 0.0, 0.0))),
    ]
