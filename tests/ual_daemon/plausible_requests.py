"""Requests that a sane caller makes, for every method of every service, made from the contract's descriptors."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import grpc
from google.protobuf import message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor, MethodDescriptor
from google.protobuf.message import Message

from tests.contract_files import FILES

METHODS: dict[str, MethodDescriptor] = {
    f"/{service.full_name}/{name}": method
    for file in FILES
    for service in file.services_by_name.values()
    for name, method in service.methods_by_name.items()
    if not (method.client_streaming or method.server_streaming)
}
"""All unary methods by their full names."""
DEFECTS = ("INTERNAL", "UNKNOWN", "DATA_LOSS")
LIMIT_S = 3.0
"""The time limit of a call. Some wait for what never comes here."""
_AT_ONCE = 6
_SKIPPED = frozenset({"/ual.v1.UalService/AcquireLease", "/ual.v1.SimulationService/SetSpeedFactor"})
"""Its holder would keep the other callers out; a speed would make the daemon's time another one."""
_NUMBERS = {"latitude_deg": 47.3978, "longitude_deg": 8.5457, "w": 1.0, "x": 0.0, "y": 0.0, "speed_factor": 1.0}
_TEXTS = {"parameter": "MPC_XY_CRUISE", "name": "MPC_XY_CRUISE", "target_frame_id": "map", "parent_frame_id": "map"}
_STEPS = {"x": 5.0, "y": 5.0, "latitude_deg": 1e-4, "longitude_deg": 1e-4}
_MISSIONS = {
    True: ("take_off", "waypoint", "hold", "speed", "waypoint", "land"),
    False: ("take_off", "waypoint", "heading", "camera_trigger", "waypoint", "return_to_launch"),
}
_NAMED_AFTER_FRAMES = ("frame_id", "source_frame_id")


class RequestFilling(NamedTuple):
    """Filling of a request: bools true or false, and fields that may be left out given or not."""

    is_set: bool
    has_optional: bool


class CallOutcome(NamedTuple):
    """Outcome of one call."""

    method: str
    request: str
    status: str
    details: str


def requests_of(method: MethodDescriptor) -> Iterator[Message]:
    """Yields plausible requests of one method: empty, and with everything, bools and optional fields set or not."""
    yield message_factory.GetMessageClass(method.input_type)()
    for is_set in (True, False):
        for has_optional in (True, False):
            yield _message(method.input_type, RequestFilling(is_set, has_optional))


def call_all(address: str) -> list[CallOutcome]:
    """Calls every method with each of its requests, a few at a time. Returns how each call ended."""
    calls = [(name, each) for name, method in METHODS.items() if name not in _SKIPPED for each in requests_of(method)]
    with grpc.insecure_channel(address) as channel, ThreadPoolExecutor(_AT_ONCE) as pool:
        return list(pool.map(lambda call: _make(channel, *call), calls))


def defects_among(outcomes: list[CallOutcome]) -> list[str]:
    """Returns those that no caller may meet, as text."""
    return sorted({f"{each.method}: {each.status}: {each.details}" for each in outcomes if each.status in DEFECTS})


def _make(channel: grpc.Channel, name: str, request: Message) -> CallOutcome:
    unary = channel.unary_unary(name, type(request).SerializeToString, bytes)
    status, details = "OK", ""
    try:
        unary(request, timeout=LIMIT_S)
    except grpc.RpcError as error:
        status, details = error.code().name, error.details() or ""
    return CallOutcome(name, str(request), status, details)


def _message(kind: Descriptor, how: RequestFilling, choice: str = "") -> Message:
    """Makes a message. Of a oneof it has the field `choice`, or the first one."""
    message: Message = message_factory.GetMessageClass(kind)()
    for field in kind.fields:
        oneof = field.containing_oneof
        is_optional = oneof is not None and len(oneof.fields) == 1
        if is_optional and not how.has_optional:
            continue
        if kind.name == "TakeOffItem" and field.name == "place" and not how.has_optional:
            continue  # one autopilot needs it, another refuses it
        if oneof is not None and not is_optional and field.name != (choice or oneof.fields[0].name):
            continue
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            continue
        _fill(message, field, how)
    return message


def _fill(message: Message, field: FieldDescriptor, how: RequestFilling) -> None:
    value: Any = getattr(message, field.name)
    if field.is_repeated:
        value.extend(_several(field, how))
    elif field.message_type is not None:
        value.SetInParent()
        if not field.message_type.full_name.startswith("google."):  # no time is now, whenever that is
            value.CopyFrom(_message(field.message_type, how))
    else:
        setattr(message, field.name, _scalar(field, is_set=how.is_set))


def _several(field: FieldDescriptor, how: RequestFilling) -> list[Any]:
    """Returns three of a kind; of messages with a choice, one of each. Lists of numbers may be left out."""
    if field.message_type is None:
        return [_scalar(field, is_set=how.is_set)] if how.has_optional else []
    choices = [each.name for oneof in field.message_type.oneofs if len(oneof.fields) > 1 for each in oneof.fields]
    if field.message_type.name == "MissionItem":
        choices = list(_MISSIONS[how.is_set])
    made = [_message(field.message_type, how, each) for each in choices or [""] * 3]
    for number, each in enumerate(made):  # not all at one place, nor in a line
        for name, step in _STEPS.items():
            _move(each, name, step * (number if name in ("x", "latitude_deg") else number % 2))
    return made


def _move(message: Message, name: str, by: float) -> None:
    for field in message.DESCRIPTOR.fields:
        if field.name == name:
            setattr(message, name, getattr(message, name) + by)
        elif _is_part(field) and message.HasField(field.name):
            _move(getattr(message, field.name), name, by)


def _is_part(field: FieldDescriptor) -> bool:
    kind = field.message_type
    return (
        kind is not None and not field.is_repeated and not kind.full_name.startswith(("google.", "ual.v1.Quaternion"))
    )


def _scalar(field: FieldDescriptor, *, is_set: bool) -> Any:
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        return is_set
    if field.enum_type is not None:
        return field.enum_type.values[1 if is_set or len(field.enum_type.values) == 2 else 2].number
    if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        return "" if field.name in _NAMED_AFTER_FRAMES else _TEXTS.get(field.name, "a")
    if field.cpp_type in (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT):
        default = 0.0 if field.containing_type.name == "Quaternion" else 3.0
        return _NUMBERS.get(field.name, default)
    return 1 if field.name in ("item", "first_item", "to", "times", "count") else 0
