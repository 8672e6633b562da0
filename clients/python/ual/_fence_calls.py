"""Every call of `FenceService`; see `ual._calls`. ``make clients`` writes `ual.interface.Fence` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, built, of
from ual.fences.values import FencePlan, KeptFence
from ual.v1 import fence_pb2 as pb
from ual.wire import fences as convert


def get() -> Call[KeptFence]:
    return of("GetFence", pb.GetFenceRequest(), convert.of_response)


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
    return of("UploadFence", request, convert.of_response)


def clear(with_rally_points: bool, force: bool) -> Call[KeptFence]:
    request = built(lambda: pb.ClearFenceRequest(with_rally_points=with_rally_points, force=force), "force", force)
    return of("ClearFence", request, convert.of_response)


def enable() -> Call[KeptFence]:
    return _enable(is_on=True)


def disable() -> Call[KeptFence]:
    return _enable(is_on=False)


def _enable(*, is_on: bool) -> Call[KeptFence]:
    request = pb.EnableFenceRequest(enable=is_on)
    return of("EnableFence", request, convert.of_response)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get": get,
    "upload": upload,
    "clear": clear,
    "enable": enable,
    "disable": disable,
}
"""The members of `ual.interface.Fence`, each with its call."""
