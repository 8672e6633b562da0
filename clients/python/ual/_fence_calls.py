"""Every call of `FenceService`; see `ual._calls`. ``make clients`` writes `ual.interface.Fence` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, Service, built
from ual.fences.values import FencePlan, KeptFence
from ual.v1 import fence_pb2 as pb
from ual.wire import fences as convert

LIMIT_S = 930.0
"""How long a call may take over a bad link: the daemon gives up before."""
_NOT_KNOWN = "it is not known what the autopilot has now: read it"


def get() -> Call[KeptFence]:
    return Call(Service.FENCE, "GetFence", pb.GetFenceRequest(), convert.of_response, LIMIT_S)


def upload(plan: FencePlan | None, replace: bool, enable: bool, force: bool) -> Call[KeptFence]:
    def make() -> pb.UploadFenceRequest:
        request = pb.UploadFenceRequest(replace=replace, is_only_kept=not enable, force=force)
        if plan is None:
            request.is_configured = True
        else:
            request.zones.extend(convert.zones_to_proto(plan.zones))
            request.rally_points.extend(convert.rally_to_proto(plan.rally_points))
        return request

    request = built(make, "plan", plan)
    return Call(Service.FENCE, "UploadFence", request, convert.of_response, LIMIT_S, _NOT_KNOWN)


def clear(with_rally_points: bool, force: bool) -> Call[KeptFence]:
    request = built(lambda: pb.ClearFenceRequest(with_rally_points=with_rally_points, force=force), "force", force)
    return Call(Service.FENCE, "ClearFence", request, convert.of_response, LIMIT_S, _NOT_KNOWN)


def enable() -> Call[KeptFence]:
    return _enable(is_on=True)


def disable() -> Call[KeptFence]:
    return _enable(is_on=False)


def _enable(*, is_on: bool) -> Call[KeptFence]:
    request = pb.EnableFenceRequest(enable=is_on)
    return Call(Service.FENCE, "EnableFence", request, convert.of_response, LIMIT_S, _NOT_KNOWN)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get": get,
    "upload": upload,
    "clear": clear,
    "enable": enable,
    "disable": disable,
}
"""The members of `ual.interface.Fence`, each with its call."""
