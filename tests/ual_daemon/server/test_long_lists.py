"""Requests of a few bytes for each of millions of elements, which others would wait for."""

from __future__ import annotations

import asyncio
from typing import Any

import grpc
import pytest
from google.rpc.status_pb2 import Status

from tests.ual_daemon.server.serving import serving
from ual.errors import ResourceExhaustedError
from ual.v1 import fence_pb2, mission_pb2
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors
from ual_daemon.program.recording.call_json import to_json
from ual_daemon.server import dispatch
from ual_daemon.server.call_log import CallRecord
from ual_daemon.server.calls import Calls
from ual_daemon.server.door import MOST_ELEMENTS, has_lists, require_few
from ual_daemon.server.transport.selection import Choice

EMPTY_WAYPOINT, EMPTY_POINT = b"\x0a\x00", b"\x12\x00"


def zones(count: int, points_count: int) -> bytes:
    """Returns a plan of zones with so many empty points each."""
    points = EMPTY_POINT * points_count
    plan = fence_pb2.UploadFenceRequest()
    zone = plan.zones.add()
    zone.MergeFromString(points)
    return plan.SerializeToString() * count


@pytest.mark.parametrize(
    ("kind", "data", "is_refused"),
    [
        (pb.FollowPathRequest, EMPTY_WAYPOINT * MOST_ELEMENTS, False),
        (pb.FollowPathRequest, EMPTY_WAYPOINT * (MOST_ELEMENTS + 1), True),
        (mission_pb2.PlanMissionRequest, EMPTY_WAYPOINT * (2 << 20), True),
        (fence_pb2.UploadFenceRequest, zones(10, 1000), False),
        (fence_pb2.UploadFenceRequest, zones(50, 1000), True),
    ],
)
def test_elements_are_counted_in_all_lists(kind: Any, data: bytes, is_refused: bool) -> None:
    assert has_lists(kind.DESCRIPTOR)
    if is_refused:
        with pytest.raises(ResourceExhaustedError, match=f"{kind.__name__}: its lists have more than {MOST_ELEMENTS}"):
            require_few(kind.FromString(data))
    else:
        require_few(kind.FromString(data))


def test_what_has_no_lists_or_belongs_to_others_is_not_counted() -> None:
    assert not has_lists(pb.SetVelocityRequest.DESCRIPTOR)
    assert not has_lists(Status.DESCRIPTOR)


def test_the_record_of_such_a_call_is_short() -> None:
    """With two million of them it took 8 s and 270 MB of the daemon that had refused the call."""
    request = EMPTY_WAYPOINT * (MOST_ELEMENTS + 1)
    call = CallRecord(1, "/ual.v1.UalService/FollowPath", "", "local", "", 0, 1, True, request, 1)
    found = to_json(call)["request"]
    assert found["unreadable_bytes"] == len(request)
    assert f"more than {MOST_ELEMENTS} elements" in found["why"]


def test_a_request_of_too_many_elements_is_refused_before_each_is_looked_at(
    transport: Choice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two million empty waypoints took 6 s of the thread on which all callers are answered."""
    looked_at: list[object] = []
    monkeypatch.setattr(dispatch, "require_times", lambda request, _: looked_at.append(request))

    def serve(*_: object) -> Any:
        raise AssertionError("it is not to be served")

    async def run() -> None:
        calls = Calls("uav_1", shutdown_refuses=())
        handler = grpc.unary_unary_rpc_method_handler(
            serve, pb.FollowPathRequest.FromString, pb.FollowPathResponse.SerializeToString
        )
        calls.add_registered_method_handlers("ual.v1.UalService", {"FollowPath": handler})
        async with serving(transport, calls) as (channel, _):
            follow: Any = channel.unary_unary("/ual.v1.UalService/FollowPath")
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await follow(EMPTY_WAYPOINT * (MOST_ELEMENTS + 1))
            assert isinstance(rpc_errors.from_rpc_error(caught.value), ResourceExhaustedError)

    asyncio.run(run())
    assert not looked_at
