from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future

import pytest
from opentelemetry.sdk.trace import ReadableSpan, TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.trace import SpanKind, StatusCode

from tests.waiting import LIMIT_S
from ual.errors import RejectedByAutopilotError, WrongStateError
from ual.shared.tracing import Tracing, end, is_wanted, of_environment


class Traced:
    """Traces that stay in memory."""

    def __init__(self) -> None:
        self._exporter = InMemorySpanExporter()
        provider = TracerProvider()
        provider.add_span_processor(SimpleSpanProcessor(self._exporter))
        self.tracing = Tracing(provider)

    def spans(self) -> dict[str, ReadableSpan]:
        return {span.name: span for span in self._exporter.get_finished_spans()}


@pytest.fixture
def traced() -> Traced:
    return Traced()


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in [name for name in os.environ if name.startswith("OTEL_")]:
        monkeypatch.delenv(name)
    of_environment.cache_clear()
    yield
    of_environment.cache_clear()


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, False),
        ({"UAL_NS": "uav_1"}, False),
        ({"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:4318"}, True),
        ({"OTEL_SERVICE_NAME": "uav_1"}, True),
        ({"OTEL_SERVICE_NAME": "uav_1", "OTEL_SDK_DISABLED": "True"}, False),
        ({"OTEL_SERVICE_NAME": "uav_1", "OTEL_TRACES_EXPORTER": "none"}, False),
    ],
)
def test_the_environment_decides(variables: dict[str, str], expected: bool) -> None:
    assert is_wanted(variables) is expected


def test_without_its_variables_or_its_packages_nothing_is_traced(monkeypatch: pytest.MonkeyPatch) -> None:
    assert of_environment() is None
    of_environment.cache_clear()
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "console")
    monkeypatch.setitem(sys.modules, "opentelemetry.sdk.trace.export", None)
    assert of_environment() is None


def test_with_its_variables_calls_are_traced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "console")
    found = of_environment()
    assert found is not None
    assert found is of_environment()


def test_a_question_begins_no_trace(traced: Traced) -> None:
    with traced.tracing.calling("ual.v1.UalService", "ListFrames") as metadata:
        assert metadata == ()
    span = traced.tracing.answering("/ual.v1.UalService/ListFrames", metadata)
    with traced.tracing.within(span):
        assert traced.tracing.current() is None
    traced.tracing.answered(span, "OK", "")
    assert traced.spans() == {}


def test_a_question_of_a_traced_program_is_a_part_of_its_trace(traced: Traced) -> None:
    with (
        traced.tracing.calling("ual.v1.UalService", "Arm"),
        traced.tracing.calling("ual.v1.UalService", "ListFrames") as metadata,
    ):
        span = traced.tracing.answering("/ual.v1.UalService/ListFrames", metadata)
    traced.tracing.answered(span, "OK", "")
    assert span.get_span_context().trace_id == traced.spans()["ual.v1.UalService/Arm"].context.trace_id
    assert set(traced.spans()) == {"ual.v1.UalService/Arm", "ual.v1.UalService/ListFrames"}


def test_a_call_and_its_answer_are_one_trace(traced: Traced) -> None:
    with traced.tracing.calling("ual.v1.UalService", "Arm") as metadata:
        assert [key for key, _ in metadata] == ["traceparent"]
        span = traced.tracing.answering("/ual.v1.UalService/Arm", metadata)
        traced.tracing.answered(span, "OK", "")
    server, client = traced._exporter.get_finished_spans()
    assert (server.kind, client.kind) == (SpanKind.SERVER, SpanKind.CLIENT)
    assert server.name == client.name == "ual.v1.UalService/Arm"
    assert server.context is not None
    assert client.context is not None
    assert server.parent is not None
    assert (server.context.trace_id, server.parent.span_id) == (client.context.trace_id, client.context.span_id)
    assert dict(server.attributes or {}) == {
        "rpc.system": "grpc",
        "rpc.service": "ual.v1.UalService",
        "rpc.method": "Arm",
        "rpc.grpc.status": "OK",
    }


def test_a_refused_call_has_its_reason(traced: Traced) -> None:
    with pytest.raises(WrongStateError), traced.tracing.calling("ual.v1.UalService", "Land"):
        raise WrongStateError("it stands on the ground")
    [span] = traced.spans().values()
    assert span.status.status_code is StatusCode.ERROR
    assert (span.attributes or {})["ual.reason"] == "WRONG_STATE"


def test_a_command_that_goes_on_elsewhere_belongs_to_its_call(traced: Traced) -> None:
    span = traced.tracing.answering("/ual.v1.UalService/Arm", (("ual-ns", "uav_7"),))
    with traced.tracing.within(span):
        above = traced.tracing.current()
    assert above is not None
    assert traced.tracing.current() is None
    accepted, refused, withdrawn = Future[None](), Future[None](), Future[None]()
    for name, future in {"accepted": accepted, "refused": refused, "withdrawn": withdrawn}.items():
        future.add_done_callback(traced.tracing.begin(name, above, {"ual.task_id": name}))
    accepted.set_result(None)
    refused.set_exception(RejectedByAutopilotError("not now"))
    withdrawn.cancel()
    spans = traced.spans()
    assert {name: span.status.status_code for name, span in spans.items()} == {
        "accepted": StatusCode.UNSET,
        "refused": StatusCode.ERROR,
        "withdrawn": StatusCode.UNSET,
    }
    assert (spans["refused"].attributes or {})["ual.reason"] == "REJECTED_BY_AUTOPILOT"
    assert (spans["withdrawn"].attributes or {})["ual.withdrawn"] is True
    # Each says whose it is, as its call does.
    assert {(each.attributes or {})["ual.ns"] for each in spans.values()} == {"uav_7"}
    assert (spans["refused"].attributes or {})["ual.task_id"] == "refused"
    assert {each.parent.span_id for each in spans.values() if each.parent} == {span.get_span_context().span_id}


def test_a_collector_that_is_stopped_does_not_delay_the_end(caplog: pytest.LogCaptureFixture) -> None:
    sent = threading.Event()
    with caplog.at_level(logging.WARNING):
        end(sent.wait, 0.01)  # waits for ever
    assert "the last spans are lost" in caplog.text
    sent.set()


def test_at_the_end_what_is_left_is_sent() -> None:
    sent = threading.Event()
    end(sent.set, LIMIT_S)
    assert sent.is_set()
