"""rosbridge's protocol, version 2: what is sent and received, in JSON and CBOR."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import cbor2
import msgspec

Message = Mapping[str, Any]
"""A ROS message, or the arguments or values of a service, by the names of their fields."""

_LARGEST_FRAGMENTS_BYTES = 16_000_000
_MOST_FRAGMENTED_MESSAGES = 16

_encode = msgspec.json.Encoder().encode
_decode = msgspec.json.Decoder().decode


class OperationError(ValueError):
    """Message that is no operation of rosbridge."""


_JSON_ONLY = frozenset(
    ("Imu", "Log", "NavSatFix", "Odometry", "PoseWithCovarianceStamped", "TwistWithCovarianceStamped")
)
"""rosbridge's CBOR fails for arrays of a fixed length and of texts: the messages are lost, and only its log says so."""


def fits_cbor(kind: str) -> bool:
    """Returns whether rosbridge can send a type in CBOR, as far as it is known."""
    return kind.rsplit("/", 1)[-1] not in _JSON_ONLY


def subscribe(topic: str, kind: str, throttle_ms: int, queue_length: int, *, is_cbor: bool) -> bytes:
    """Returns the operation that subscribes. A bridge that does not know CBOR answers in JSON."""
    compression = "cbor" if is_cbor else "none"
    options = {"throttle_rate": throttle_ms, "queue_length": queue_length, "compression": compression}
    return _encode({"op": "subscribe", "id": topic, "topic": topic, "type": kind, **options})


def unsubscribe(topic: str) -> bytes:
    """Returns the operation that ends a subscription."""
    return _encode({"op": "unsubscribe", "id": topic, "topic": topic})


def advertise(topic: str, kind: str) -> bytes:
    """Returns the operation that announces that we publish."""
    return _encode({"op": "advertise", "id": topic, "topic": topic, "type": kind, "queue_size": 1})


def publish(topic: str, message: Message) -> bytes:
    """Returns the operation that publishes a message."""
    return _encode({"op": "publish", "topic": topic, "msg": message})


def call_service(service: str, arguments: Message, ident: str, timeout_s: float) -> bytes:
    """Returns the operation that calls a service.

    rosbridge of ROS 2 Jazzy and newer waits for so long for the answer (else for 5 s). Others do not read this.
    NaN is written as Python does: rosbridge's JSON reads that, and it refuses a call with null for a number.
    """
    call = {"op": "call_service", "id": ident, "service": service, "args": arguments, "timeout": timeout_s}
    return json.dumps(call).encode()


def decode(data: str | bytes) -> dict[str, Any]:
    """Returns the operation that came: JSON as text, CBOR as bytes.

    Raises:
        OperationError: It is none.
    """
    try:
        operation = cbor2.loads(data) if isinstance(data, bytes) else _decode(data)
    except (ValueError, cbor2.CBORDecodeError, msgspec.DecodeError) as error:
        raise OperationError(f"not decodable: {error}") from error
    if not isinstance(operation, dict) or not isinstance(operation.get("op"), str):
        raise OperationError("no operation")
    return operation


class Fragments:
    """Puts operations together that came in fragments."""

    def __init__(self) -> None:
        self._parts: dict[object, dict[int, str]] = {}

    def add(self, operation: Mapping[str, Any]) -> dict[str, Any] | None:
        """Takes a fragment. Returns the whole operation once all have come.

        Raises:
            OperationError: It is no fragment, or the whole is too large or no operation.
        """
        ident, part, index, total = (operation.get(key) for key in ("id", "data", "num", "total"))
        if not isinstance(part, str) or not isinstance(index, int) or not isinstance(total, (int, float)):
            raise OperationError("a fragment without its number or data")
        parts = self._parts.setdefault(ident, {})
        parts[index] = part
        if sum(map(len, parts.values())) > _LARGEST_FRAGMENTS_BYTES or len(self._parts) > _MOST_FRAGMENTED_MESSAGES:
            self._parts.clear()
            raise OperationError("too many fragments")
        if len(parts) < int(total):
            return None
        del self._parts[ident]
        return decode("".join(parts[each] for each in sorted(parts)))
