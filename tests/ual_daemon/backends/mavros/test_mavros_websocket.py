"""The backend with a bridge behind a real WebSocket, in real time: sockets, threads, JSON and CBOR."""

from __future__ import annotations

import pytest

from tests.simulators.mavros import Mavros
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.simulators.rosbridge import Bridge
from tests.simulators.rosbridge_server import RosbridgeServer
from tests.waiting import until
from ual.types import State
from ual_daemon import UAL


@pytest.mark.parametrize("has_cbor", [False, True])
@pytest.mark.parametrize("ros", [1, 2])
def test_it_is_found_and_known_over_a_websocket(ros: int, has_cbor: bool) -> None:
    port = MemoryPort()
    node = Mavros(Px4(port, is_terse=True), port, ros=ros, name="/uav_2/mavros", has_gps_status=True)
    with (
        RosbridgeServer(Bridge(ros, [node], has_cbor=has_cbor)) as server,
        UAL("mavros", "uav_2", url=f"{server.url}/uav_2", allow_arming=True) as uav,
    ):
        until(lambda: uav.telemetry().state is State.LANDED_DISARMED)
        until(lambda: uav.info().limits.horizontal_speed_m_s == 12.0)
        until(lambda: uav.telemetry().position_geo is not None)
        assert uav.info().autopilot_version == "1.17.0"
        uav.arm()
        until(lambda: uav.telemetry().state is State.LANDED_ARMED)
