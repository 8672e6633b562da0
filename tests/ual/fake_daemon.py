"""A daemon that does what a test tells it: a real gRPC server over scripted answers."""

# ruff: noqa: N802  the names are those of the contract

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import grpc

from ual.errors import UalError
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc as pb_grpc
from ual.wire import rpc_errors


class FakeDaemon(pb_grpc.UalServiceServicer):
    """Answers setpoints and telemetry as a test wants, and keeps what it got."""

    def __init__(self) -> None:
        self.answered: list[pb.SetVelocityRequest | pb.SetPoseRequest] = []
        self.streamed: list[pb.StreamSetpointsRequest] = []
        self.stream_count = 0
        self.is_thawed = threading.Event()
        """Whether it takes setpoints of the stream."""
        self.is_thawed.set()
        self.changed = threading.Condition()
        self.refusal: UalError | None = None
        self.set_home: Callable[[], None] = lambda: None
        self.telemetry: Callable[[], Iterator[pb.StreamTelemetryResponse | None]] = lambda: iter(())
        self.address = ""

    def SetVelocity(self, request: pb.SetVelocityRequest, context: grpc.ServicerContext) -> pb.SetVelocityResponse:
        self._refuse(context)
        self.answered.append(request)
        return pb.SetVelocityResponse()

    def SetPose(self, request: pb.SetPoseRequest, context: grpc.ServicerContext) -> pb.SetPoseResponse:
        self._refuse(context)
        self.answered.append(request)
        return pb.SetPoseResponse()

    def SetHome(self, request: pb.SetHomeRequest, context: grpc.ServicerContext) -> pb.SetHomeResponse:
        del request
        self._refuse(context)
        self.set_home()
        return pb.SetHomeResponse()

    def StreamSetpoints(
        self, requests: Iterator[pb.StreamSetpointsRequest], context: grpc.ServicerContext
    ) -> pb.StreamSetpointsResponse:
        with self.changed:
            self.stream_count += 1
            self.changed.notify_all()
        for request in requests:
            self.is_thawed.wait(30.0)
            with self.changed:
                self._refuse(context)
                self.streamed.append(request)
                self.changed.notify_all()
        return pb.StreamSetpointsResponse()

    def StreamTelemetry(
        self, request: pb.StreamTelemetryRequest, context: grpc.ServicerContext
    ) -> Iterator[pb.StreamTelemetryResponse]:
        del request
        self._refuse(context)
        for response in self.telemetry():
            if not context.is_active():
                return
            if response is not None:
                yield response

    def script(self) -> queue.Queue[pb.StreamTelemetryResponse]:
        """Returns the queue of samples to send from now on."""
        source: queue.Queue[pb.StreamTelemetryResponse] = queue.Queue()

        def telemetry() -> Iterator[pb.StreamTelemetryResponse | None]:
            while True:
                try:
                    yield source.get(timeout=0.02)
                except queue.Empty:
                    yield None  # lets the server see whether anybody still listens

        self.telemetry = telemetry
        return source

    def _refuse(self, context: grpc.ServicerContext) -> None:
        if self.refusal is not None:
            context.abort_with_status(rpc_errors.to_grpc_status(self.refusal))

    def wait_for_streams(self, count: int) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: self.stream_count >= count, 30.0), f"{self.stream_count} came"

    def wait_for_streamed(self, count: int) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: len(self.streamed) >= count, 30.0), f"{len(self.streamed)} came"


def sample(sequence: int, missed_count: int = 0) -> pb.StreamTelemetryResponse:
    """Returns a sample to send."""
    telemetry = pb.Telemetry(state=pb.STATE_FLYING_AUTO, sequence=sequence)
    return pb.StreamTelemetryResponse(telemetry=telemetry, missed_count=missed_count)


@contextmanager
def running() -> Iterator[FakeDaemon]:
    """Serves it for as long as the block runs."""
    daemon = FakeDaemon()  # type: ignore[abstract]
    with ThreadPoolExecutor(8) as pool:
        server = grpc.server(pool)
        pb_grpc.add_UalServiceServicer_to_server(daemon, server)
        daemon.address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
        server.start()
        try:
            yield daemon
        finally:
            server.stop(None).wait()
