"""UAL ends in flight: the Crazyflie hovers on by itself."""

from __future__ import annotations

from pathlib import Path

from tests.simulators.crazyflie import Supervisor
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.waiting import until
from ual.geometry import Pose
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions


def test_it_hovers_on_when_ual_ends_en_route(tmp_path: Path) -> None:
    backend = LockstepCrazyflie(BackendOptions("uav_1", None, {"cache_directory": str(tmp_path)}))
    crazyflie = backend.crazyflie
    with UAL(backend, allow_arming=True) as uav:
        until(uav.is_ready, seen=uav.telemetry)
        uav.arm()
        uav.take_off(1.0)
        uav.go_to_waypoint(Pose.at(8.0, 0.0, 1.0), blocking=False)
        until(lambda: crazyflie.current_position[0] >= 0.5, seen=uav.telemetry)
    assert backend.snapshot().control.mode is not None
    crazyflie.run(30.0)
    assert crazyflie.supervisor is Supervisor.FLYING
    x, _, z = crazyflie.current_position
    assert abs(z - 1.0) < 0.1
    assert x < 4.0
    assert max(map(abs, crazyflie.velocity)) < 0.02
