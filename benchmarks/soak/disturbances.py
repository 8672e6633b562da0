"""Disturbances by other callers during a flight: they come and go, are cut off, and ask for the impossible."""

from __future__ import annotations

import contextlib
import math
import random
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import grpc

import ual
from benchmarks.soak.proxy import Proxy
from benchmarks.soak.tally import Tally
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Transform, Twist, Vector3
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc as pb_grpc

_PERIOD_S = 0.25
_LIMIT_S = 10.0
_SERVICE = "/ual.v1.UalService/"
_MOST_BYTES = 4 << 20
_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
_NO_FRAME = "nowhere"
_OVERSIZED_SHARE = 0.05
"""Of the calls that may be oversized: 5 MiB cost both sides much."""


class Disturbances:
    """Does one of them every `_PERIOD_S`, in an order left to chance, until it is stopped."""

    def __init__(self, address: str, tally: Tally, seed: int, stopped: threading.Event) -> None:
        self._address = address
        self._tally = tally
        self._random = random.Random(seed)
        self._stopped = stopped

    def run(self) -> None:
        kinds: list[Callable[[], object]] = [
            self._ask,
            self._leave_during_stream,
            self._be_cut_off,
            self._be_refused,
            self._be_refused_a_stream,
            self._call_wrong_method,
            self._send_wrong_bytes,
            self._send_wild_metadata,
            self._send_garbage,
            self._fill_frames,
        ]
        while not self._stopped.wait(_PERIOD_S):
            kind = self._random.choice(kinds)
            self._tally.attempt(kind.__name__.strip("_"), kind)

    def _ask(self) -> None:
        with ual.Uav(address=self._address) as uav:
            uav.info()
            uav.telemetry()
            uav.frames()

    def _leave_during_stream(self) -> None:
        with ual.Uav(address=self._address) as uav, uav.subscribe(lambda _: None, self._random.choice((0.0, 20.0))):
            self._stopped.wait(self._random.uniform(0.0, 0.5))

    def _be_cut_off(self) -> None:
        with Proxy(self._address) as proxy, grpc.insecure_channel(proxy.address) as channel:
            stub = pb_grpc.UalServiceStub(channel)
            samples = stub.StreamTelemetry(pb.StreamTelemetryRequest(), timeout=_LIMIT_S)
            next(samples)
            stub.StreamSetpoints.future(self._silence(), timeout=_LIMIT_S)
            self._stopped.wait(self._random.uniform(0.0, 0.3))

    def _silence(self) -> Iterator[pb.StreamSetpointsRequest]:
        self._stopped.wait(0.2)
        yield from ()

    def _be_refused(self) -> None:
        """None of these moves the UAV, whatever its state is."""
        far, nan = Pose.at(1e5, 0.0, 3.0), math.nan
        with ual.Uav(address=self._address) as uav:
            loop = Transform(frame_id=f"{uav.ns}/base_link", child_frame_id="map")
            refusals: list[Callable[[], object]] = [
                lambda: uav.take_off(-1.0, blocking=False),
                lambda: uav.take_off(1e9, blocking=False),
                lambda: uav.go_to_waypoint(far, blocking=False),
                lambda: uav.go_to_waypoint(Pose.at(nan, 0.0, 3.0), blocking=False),
                lambda: uav.go_to_waypoint(PoseStamped(Pose.at(0.0, 0.0, 3.0), _NO_FRAME), blocking=False),
                lambda: uav.go_to_waypoint_geo(1e3, 0.0, 3.0, blocking=False),
                lambda: uav.follow_path([], blocking=False),
                lambda: uav.follow_path([far] * 50, blocking=False),
                lambda: uav.set_velocity(Twist(Vector3(nan, 0.0, 0.0))),
                lambda: uav.add_frame(loop),
                lambda: uav.add_frame(Transform(frame_id=_NO_FRAME, child_frame_id="x" * 10_000)),
                lambda: uav.remove_frame(_NO_FRAME),
                lambda: uav.transform(_NO_FRAME),
                lambda: uav.task(f"task-{self._random.random()}"),
                lambda: uav.dry_run.take_off(3.0),
                lambda: uav.dry_run.follow_path([far] * 500),
            ]
            self._random.choice(refusals)()

    def _be_refused_a_stream(self) -> None:
        with self._stub() as stub:
            requests = iter([pb.StreamSetpointsRequest()])
            stub.StreamSetpoints(requests, timeout=_LIMIT_S)

    def _call_wrong_method(self) -> None:
        with grpc.insecure_channel(self._address) as channel:
            name = f"/{'x' * self._random.randrange(1, 2000)}/{self._random.random()}"
            self._call(channel, name, b"")

    def _send_wrong_bytes(self) -> None:
        size = self._random.randrange(300)
        if self._random.random() < _OVERSIZED_SHARE:
            size = _MOST_BYTES + 1
        with grpc.insecure_channel(self._address) as channel:
            method = self._random.choice(("GoToWaypoint", "AddFrame", "SetVelocity", "FollowPath", "StreamTelemetry"))
            self._call(channel, _SERVICE + method, self._random.randbytes(size))

    def _send_wild_metadata(self) -> None:
        metadata = [("ual-ns", "another"), ("x" * 50, "y" * self._random.randrange(4000)), ("b-bin", b"\0\xff")]
        with grpc.insecure_channel(self._address) as channel:
            self._call(channel, _SERVICE + "GetInfo", b"", metadata[self._random.randrange(3) :])

    def _call(self, channel: grpc.Channel, method: str, data: bytes, metadata: Any = ()) -> None:  # noqa: ANN401
        channel.unary_unary(method, _as_it_is, _as_it_is)(data, timeout=_LIMIT_S, metadata=metadata)

    def _send_garbage(self) -> None:
        host, port = self._address.rsplit(":", 1)
        with socket.create_connection((host, int(port)), _LIMIT_S) as end, contextlib.suppress(OSError):
            end.sendall(self._random.choice((b"", _PREFACE)) + self._random.randbytes(self._random.randrange(2000)))
            end.settimeout(0.2)
            end.recv(65536)
            if self._random.random() < 0.5:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    def _fill_frames(self) -> None:
        """Adds frames until it is refused, and removes them."""
        with ual.Uav(address=self._address) as uav:
            names = [f"{uav.ns}/f{self._random.randrange(10_000)}_{number}" for number in range(30)]
            parent = "map"
            added = []
            with contextlib.suppress(UalError):
                for name in names:
                    uav.add_frame(Transform(Vector3(0.1, 0.0, 0.0), frame_id=parent, child_frame_id=name))
                    added.append(name)
                    parent = name
            for name in reversed(added):
                uav.remove_frame(name)

    @contextmanager
    def _stub(self) -> Iterator[pb_grpc.UalServiceStub]:
        with grpc.insecure_channel(self._address) as channel:
            yield pb_grpc.UalServiceStub(channel)


def _as_it_is(data: bytes) -> bytes:
    return data
