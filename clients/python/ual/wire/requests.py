"""Requests that are not one field for each argument: ``x_request`` makes that of ``X``, ``x_arguments`` reads it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ual.fences.values import FencePlan
from ual.gimbals import GimbalAngles, GimbalReference
from ual.missions import checks
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction
from ual.v1 import fence_pb2, gimbal_pb2, mission_pb2
from ual.wire import fence as wire_fence
from ual.wire import gimbal as wire_gimbal
from ual.wire import mission as wire_mission
from ual.wire import mission_items
from ual.wire.rally_points import rally_point_from_proto, rally_point_to_proto


def set_gimbal_angles_request(
    gimbal: int, pitch_rad: float, yaw_rad: float, roll_rad: float, reference: GimbalReference, frame_id: str
) -> gimbal_pb2.SetGimbalAnglesRequest:
    """Makes the request, which has the angles as a message."""
    return gimbal_pb2.SetGimbalAnglesRequest(
        gimbal=gimbal,
        angles=wire_gimbal.gimbal_angles_to_proto(GimbalAngles(roll_rad, pitch_rad, yaw_rad)),
        reference=wire_gimbal.gimbal_reference_to_proto(reference, "reference"),
        frame_id=frame_id,
    )


def set_gimbal_angles_arguments(request: gimbal_pb2.SetGimbalAnglesRequest) -> dict[str, Any]:
    """Reads it."""
    angles = request.angles
    return {
        "number": request.gimbal,
        "pitch_rad": angles.pitch_rad,
        "yaw_rad": angles.yaw_rad,
        "roll_rad": angles.roll_rad,
        "reference": wire_gimbal.gimbal_reference_from_proto(request.reference, "reference"),
        "frame_id": request.frame_id,
    }


def upload_fence_request(
    plan: FencePlan | None, replace: bool, enable: bool, force: bool
) -> fence_pb2.UploadFenceRequest:
    """Makes the request. Without a plan it is for the configured polygon."""
    request = fence_pb2.UploadFenceRequest(replace=replace, is_only_kept=not enable, force=force)
    if plan is None:
        request.is_configured = True
    else:
        request.zones.extend(map(wire_fence.fence_zone_to_proto, plan.zones))
        request.rally_points.extend(map(rally_point_to_proto, plan.rally_points))
    return request


def upload_fence_arguments(request: fence_pb2.UploadFenceRequest) -> dict[str, Any]:
    """Reads it."""
    plan = FencePlan(
        tuple(map(wire_fence.fence_zone_from_proto, request.zones)),
        tuple(map(rally_point_from_proto, request.rally_points)),
    )
    return {
        "plan": None if request.is_configured else plan,
        "replace": request.replace,
        "enable": not request.is_only_kept,
        "force": request.force,
    }


def plan_mission_request(items: Sequence[Item]) -> mission_pb2.PlanMissionRequest:
    """Makes the request, if the items are not too many."""
    checks.require_count(items)
    return mission_pb2.PlanMissionRequest(items=mission_items.items_to_proto(items))


def plan_mission_arguments(request: mission_pb2.PlanMissionRequest) -> dict[str, Any]:
    """Reads it, if the items are not too many."""
    checks.require_count(request.items)
    return {"items": mission_items.items_from_proto(request.items)}


def upload_mission_request(items: Sequence[Item]) -> mission_pb2.UploadMissionRequest:
    """Makes the request, if the items are not too many."""
    checks.require_count(items)
    return mission_pb2.UploadMissionRequest(items=mission_items.items_to_proto(items))


def upload_mission_arguments(request: mission_pb2.UploadMissionRequest) -> dict[str, Any]:
    """Reads it, if the items are not too many."""
    checks.require_count(request.items)
    return {"items": mission_items.items_from_proto(request.items)}


def start_mission_request(first_item: int, on_link_loss: LinkLossAction | None) -> mission_pb2.StartMissionRequest:
    """Makes the request. Without an action it is for whatever the autopilot's parameters say."""
    if first_item == 0:  # which is none on the wire: it would begin with the first item
        raise ValueError("items are counted from 1")
    action = mission_pb2.LinkLossAction.ValueType(0 if on_link_loss is None else on_link_loss.value)
    return mission_pb2.StartMissionRequest(first_item=first_item, on_link_loss=action)


def start_mission_arguments(request: mission_pb2.StartMissionRequest) -> dict[str, Any]:
    """Reads it."""
    wanted = request.on_link_loss
    action = wire_mission.link_loss_action_from_proto(wanted, "on_link_loss") if wanted else None
    return {"first_item": request.first_item or 1, "on_link_loss": action}
