"""Sends the messages of a stream from the thread that has them.

gRPC's client takes them from an iterator instead, on a thread of its own that is woken for each: 0.08 of a setpoint's
0.5 ms. What is below that, its binding to the core, is not promised to stay as it is; where a gRPC has it otherwise,
there is no direct way, and the iterator is left (docs/decisions/0017).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from google.protobuf.message import Message

Send: TypeAlias = Callable[[Message, Callable[[], None]], bool]
"""Sends a message and tells, on a thread of gRPC, when the next may be sent; False where the stream has ended."""

_NO_FLAGS = 0


def sender(call: Any) -> Send | None:  # noqa: ANN401 (an iterator's future: gRPC has no type for it)
    """What sends in a call that streams, or None where this gRPC has no direct way."""
    try:
        from grpc._cython.cygrpc import SendMessageOperation

        operate = call._call.operate  # noqa: SLF001 (see above)
    except (ImportError, AttributeError):
        return None

    def send(message: Message, then: Callable[[], None]) -> bool:
        def on_sent(_: object) -> bool:
            then()
            return False  # the call goes on

        try:
            return bool(operate((SendMessageOperation(message.SerializeToString(), _NO_FLAGS),), on_sent))
        except ValueError:  # the channel was closed
            return False

    return send
