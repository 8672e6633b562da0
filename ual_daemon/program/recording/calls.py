"""Calls in a recording, as JSON: requests, answers and refusals by the names of the contract."""

from __future__ import annotations

import json

from ual.recording.recorder import Entry, Output
from ual.recording.topics import json_schema, of_json
from ual_daemon.program.recording.call_json import to_json
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
    identity={**_TEXT, "description": "the name of its token or certificate; local or nobody without either"},
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


class CallTopic:
    """Writes the calls of one UAV."""

    def __init__(self, ns: str) -> None:
        self._topic = of_json(f"/{ns}/calls", CALL_SCHEMA)

    def write(self, output: Output, entry: Entry) -> None:
        """Writes what was observed of a call. The time of its publication is when it began."""
        call: CallRecord = entry.value
        began_ns = entry.log_ns - (call.at_ns - call.began_ns)
        output.write(self._topic, json.dumps(to_json(call)).encode(), entry.log_ns, began_ns)
