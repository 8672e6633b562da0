"""Attacks by calls, through gRPC's own client: ``python -m benchmarks.attacks.calls NAME HOST:PORT --rate 1000``.

Each attack is a function of a `AttackTarget`; many threads call it again and again. What a call is answered does not
matter.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import grpc

from benchmarks.attacks.attacker import Pace, stop_at_end_of_input
from ual.v1 import ual_pb2 as pb

_SERVICE = "/ual.v1.UalService/"
_LIMIT_S = 20.0
_CORNERS = 10_000
_LEVELS = 32
_MOST_BYTES = 4 << 20
_NAMES = tuple(method.name for method in pb.DESCRIPTOR.services_by_name["UalService"].methods if method.name != "Land")
"""Without the one that lands the UAV, as every client of the port may: an empty request is a valid one."""


class AttackTarget:
    """The daemon, and what an attack needs to call it. One for each thread."""

    def __init__(self, address: str, seed: int) -> None:
        # Without this all channels of a process to one address share a connection.
        options = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_send_message_length", -1)]
        self.channel = grpc.insecure_channel(address, options=options)
        self.random = random.Random(seed)
        self.seed = seed
        self.open: list[Any] = []

    def call(self, method: str, request: bytes, metadata: Any = ()) -> bytes:  # noqa: ANN401
        answer: bytes = self.channel.unary_unary(_full(method), _same, _same)(
            request, timeout=_LIMIT_S, metadata=metadata
        )
        return answer


def _full(method: str) -> str:
    return method if method.startswith("/") else _SERVICE + method


def _same(data: bytes) -> bytes:
    return data


def _path(corners_count: int) -> bytes:
    """A path that winds, so that no corner can be left out."""
    waypoints = [
        pb.PoseStamped(
            pose=pb.Pose(
                position=pb.Vector3(
                    x=30.0 * math.cos(0.1 * number), y=30.0 * math.sin(0.1 * number), z=5.0 + number % 2
                )
            )
        )
        for number in range(corners_count)
    ]
    return pb.FollowPathRequest(waypoints=waypoints, corner_radius_m=0.5, dry_run=True).SerializeToString()


_LONG_PATH = _path(_CORNERS)


def dry_run_paths(target: AttackTarget) -> None:
    """Asks what a path of 10,000 corners would be."""
    target.call("FollowPath", _LONG_PATH)


def frame_chain(target: AttackTarget) -> None:
    """Makes a chain of frames as long as it may be, and asks again and again for positions at its end."""
    names = [f"attack_{target.seed}_{level}" for level in range(_LEVELS)]
    for parent, child in itertools.pairwise(["map", *names]):
        request = pb.AddFrameRequest()
        request.transform.header.frame_id, request.transform.child_frame_id = parent, child
        request.transform.translation.x, request.transform.rotation.w = 0.1, 1.0
        with suppress(grpc.RpcError):
            target.call("AddFrame", request.SerializeToString())
    end = pb.GoToWaypointRequest(dry_run=True)
    end.waypoint.header.frame_id = names[target.random.randrange(_LEVELS)]
    end.waypoint.pose.position.z = 5.0
    target.call("GoToWaypoint", end.SerializeToString())


def unary_flood(target: AttackTarget) -> None:
    """Reads the telemetry, by a call each time."""
    target.call("GetTelemetry", b"")


def refused_flood(target: AttackTarget) -> None:
    """Commands what is refused, and logged, in other words each time."""
    request = pb.TakeOffRequest(height_m=-target.random.random(), non_blocking=True)
    target.call("TakeOff", request.SerializeToString())


def stream_flood(target: AttackTarget) -> None:
    """Subscribes to every sample, and stays; beyond the limit on streams it is refused."""
    stream = target.channel.unary_stream(_full("StreamTelemetry"), _same, _same)(b"", timeout=_LIMIT_S)
    target.open = [*target.open[-20:], stream]
    next(stream)


def stream_churn(target: AttackTarget) -> None:
    """Subscribes, and leaves after the first sample."""
    stream = target.channel.unary_stream(_full("StreamTelemetry"), _same, _same)(b"", timeout=_LIMIT_S)
    next(stream)
    stream.cancel()


def task_flood(target: AttackTarget) -> None:
    """Commands one go-to after the other, each of which replaces the one before, and watches it."""
    request = pb.GoToWaypointRequest(non_blocking=True)
    request.waypoint.pose.position.x, request.waypoint.pose.position.z = target.random.uniform(-5.0, 5.0), 5.0
    task = pb.GoToWaypointResponse.FromString(target.call("GoToWaypoint", request.SerializeToString())).task
    watch = target.channel.unary_stream(_full("WatchTask"), _same, _same)
    next(watch(pb.WatchTaskRequest(task_id=task.id).SerializeToString(), timeout=_LIMIT_S))


def no_request(target: AttackTarget) -> None:
    """Begins a call and does not send its request, as a broken client does; many are left open."""

    def silence() -> Iterator[bytes]:
        time.sleep(2.0)
        yield from ()

    call = target.channel.stream_unary(_full(target.random.choice(_NAMES)), _same, _same)
    target.open = [*target.open[-50:], call.future(silence(), timeout=2.0)]


def oversized(target: AttackTarget) -> None:
    """Sends a message that is larger than the limit."""
    target.call("FollowPath", bytes(_MOST_BYTES + 1))


def large(target: AttackTarget) -> None:
    """Sends the largest message that is taken: names of frames of 4 MiB in all."""
    request = pb.AddFrameRequest()
    request.transform.child_frame_id = "x" * (_MOST_BYTES - 100)
    target.call("AddFrame", request.SerializeToString())


def fuzzed(target: AttackTarget) -> None:
    """Sends random bytes to any method, with wild metadata."""
    metadata = [("ual-ns", "uav_1"), (f"x-{target.random.randrange(1000)}", "y" * target.random.randrange(2000))]
    name = target.random.choice((*_NAMES, "NoSuchMethod"))
    target.call(name, target.random.randbytes(target.random.randrange(200)), metadata)


ATTACKS: dict[str, tuple[Callable[[AttackTarget], None], int]] = {
    dry_run_paths.__name__: (dry_run_paths, 30),
    frame_chain.__name__: (frame_chain, 6),
    unary_flood.__name__: (unary_flood, 8),
    refused_flood.__name__: (refused_flood, 8),
    stream_flood.__name__: (stream_flood, 8),
    stream_churn.__name__: (stream_churn, 8),
    task_flood.__name__: (task_flood, 8),
    no_request.__name__: (no_request, 8),
    oversized.__name__: (oversized, 4),
    large.__name__: (large, 4),
    fuzzed.__name__: (fuzzed, 8),
}
"""Each attack, and how many threads of the attacker make it, each with a connection of its own."""


def _try(action: Callable[[], object]) -> None:
    try:
        action()
    except (grpc.RpcError, ValueError):
        return


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attacks.calls", description=__doc__)
    parser.add_argument("attack", choices=ATTACKS)
    parser.add_argument("address")
    parser.add_argument("--rate", type=float, default=0.0, help="at most so many calls a second; 0: as many as go")
    arguments = parser.parse_args()
    attack, threads_count = ATTACKS[arguments.attack]
    stop, pace = stop_at_end_of_input(), Pace(arguments.rate)
    counts = [0] * threads_count

    def work(number: int) -> None:
        target = AttackTarget(arguments.address, number)
        while not stop.is_set():
            pace.wait()
            _try(lambda: attack(target))
            counts[number] += 1

    for number in range(threads_count):
        threading.Thread(target=work, args=(number,), daemon=True).start()
    stop.wait()
    print(sum(counts), flush=True)
    sys.stdout.close()
    sys.stdin.close()


if __name__ == "__main__":
    main()
