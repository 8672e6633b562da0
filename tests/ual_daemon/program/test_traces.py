"""A trace from a client through a daemon to its autopilot's answer: a real client, a real daemon, real OTLP."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from typing_extensions import override

import ual
import ual.aio
from tests.ual_daemon.program.test_imports import start
from tests.waiting import until
from ual import _calls
from ual.errors import WrongStateError
from ual.shared.tracing import Tracing

SERVICE = "ual.v1.UalService"


class Collector:
    """Takes spans by OTLP over HTTP."""

    def __init__(self) -> None:
        self.spans: list[Any] = []
        self.services: set[str] = set()
        collector = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                collector.take(self.rfile.read(int(self.headers["Content-Length"])))
                self.send_response(200)
                self.end_headers()

            @override
            def log_message(self, format: str, *args: object) -> None:
                return None

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def take(self, body: bytes) -> None:
        for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
            names = [each.value.string_value for each in resource.resource.attributes if each.key == "service.name"]
            self.services.update(names)
            self.spans += [span for scope in resource.scope_spans for span in scope.spans]

    def wait_for(self, *names: str) -> list[Any]:
        """The first span of each name, once they have come."""
        until(lambda: set(names) <= {span.name for span in self.spans}, "spans", seen=lambda: [*self.spans])
        return [next(span for span in self.spans if span.name == name) for name in names]

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def collector(monkeypatch: pytest.MonkeyPatch) -> Iterator[Collector]:
    with closing(Collector()) as found:
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", found.url)
        monkeypatch.setenv("OTEL_SERVICE_NAME", "the daemon")
        monkeypatch.setenv("OTEL_BSP_SCHEDULE_DELAY", "50")
        yield found


@contextmanager
def traced_client(monkeypatch: pytest.MonkeyPatch) -> Iterator[InMemorySpanExporter]:
    """The clients of this process are traced, into memory."""
    exporter, provider = InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    found = Tracing(provider)
    monkeypatch.setattr(_calls, "of_environment", lambda: found)
    yield exporter
    provider.shutdown()


@pytest.mark.parametrize("transport", ["core", "aio"])
def test_a_take_off_is_one_trace_to_the_answer_of_the_autopilot(
    transport: str, runtime_dir: Path, collector: Collector, monkeypatch: pytest.MonkeyPatch
) -> None:
    flags = ("--transport", transport, "--auto-arm", "--set", "light.speed_factor=10")
    with closing(start(runtime_dir, "--log-format", "json", *flags)) as daemon, traced_client(monkeypatch) as exported:
        daemon.wait_for("state", new="LANDED_ARMED")
        with ual.Uav(address=daemon.address) as uav:
            uav.take_off(2.0)
        names = (f"{SERVICE}/TakeOff", "task: take_off", "autopilot: take off")
        server, task, command = collector.wait_for(*names)
    client = next(span for span in exported.get_finished_spans() if span.name == names[0])
    context = client.get_span_context()
    assert context is not None
    assert {span.trace_id for span in (server, task, command)} == {context.trace_id.to_bytes(16, "big")}
    assert server.parent_span_id == context.span_id.to_bytes(8, "big")
    assert {task.parent_span_id, command.parent_span_id} == {server.span_id}
    assert command.end_time_unix_nano <= task.end_time_unix_nano
    assert collector.services == {"the daemon"}


def test_a_refusal_is_an_error_on_both_sides(
    runtime_dir: Path, collector: Collector, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(start(runtime_dir)) as daemon, traced_client(monkeypatch) as exported:
        with ual.Uav(address=daemon.address) as uav, pytest.raises(WrongStateError):
            uav.land()
        [server] = collector.wait_for(f"{SERVICE}/Land")
    assert server.status.code == server.status.STATUS_CODE_ERROR
    status = next(each.value.string_value for each in server.attributes if each.key == "rpc.grpc.status")
    assert status == "FAILED_PRECONDITION"
    client = next(span for span in exported.get_finished_spans() if span.name == f"{SERVICE}/Land")
    assert (client.attributes or {})["ual.reason"] == "WRONG_STATE"


async def _add_frame(address: str) -> None:
    async with ual.aio.Uav(address=address) as uav:
        await uav.add_frame(ual.Transform(frame_id="map", child_frame_id="pad"))


def test_the_asyncio_client_is_traced_as_well(
    runtime_dir: Path, collector: Collector, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(start(runtime_dir)) as daemon, traced_client(monkeypatch) as exported:
        asyncio.run(_add_frame(daemon.address))
        [server] = collector.wait_for(f"{SERVICE}/AddFrame")
    [client] = exported.get_finished_spans()
    context = client.get_span_context()
    assert context is not None
    assert server.parent_span_id == context.span_id.to_bytes(8, "big")
