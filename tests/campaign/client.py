"""A client as a process of its own, which can be killed: ``python -m tests.campaign.client HOST:PORT``.

Each line of JSON on its standard input is a step; it writes a line when the step begins and one when it ends.
"""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import ual
from tests.campaign.plan import ABORT, AGAIN, JUMP, PAUSE
from ual.errors import UalError, UalTimeoutError
from ual.fences.values import FencePlan, FenceZone, RallyPoint
from ual.geometry import Pose, Twist, Vector3
from ual.missions import Waypoint
from ual.types import AltitudeReference

_LIMIT_S = 20.0
_PERIOD_S = 0.04
_PAUSE_S = 1.5
_AGAIN_S = 0.6
"""A start that comes later may be of another station's mission."""
_FENCE_M = 60.0


def main() -> None:
    with ual.Uav("uav_1", address=sys.argv[1]) as uav:
        _write(ready=True)
        for line in sys.stdin:
            step = json.loads(line)
            _write(began_s=time.monotonic())
            _write(**_do(uav, step["name"], step["values"]), ended_s=time.monotonic())


class _Count:
    """Accepted setpoints of a stream."""

    value = 0


def _do(uav: ual.Uav, name: str, values: Sequence[float]) -> dict[str, object]:
    accepted = _Count()
    try:
        _STEPS[name](uav, values, accepted)
    except UalError as error:
        by = error.metadata.get("by", "")
        return {"outcome": error.reason, "by": by, "text": str(error), "accepted": accepted.value}
    return {"outcome": "", "by": "", "text": "", "accepted": accepted.value}


def _write(**values: object) -> None:
    print(json.dumps(values), flush=True)


def _path(uav: ual.Uav, values: Sequence[float], _: _Count) -> None:
    places = [Pose.at(*values[each : each + 3]) for each in range(0, len(values), 3)]
    uav.follow_path(places, corner_radius_m=0.5, timeout_s=_LIMIT_S)


def _velocity(uav: ual.Uav, values: Sequence[float], accepted: _Count) -> None:
    velocity = Twist(Vector3(*values[:3]))
    until_s = time.monotonic() + values[3]
    while time.monotonic() < until_s:
        uav.set_velocity(velocity)
        accepted.value += 1
        time.sleep(_PERIOD_S)


def _pose(uav: ual.Uav, values: Sequence[float], accepted: _Count) -> None:
    """Half a metre towards the place, as a reference that is sent as it is."""
    here = uav.pose().pose.position
    way = Vector3(*values) - here
    goal = here + way * (0.5 / max(0.5, way.norm()))
    for _ in range(25):
        uav.set_pose(Pose.at(goal.x, goal.y, goal.z))
        accepted.value += 1
        time.sleep(_PERIOD_S)


def _geo(uav: ual.Uav, values: Sequence[float], _: _Count) -> None:
    uav.go_to_waypoint_geo(values[0], values[1], values[2], AltitudeReference.AMSL, timeout_s=_LIMIT_S)


def _above_home(uav: ual.Uav, values: Sequence[float], _: _Count) -> None:
    uav.go_to_waypoint_geo(values[0], values[1], values[2], AltitudeReference.HOME, timeout_s=_LIMIT_S)


def _upload(uav: ual.Uav, values: Sequence[float], _: _Count) -> None:
    starts = range(0, len(values), 3)
    uav.mission.upload([Waypoint(values[each], values[each + 1], values[each + 2]) for each in starts])


def _mission(uav: ual.Uav, values: Sequence[float], accepted: _Count) -> None:
    """Has the mission flown; after a while something is asked of it. A refusal of that does not end the step."""
    action, after_s, last_item = int(values[0]), values[1], int(values[2])
    task = uav.task(uav.mission.start().id)
    accepted.value = 1
    with contextlib.suppress(UalTimeoutError):
        task.wait(timeout_s=min(after_s, _AGAIN_S) if action == AGAIN else after_s)
    with contextlib.suppress(UalError):
        if action == PAUSE:
            uav.mission.pause()
            time.sleep(_PAUSE_S)
            uav.mission.resume()
        elif action == JUMP:
            uav.mission.jump_to(last_item)
        elif action == ABORT:
            uav.abort()
        elif action == AGAIN:
            task = uav.task(uav.mission.start().id)
    task.wait(timeout_s=2.0 * _LIMIT_S)


def _parameters(uav: ual.Uav, *_: object) -> None:
    name = "MPC_ACC_DOWN_MAX" if "PX4" in uav.info().autopilot else "PSC_JERK_Z"
    parameter = uav.parameters.get(name)
    uav.parameters.set(name, parameter.value)


def _fence(uav: ual.Uav, *_: object) -> None:
    """Brings a wide fence and a rally point, and takes them away again."""
    here = uav.telemetry().position_geo
    assert here is not None
    zone = FenceZone(is_inclusion=True, points=((here.latitude_deg, here.longitude_deg),), radius_m=_FENCE_M)
    rally = RallyPoint(here.latitude_deg, here.longitude_deg, 5)
    uav.fence.upload(FencePlan((zone,), (rally,)), force=True)
    uav.fence.clear(with_rally_points=True, force=True)


def _logs(uav: ual.Uav, *_: object) -> None:
    uav.logs.get_all()


def _camera(uav: ual.Uav, *_: object) -> None:
    for camera in uav.cameras:
        camera.take_photo()


_STEPS: dict[str, Callable[[ual.Uav, Sequence[float], _Count], Any]] = {
    "arm": lambda uav, *_: uav.arm(timeout_s=_LIMIT_S),
    "set_home": lambda uav, *_: uav.set_home(set_z=True),
    "take_off": lambda uav, values, _: uav.take_off(values[0], timeout_s=_LIMIT_S),
    "land": lambda uav, *_: uav.land(timeout_s=2.0 * _LIMIT_S),
    "rtl": lambda uav, values, _: uav.return_to_launch(values[0], timeout_s=2.0 * _LIMIT_S),
    "recover": lambda uav, values, _: uav.recover_from_manual(force=bool(values and values[0]), timeout_s=_LIMIT_S),
    "abort": lambda uav, values, _: uav.abort(freeze=bool(values[0])),
    "go_to": lambda uav, values, _: uav.go_to_waypoint(Pose.at(*values[:3]), timeout_s=_LIMIT_S),
    "go_to_geo": _geo,
    "go_above_home": _above_home,
    "path": _path,
    "velocity": _velocity,
    "pose": _pose,
    "upload": _upload,
    "mission": _mission,
    "parameters": _parameters,
    "fence": _fence,
    "logs": _logs,
    "camera": _camera,
}


if __name__ == "__main__":
    main()
