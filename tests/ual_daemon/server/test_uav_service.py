"""The service by itself, without a server: what waits for what."""

from __future__ import annotations

import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from tests.ual_daemon.stepped import stepped
from tests.waiting import LIMIT_S
from ual.errors import TaskAbortedError
from ual.v1 import ual_pb2 as pb
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.server.telemetry_stream import Updates
from ual_daemon.server.uav_service import UalServicer
from ual_daemon.vehicle.prepared import Prepared

WITHOUT_LEASE = SimpleNamespace(lease_id="")


def test_an_abort_gets_through_while_a_path_is_planned_and_the_path_does_not_begin(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with stepped() as uav:
        uav.fly()
        is_planned, may_go_on = threading.Event(), threading.Event()
        prepare = uav.vehicle.commands.prepare

        def slowly(*args: Any, **options: Any) -> Prepared[VehicleTask]:
            prepared = prepare(*args, **options)
            is_planned.set()
            assert may_go_on.wait(LIMIT_S)
            return prepared

        monkeypatch.setattr(uav.vehicle.commands, "prepare", slowly)
        request = pb.FollowPathRequest(non_blocking=True)
        goal = request.waypoints.add().pose.position
        goal.x, goal.z = 9.0, 3.0

        async def run() -> None:
            service = UalServicer(uav.vehicle, Updates(uav.vehicle, lambda _: None))
            path = asyncio.ensure_future(service.FollowPath(request, WITHOUT_LEASE))
            assert await asyncio.to_thread(is_planned.wait, LIMIT_S)
            service.Abort(pb.AbortRequest(), WITHOUT_LEASE)
            may_go_on.set()
            with pytest.raises(TaskAbortedError, match="replaced by abort"):
                await path

        asyncio.run(run())
        uav.run(2.0)
        assert uav.pose.position.x < 0.1
