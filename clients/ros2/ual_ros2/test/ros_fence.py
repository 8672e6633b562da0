"""The autopilot's fence by the services of the node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ual_msgs import msg, srv

from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.interface import Fence
from ual.types import AltitudeReference
from ual_ros2.beside import fence

Call = Callable[..., Any]


class RosFence(Fence):
    """The fence of one UAV."""

    def __init__(self, call: Call) -> None:
        self._call = call

    def get(self) -> KeptFence:
        return _kept(self._call(srv.GetFence, "get_fence"))

    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        given = {"is_configured": True} if plan is None else _plan(plan)
        more = {"replace": replace, "is_only_kept": not enable, "force": force}
        return _kept(self._call(srv.UploadFence, "upload_fence", **given, **more))

    def clear(self, *, with_rally_points: bool = False, force: bool = False) -> KeptFence:
        return _kept(self._call(srv.ClearFence, "clear_fence", with_rally_points=with_rally_points, force=force))

    def enable(self) -> KeptFence:
        return _kept(self._call(srv.EnableFence, "enable_fence", enable=True))

    def disable(self) -> KeptFence:
        return _kept(self._call(srv.EnableFence, "enable_fence", enable=False))


def _plan(plan: FencePlan) -> dict[str, Any]:
    return {
        "zones": [_zone(each) for each in plan.zones],
        "rally_points": [_rally_point(each) for each in plan.rally_points],
    }


def _point(latitude_deg: float, longitude_deg: float) -> Any:
    return msg.GeoPoint(latitude=latitude_deg, longitude=longitude_deg)


def _zone(zone: FenceZone) -> Any:
    points = [_point(*each) for each in zone.points]
    return msg.FenceZone(is_inclusion=zone.is_inclusion, points=points, radius=zone.radius_m or 0.0)


def _rally_point(point: RallyPoint) -> Any:
    return msg.RallyPoint(
        place=_point(point.latitude_deg, point.longitude_deg),
        height=point.height_m,
        is_amsl=point.reference is AltitudeReference.AMSL,
    )


def _kept(answer: Any) -> KeptFence:
    kept = answer.fence
    return KeptFence(
        tuple(map(fence.zone, kept.zones)),
        tuple(map(fence.rally_point, kept.rally_points)),
        kept.is_enabled if kept.is_enabled_known else None,
        next(((each.latitude, each.longitude) for each in kept.return_point), None),
    )
