"""Traces calls: each has a span, below that of its caller, and what it begins belongs to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from typing_extensions import override

from ual.shared.tracing import Tracing
from ual_daemon.server.call_log import CallRecord, ObservedCall
from ual_daemon.server.transport.base import ServedCall


def traced(take: Callable[[ServedCall], None], tracing: Tracing) -> Callable[[ServedCall], None]:
    """Returns what takes calls in the place of `take`, and traces each of them."""
    return lambda call: take(TracedCall(call, tracing))


class TracedCall(ObservedCall):
    """A call that is traced, from its first request to its end."""

    def __init__(self, call: ServedCall, tracing: Tracing) -> None:
        super().__init__(call, ())
        self._tracing = tracing
        self._span: Any = None  # OpenTelemetry's, whose packages need not be there

    @override
    def _on_message(self, then: Callable[[bytes | None], object], message: bytes | None) -> None:
        if message is None or self._span is not None:
            super()._on_message(then, message)
            return
        self._span = self._tracing.answering(self.method, self.metadata)
        with self._tracing.within(self._span):
            super()._on_message(then, message)

    @override
    def _observe(self, record: CallRecord) -> None:
        if record.has_ended and self._span is not None:
            self._tracing.answered(self._span, record.code, record.details)
