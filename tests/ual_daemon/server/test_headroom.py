"""Requests while little memory is left: those of the flight are read, others are refused before they are."""

from __future__ import annotations

import itertools
import math
import resource
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import grpc
import pytest

from tests.conftest import LIMIT_S, StartDaemon
from ual.errors import ResourceExhaustedError
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc
from ual_daemon.server.headroom import (
    MOST_REQUEST_BYTES,
    RESERVE_BYTES,
    WORK_FACTOR,
    Headroom,
    limits_of_this_process,
)

READS, PLANS = "/ual.v1.UalService/GetTelemetry", "/ual.v1.UalService/FollowPath"


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class Server:
    without_request_count = 2


def leaving(free_bytes: float) -> Headroom:
    return Headroom(lambda: free_bytes)


def test_a_request_is_read_only_while_one_of_the_greatest_size_leaves_the_reserve() -> None:
    leaving(RESERVE_BYTES + MOST_REQUEST_BYTES).require_room(READS)
    with pytest.raises(ResourceExhaustedError, match=r"17 MB of memory are left .* keeps 13 MB .* may need 4 MB"):
        leaving(RESERVE_BYTES + MOST_REQUEST_BYTES - 1).require_room(READS)


def test_what_others_may_send_meanwhile_is_not_free() -> None:
    headroom = leaving(RESERVE_BYTES + 2 * MOST_REQUEST_BYTES)
    headroom.require_room(READS)
    server = Server()
    headroom.add(server)
    with pytest.raises(ResourceExhaustedError):
        headroom.require_room(READS)


def test_a_large_request_needs_room_for_its_values_and_its_plan() -> None:
    size = 500_000
    leaving(RESERVE_BYTES + WORK_FACTOR * size).require_room_to_work(PLANS, size)
    with pytest.raises(ResourceExhaustedError):
        leaving(RESERVE_BYTES + WORK_FACTOR * size - 1).require_room_to_work(PLANS, size)


def test_two_large_requests_do_not_get_the_same_room() -> None:
    size, clock = 500_000, Clock()
    headroom = Headroom(lambda: RESERVE_BYTES + 1.5 * WORK_FACTOR * size, clock)
    headroom.require_room_to_work(PLANS, size)
    with pytest.raises(ResourceExhaustedError):
        headroom.require_room_to_work(PLANS, size)
    clock.now_s = 5.0  # by now the first has what it needs, or has given it back
    headroom.require_room_to_work(PLANS, size)


def test_small_requests_poll_ten_times_a_second_at_most() -> None:
    looks, clock = itertools.count(), Clock()
    headroom = Headroom(lambda: math.inf * (1 + next(looks)), clock)
    for tick in range(100):
        clock.now_s = tick / 100
        headroom.require_room(READS)
    assert next(looks) == 10


def test_a_large_request_that_has_arrived_is_sought_before_the_next_is_read() -> None:
    free = [RESERVE_BYTES + WORK_FACTOR * MOST_REQUEST_BYTES, RESERVE_BYTES]
    headroom = Headroom(lambda: free[0], Clock())
    headroom.require_room(READS)
    headroom.require_room_to_work(PLANS, MOST_REQUEST_BYTES)
    free.pop(0)
    with pytest.raises(ResourceExhaustedError):
        headroom.require_room(READS)


@pytest.fixture
def group(tmp_path: Path) -> tuple[Path, Callable[[], float]]:
    """A control group of 100 MiB in one without a limit, and what looks at them."""
    cgroups, own = tmp_path / "cgroup", tmp_path / "self"
    inner = cgroups / "ual.slice/uav.service"
    inner.mkdir(parents=True)
    own.mkdir()
    (own / "cgroup").write_text("4:memory:/other\n0::/ual.slice/uav.service\n")
    (cgroups / "ual.slice/memory.max").write_text("max\n")
    (inner / "memory.max").write_text(f"{100 << 20}\n")
    (inner / "memory.current").write_text(f"{90 << 20}\n")
    (inner / "memory.stat").write_text(f"anon {60 << 20}\ninactive_file {30 << 20}\nactive_file 0\n")
    return inner, limits_of_this_process(cgroups, own)


def test_a_control_group_leaves_its_limit_without_what_is_used_but_with_what_is_only_kept_of_files(
    group: tuple[Path, Callable[[], float]],
) -> None:
    assert group[1]() == 40 << 20


def test_a_control_group_that_has_ended_limits_nothing(group: tuple[Path, Callable[[], float]]) -> None:
    (group[0] / "memory.current").unlink()
    assert group[1]() == math.inf


def test_a_process_without_limits_has_room_for_everything(tmp_path: Path) -> None:
    assert limits_of_this_process(tmp_path, tmp_path)() == math.inf


@pytest.mark.skipif(sys.platform != "linux", reason="the limit of a running process is Linux'")
@pytest.mark.usefixtures("started_daemons")
def test_a_daemon_with_30_mb_left_refuses_a_flood_of_large_requests_and_flies_on(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10")
    daemon.wait_for("state", new="LANDED_ARMED")
    stub = ual_pb2_grpc.UalServiceStub(daemon.channel())
    stub.TakeOff(pb.TakeOffRequest(height_m=2.0), timeout=LIMIT_S)
    pages = int(Path(f"/proc/{daemon.pid}/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + 30_000_000
    resource.prlimit(daemon.pid, resource.RLIMIT_AS, (most, most))

    def flood(_: int) -> grpc.StatusCode:
        with grpc.insecure_channel(daemon.address, [("grpc.use_local_subchannel_pool", 1)]) as channel:
            call: Callable[..., bytes] = channel.unary_unary("/ual.v1.UalService/GoToWaypoint")
            try:
                call(b"\x0a\xf0\xff\xff\x01" + bytes((4 << 20) - 16), timeout=LIMIT_S)
            except grpc.RpcError as error:
                code: grpc.StatusCode = error.code()
                return code
        raise AssertionError("such a request was accepted")

    velocity = pb.SetVelocityRequest()
    velocity.velocity.twist.linear.x = 0.1
    with ThreadPoolExecutor(40) as callers:
        floods = callers.map(flood, range(120))
        for _ in range(20):
            stub.SetVelocity(velocity, timeout=LIMIT_S)
        assert grpc.StatusCode.RESOURCE_EXHAUSTED in set(floods)
    stub.Land(pb.LandRequest(), timeout=LIMIT_S)


def test_a_server_that_is_added_while_another_thread_counts_breaks_no_count() -> None:
    headroom = Headroom(lambda: math.inf, lambda: 0.0)
    kept: list[Adding] = []

    class Adding:
        """A reader; another one begins as it is asked."""

        @property
        def without_request_count(self) -> int:
            if len(kept) < 3:
                kept.append(Adding())
                headroom.add(kept[-1])
            return 1

    kept.append(Adding())
    headroom.add(kept[0])
    for _ in range(3):
        headroom.require_room("/ual.v1.UalService/GetInfo")
    assert len(kept) == 3
