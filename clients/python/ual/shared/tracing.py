"""Traces of calls by OpenTelemetry, where the environment has its variables (``OTEL_…``) and its packages are there.

Nothing of OpenTelemetry is imported otherwise. With each call goes its place in the trace (W3C Trace Context), as
metadata, so that the daemon goes on with it.
"""

from __future__ import annotations

import atexit
import logging
import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ual.contract.method import Kind
from ual.contract.methods import METHODS
from ual.errors import UalError
from ual.shared import extras

if TYPE_CHECKING:
    from opentelemetry.context import Context
    from opentelemetry.trace import Span, TracerProvider

Metadata = Sequence[tuple[str, "str | bytes"]]

_EXPORT_LIMIT_VARIABLE = "OTEL_BSP_EXPORT_TIMEOUT"
"""OpenTelemetry's own, in ms."""
_LAST_EXPORT_S = 2.0
NS_KEY = "ual-ns"
"""The metadata that name the UAV of a call."""
_NS_ATTRIBUTE = "ual.ns"

_log = logging.getLogger(__name__)


def is_wanted(environment: Mapping[str, str] = os.environ) -> bool:
    """Returns whether the environment requests traces: it has a variable of OpenTelemetry, and none of them forbids
    traces.
    """
    if not any(name.startswith("OTEL_") for name in environment):
        return False
    is_off = environment.get("OTEL_SDK_DISABLED", "").strip().lower() == "true"
    return not is_off and environment.get("OTEL_TRACES_EXPORTER", "").strip().lower() != "none"


@lru_cache(maxsize=1)
def of_environment() -> Tracing | None:
    """Returns the traces that the environment requests; None where it does not, or where the packages are missing."""
    if not is_wanted():
        return None
    try:
        with extras.needs("OTEL_…", "ual-client[tracing]"):
            from opentelemetry import trace

            provider = trace.get_tracer_provider()
            if isinstance(provider, trace.ProxyTracerProvider):  # the program has set none
                provider = _provider()
    except UalError as error:
        _log.debug("no traces: %s", error)
        return None
    return Tracing(provider)


def _provider() -> TracerProvider:
    """Returns what exports spans as the variables say. It is not made the program's own."""
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor, ConsoleSpanExporter, SpanExporter

    exporter: SpanExporter
    if os.environ.get("OTEL_TRACES_EXPORTER", "").strip().lower() == "console":
        exporter = ConsoleSpanExporter()
    else:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter

        exporter = OTLPSpanExporter()
    # Its resource is OTEL_SERVICE_NAME and OTEL_RESOURCE_ATTRIBUTES. Its own end would wait as long as its exporter.
    provider = TracerProvider(shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(exporter))
    atexit.register(end, provider.shutdown, _last_export_s())
    return provider


def end(shut_down: Callable[[], object], limit_s: float) -> None:
    """Sends what is left, and waits for it no longer than the limit: a collector may be stopped."""
    sending = threading.Thread(target=shut_down, name="ual last spans", daemon=True)
    sending.start()
    sending.join(limit_s)
    if sending.is_alive():
        _log.warning("the last spans are lost: the collector did not take them within %g s", limit_s)


def _last_export_s() -> float:
    try:
        return float(os.environ[_EXPORT_LIMIT_VARIABLE]) / 1e3
    except (KeyError, ValueError):
        return _LAST_EXPORT_S


class Tracing:
    """Makes the spans of calls, of callers and of servers."""

    def __init__(self, provider: TracerProvider) -> None:
        from opentelemetry import context, propagate, trace

        self._context, self._propagate, self._trace = context, propagate, trace
        self._tracer = provider.get_tracer("ual")

    @contextmanager
    def calling(self, service: str, method: str) -> Iterator[Metadata]:
        """Yields the metadata that go with a call, which ends with the block. An error of the block is the call's.

        A question begins no trace: a program that polls would fill its collector with them.
        """
        if _is_question(service, method) and not self._trace.get_current_span().get_span_context().is_valid:
            yield ()
            return
        attributes = _rpc(service, method)
        kind = self._trace.SpanKind.CLIENT
        with self._tracer.start_as_current_span(f"{service}/{method}", kind=kind, attributes=attributes) as span:
            carrier: dict[str, str] = {}
            self._propagate.inject(carrier)
            try:
                yield tuple(carrier.items())
            except UalError as error:
                span.set_attribute("ual.reason", error.reason)
                raise

    def answering(self, path: str, metadata: Metadata) -> Span:
        """Begins the span of a call that is answered, ``/package.Service/Method``; its caller's, if that has one.

        A question without a traced caller gets a span that is not recorded.
        """
        carrier = {key: value for key, value in metadata if isinstance(value, str)}
        above = self._propagate.extract(carrier, self._context.Context())
        service, _, method = path.lstrip("/").rpartition("/")
        if _is_question(service, method) and not self._trace.get_current_span(above).get_span_context().is_valid:
            return self._trace.INVALID_SPAN
        kind = self._trace.SpanKind.SERVER
        named = {_NS_ATTRIBUTE: carrier[NS_KEY]} if NS_KEY in carrier else {}
        return self._tracer.start_span(path.lstrip("/"), above, kind, _rpc(service, method) | named)

    def answered(self, span: Span, code: str, details: str) -> None:
        """Ends the span of a call that was answered, with gRPC's status."""
        span.set_attribute("rpc.grpc.status", code)
        if code not in ("OK", "CANCELLED"):
            span.set_status(self._trace.StatusCode.ERROR, details)
        span.end()

    @contextmanager
    def within(self, span: Span) -> Iterator[None]:
        """Makes spans that begin in the block parts of the span."""
        with self._trace.use_span(span):
            yield

    def current(self) -> Context | None:
        """Returns the place in a trace of what this thread or task does; None if that is not traced."""
        is_traced = self._trace.get_current_span().get_span_context().is_valid
        return self._context.get_current() if is_traced else None

    def begin(self, name: str, above: object, attributes: Mapping[str, str]) -> Callable[[Future[Any]], None]:
        """Begins a span below the place that `current` has returned. Returns what ends it with a future.

        It names the UAV that the call above names.
        """
        over = self._trace.get_current_span(above)  # type: ignore[arg-type]  # as `current` returned it
        ns = (getattr(over, "attributes", None) or {}).get(_NS_ATTRIBUTE)
        all_attributes = {**attributes, **({} if ns is None else {_NS_ATTRIBUTE: ns})}
        span = self._tracer.start_span(name, above, attributes=all_attributes)  # type: ignore[arg-type]  # as above

        def end(future: Future[Any]) -> None:
            error = None if future.cancelled() else future.exception()
            if future.cancelled():
                span.set_attribute("ual.withdrawn", True)
            if error is not None:
                span.set_attribute("ual.reason", getattr(error, "reason", type(error).__name__))
                span.set_status(self._trace.StatusCode.ERROR, str(error))
            span.end()

        return end


def _is_question(service: str, method: str) -> bool:
    known = METHODS.get(method)
    return known is not None and known.kind is Kind.QUESTION and service == f"ual.v1.{known.service}"


def _rpc(service: str, method: str) -> dict[str, str]:
    return {"rpc.system": "grpc", "rpc.service": service, "rpc.method": method}
