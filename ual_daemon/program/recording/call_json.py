"""Calls as JSON: requests, answers and refusals by the names of the contract."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message

from ual.shared import guard
from ual.wire import rpc_errors
from ual_daemon.server.call_log import CallRecord
from ual_daemon.server.door import require_few

_SECRETS = frozenset({"lease_id"})


class _Types(NamedTuple):
    request: type[Message]
    response: type[Message]


def to_json(call: CallRecord) -> dict[str, Any]:
    """Returns what was observed of a call."""
    types = _types(call.method)
    values: dict[str, Any] = {
        "id": call.number,
        "event": "ended" if call.has_ended else "began",
        "method": call.method,
        "caller": call.caller,
        "identity": call.identity,
        "agent": call.agent,
        "request": _message(None if types is None else types.request, call.request),
        "requests_count": call.requests_count,
    }
    if call.has_ended:
        error = rpc_errors.error_info(call.metadata)
        values |= {
            "response": _message(None if types is None else types.response, call.response),
            "responses_count": call.responses_count,
            "status": call.code,
            "reason": "" if error is None else error.reason,
            "message": call.details,
            "metadata": {} if error is None else dict(error.metadata),
            "duration_s": (call.at_ns - call.began_ns) * 1e-9,
        }
    return {name: value for name, value in values.items() if value is not None}


def _message(kind: type[Message] | None, data: bytes | None) -> dict[str, Any] | None:
    """Returns a packed message as JSON has it; what JSON cannot express as its number of bytes, and why."""
    if data is None:
        return None
    try:
        if kind is not None:
            message = kind.FromString(data)
            require_few(message)  # one that was refused for that is recorded, too
            return _without_secrets(MessageToDict(message, preserving_proto_field_name=True))
    except Exception as error:  # noqa: BLE001  a caller chose the bytes, and protobuf raises errors of many kinds
        return {"unreadable_bytes": len(data), "why": guard.cause(error)}
    return {"unreadable_bytes": len(data)}


def _without_secrets(message: dict[str, Any]) -> dict[str, Any]:
    """Returns a message without the identifier of a lease: a reader of the file must not be able to fly by it."""
    return {name: "(secret)" if name in _SECRETS else value for name, value in message.items()}


@lru_cache(maxsize=256)
def _types(method: str) -> _Types | None:
    """Returns the messages of a method; None for one that no loaded contract has."""
    service, _, name = method.lstrip("/").partition("/")
    try:
        pool = descriptor_pool.Default()  # type: ignore[no-untyped-call]
        found = pool.FindServiceByName(service).methods_by_name[name]
    except KeyError:
        return None
    make = message_factory.GetMessageClass
    return _Types(make(found.input_type), make(found.output_type))
