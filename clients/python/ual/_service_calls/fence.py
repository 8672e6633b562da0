"""The calls of `ual.interface.Fence`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, built, of, request
from ual._service_calls.by_hand import fence_disable, fence_enable
from ual.fences.values import FencePlan, KeptFence
from ual.shared.flags import flag
from ual.v1 import fence_pb2 as pb
from ual.wire import fence as wire
from ual.wire import requests

enable = fence_enable
disable = fence_disable


def get() -> Call[KeptFence]:
    return of("GetFence", pb.GetFenceRequest(), lambda response: wire.kept_fence_from_proto(response.fence))


def upload(plan: FencePlan | None, replace: bool, enable: bool, force: bool) -> Call[KeptFence]:
    return of(
        "UploadFence",
        built(
            lambda: requests.upload_fence_request(plan=plan, replace=replace, enable=enable, force=force), "plan", plan
        ),
        lambda response: wire.kept_fence_from_proto(response.fence),
    )


def clear(with_rally_points: bool, force: bool) -> Call[KeptFence]:
    return of(
        "ClearFence",
        request(
            pb.ClearFenceRequest,
            with_rally_points=flag(with_rally_points, "with_rally_points"),
            force=flag(force, "force"),
        ),
        lambda response: wire.kept_fence_from_proto(response.fence),
    )
