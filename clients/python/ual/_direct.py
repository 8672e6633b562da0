"""Sends the messages of a stream from the thread that has them.

gRPC's client takes them from an iterator instead, on a thread of its own that is woken for each: 0.08 of a setpoint's
0.5 ms. What is below that, its binding to the core, is not promised to stay as it is; where a gRPC has it otherwise,
there is no direct way, and the iterator is left (docs/decisions/0017).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from google.protobuf.message import Message

Send: TypeAlias = Callable[[Message, Callable[[], None]], None]
"""Sends a message and tells, on a thread of gRPC, when the next may be sent: never, where the stream has ended."""

_NO_FLAGS = 0


def sender(call: Any) -> Send | None:  # noqa: ANN401 (an iterator's future: gRPC has no type for it)
    """What sends in a call that streams, or None where this gRPC has no direct way.

    As gRPC's own sending thread does it, what is under way stands in the call's `due`. Else the thread that waits for
    the channel's events could end before this one has come, and closing the channel would wait for it for ever.
    """
    try:
        from grpc._cython.cygrpc import OperationType, SendMessageOperation

        operate, state = call._call.operate, call._state  # noqa: SLF001 (see above)
        condition, due = state.condition, state.due
        operation_type = OperationType.send_message
        if not (hasattr(state, "code") and hasattr(state, "cancelled")):
            return None
    except (ImportError, AttributeError):
        return None

    def send(message: Message, then: Callable[[], None]) -> None:
        def on_sent(_: object) -> bool:
            with condition:
                due.discard(operation_type)
                condition.notify_all()
                is_over = not due
            then()
            return is_over

        operation = SendMessageOperation(message.SerializeToString(), _NO_FLAGS)
        with condition:
            if state.code is not None or state.cancelled:
                return
            due.add(operation_type)
            try:
                is_sent = operate((operation,), on_sent)
            except ValueError:  # the channel was closed
                is_sent = False
            if not is_sent:
                due.discard(operation_type)

    return send
