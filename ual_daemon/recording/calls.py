"""Calls in a recording, as JSON: requests, answers and refusals by the names of the contract."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any, NamedTuple

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import DecodeError, Message

from ual import _rpc_errors
from ual._recording.recorder import Entry, Output
from ual._recording.topics import json_schema, of_json
from ual_daemon.server.call_log import CallRecord

_TEXT = {"type": "string"}
_COUNT = {"type": "integer"}
_OBJECT = {"type": "object"}
CALL_SCHEMA = json_schema(
    "UalCall",
    "A call to the daemon: that it goes on (what ends at once has no such record), or that it has ended.",
    id={**_COUNT, "description": "the same in both records of a call"},
    event={**_TEXT, "enum": ["began", "ended"]},
    method={**_TEXT, "description": "/package.Service/Method"},
    caller={**_TEXT, "description": "its address, as gRPC writes it"},
    agent={**_TEXT, "description": "its program, as it calls itself"},
    request={**_OBJECT, "description": "the first one of a stream"},
    requests_count=_COUNT,
    response={**_OBJECT, "description": "the answer; none for a stream of answers"},
    responses_count=_COUNT,
    status={**_TEXT, "description": "gRPC's status: OK, FAILED_PRECONDITION, CANCELLED, ..."},
    reason={**_TEXT, "description": "the reason of the refusal: WRONG_STATE, GEOFENCE, ..."},
    message={**_TEXT, "description": "the refusal, for people"},
    metadata=_OBJECT,
    duration_s={"type": "number"},
)


class _Types(NamedTuple):
    request: type[Message]
    response: type[Message]


class CallTopic:
    """Writes the calls of one UAV."""

    def __init__(self, ns: str) -> None:
        self._topic = of_json(f"/{ns}/calls", CALL_SCHEMA)

    def write(self, output: Output, entry: Entry) -> None:
        """Writes what was observed of a call. The time of its publication is when it began."""
        call: CallRecord = entry.value
        began_ns = entry.log_ns - (call.at_ns - call.began_ns)
        output.write(self._topic, json.dumps(_to_json(call)).encode(), entry.log_ns, began_ns)


def _to_json(call: CallRecord) -> dict[str, Any]:
    types = _types(call.method)
    values: dict[str, Any] = {
        "id": call.number,
        "event": "ended" if call.has_ended else "began",
        "method": call.method,
        "caller": call.caller,
        "agent": call.agent,
        "request": _message(None if types is None else types.request, call.request),
        "requests_count": call.requests_count,
    }
    if call.has_ended:
        error = _rpc_errors.error_info(call.metadata)
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
    """Returns a packed message as JSON has it; what cannot be read as its number of bytes."""
    if data is None:
        return None
    try:
        if kind is not None:
            return MessageToDict(kind.FromString(data), preserving_proto_field_name=True)
    except (DecodeError, ValueError):
        pass
    return {"unreadable_bytes": len(data)}


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
