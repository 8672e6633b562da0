"""Recorded bytes of the contract's messages, in tests/data/wire: what installed programs send, and will understand.

``python -m tests.wire`` (``make wire``) adds records of what is not recorded yet and never changes one that is there.
See docs/reference/compatibility.md.
"""

from __future__ import annotations

import base64
import itertools
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, json_format, message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError, Message

from tests.contract_files import FILES, SERVICES

ROOT = Path(__file__).parents[1]
RECORDS = ROOT / "tests" / "data" / "wire"
BASELINE = ROOT / "proto" / "baseline.binpb"
"""An image of the contract (a FileDescriptorSet, by buf), which it must stay compatible with."""

REMEDY = (
    "Programs that are installed would be misunderstood. Undo it: a field keeps its number, name and type for ever; "
    "a new one takes a new number, and those of one that is deleted are reserved (docs/reference/compatibility.md)."
)

_WELL_KNOWN: dict[str, str] = {
    "google.protobuf.Timestamp": "2026-11-21T09:30:00.250Z",
    "google.protobuf.Duration": "12.250s",
}
_INTEGERS = {
    FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64,
    FieldDescriptor.CPPTYPE_UINT32,
    FieldDescriptor.CPPTYPE_UINT64,
}


@dataclass(frozen=True)
class Record:
    """One message as JSON (proto-JSON, with the contract's field names) and as bytes."""

    method: str
    message: str
    content: dict[str, Any]
    wire: bytes

    @classmethod
    def from_json(cls, entry: dict[str, Any]) -> Record:
        return cls(entry["method"], entry["message"], entry["json"], bytes.fromhex(entry["wire"]))

    def to_json(self) -> dict[str, Any]:
        return {"method": self.method, "message": self.message, "json": self.content, "wire": self.wire.hex()}


def contract_pool() -> DescriptorPool:
    """The contract as it is now."""
    return _pool(descriptor_pb2.FileDescriptorProto.FromString(file.serialized_pb) for file in FILES)


def baseline_pool() -> DescriptorPool:
    """The contract that must be kept."""
    image = descriptor_pb2.FileDescriptorSet.FromString(BASELINE.read_bytes())
    known = {each.name for each in FILES}
    return _pool(file for file in image.file if file.name in known)


def changed_pool(change: Any) -> DescriptorPool:
    """The contract as it would be after ``change`` of the description of ual.proto."""
    files = [descriptor_pb2.FileDescriptorProto.FromString(file.serialized_pb) for file in FILES]
    change(files[0])
    return _pool(files)


def _pool(files: Iterable[descriptor_pb2.FileDescriptorProto]) -> DescriptorPool:
    from google.protobuf import duration_pb2, timestamp_pb2

    pool = DescriptorPool()
    for known in (timestamp_pb2, duration_pb2):
        pool.AddSerializedFile(known.DESCRIPTOR.serialized_pb)  # type: ignore[no-untyped-call]
    for file in files:
        pool.AddSerializedFile(file.SerializeToString())  # type: ignore[no-untyped-call]
    return pool


def _has(pool: DescriptorPool, service: str) -> bool:
    """Returns whether a contract has a service: the baseline lacks those that are newer."""
    try:
        pool.FindServiceByName(service)  # type: ignore[no-untyped-call]
    except KeyError:
        return False
    return True


def read_records(service: str) -> list[Record]:
    """The records of a service's methods."""
    path = _path(service)
    entries = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    return [Record.from_json(entry) for entry in entries]


def problem_of(record: Record, pool: DescriptorPool) -> str:
    """Returns the violation of a record by the contract; empty when all is well."""
    try:
        message_class = message_factory.GetMessageClass(pool.FindMessageTypeByName(record.message))  # type: ignore[no-untyped-call]
    except KeyError:
        return f"{record.message} is gone. {REMEDY}"
    try:
        read = _to_json(message_class.FromString(record.wire))
    except DecodeError as error:
        return f"{record.message}: its recorded bytes can no longer be read ({error}). {REMEDY}"
    if read != record.content:
        return (
            f"{record.message}: its recorded bytes are read as\n  {json.dumps(read)}\nbut they mean\n"
            f"  {json.dumps(record.content)}\nA field has another number, type or name than it had. {REMEDY}"
        )
    try:
        written = _to_bytes(json_format.ParseDict(record.content, message_class()))
    except json_format.ParseError as error:
        return f"{record.message}: a field that it had is gone or renamed ({error}). {REMEDY}"
    if written != record.wire:
        return (
            f"{record.message} is sent as\n  {written.hex()}\nbut installed programs send\n  {record.wire.hex()}\n"
            f"A field has another number or type than it had. {REMEDY}"
        )
    return ""


def unrecorded(pool: DescriptorPool) -> list[str]:
    """Fields (and messages without any) of a contract's requests and responses that no record holds."""
    missing = []
    for service in filter(partial(_has, pool), SERVICES):
        records = read_records(service)
        for method, descriptor in _messages(pool, service):
            seen = _recorded_fields(records, method, descriptor)
            missing += [
                f"{method}: {descriptor.full_name}{path}"
                for path in _fields(descriptor)
                if seen is None or path not in seen
            ]
            if seen is None and not descriptor.fields:
                missing.append(f"{method}: {descriptor.full_name}")
    return missing


def record_what_is_missing() -> None:
    """Adds records of the contract as it is now."""
    pool = contract_pool()
    RECORDS.mkdir(exist_ok=True)
    for service in SERVICES:
        records = read_records(service)
        for method, descriptor in _messages(pool, service):
            message_class = message_factory.GetMessageClass(descriptor)
            for content in _examples(descriptor, itertools.count(1)):
                seen = _recorded_fields(records, method, descriptor)
                if seen is None or not seen.issuperset(_paths_in(content, descriptor)):
                    message = json_format.ParseDict(content, message_class())
                    records.append(Record(method, descriptor.full_name, _to_json(message), _to_bytes(message)))
                    print(f"recorded {descriptor.full_name}")
        entries = [record.to_json() for record in records]
        _path(service).write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


def _path(service: str) -> Path:
    return RECORDS / f"{service}.json"


def _to_json(message: Message) -> dict[str, Any]:
    read: dict[str, Any] = json_format.MessageToDict(message, preserving_proto_field_name=True)
    return read


def _to_bytes(message: Message) -> bytes:
    return message.SerializeToString(deterministic=True)


def _messages(pool: DescriptorPool, service: str) -> Iterator[tuple[str, Descriptor]]:
    for method in pool.FindServiceByName(service).methods:  # type: ignore[no-untyped-call]
        name = f"{service}/{method.name}"
        yield name, method.input_type
        yield name, method.output_type


def _recorded_fields(records: list[Record], method: str, descriptor: Descriptor) -> set[str] | None:
    """The paths of fields that the records of a message set; None without any record of it."""
    its_own = [record for record in records if (record.method, record.message) == (method, descriptor.full_name)]
    if not its_own:
        return None
    return {path for record in its_own for path in _paths_in(record.content, descriptor)}


def _is_opaque(field: FieldDescriptor) -> bool:
    """Returns whether JSON holds the field as one value."""
    if field.message_type is None:
        return True
    return field.message_type.full_name in _WELL_KNOWN or field.message_type.GetOptions().map_entry


def _fields(descriptor: Descriptor, prefix: str = ".") -> Iterator[str]:
    """The paths of all fields, those of messages within included."""
    for field in descriptor.fields:
        yield prefix + field.name
        if not _is_opaque(field):
            yield from _fields(field.message_type, f"{prefix}{field.name}.")


def _paths_in(content: dict[str, Any], descriptor: Descriptor, prefix: str = ".") -> set[str]:
    """The paths of the fields that a message in JSON sets; those that the contract does not know are left out."""
    paths = set()
    for name, value in content.items():
        field = descriptor.fields_by_name.get(name)
        if field is None:
            continue
        paths.add(prefix + name)
        if not _is_opaque(field):
            for each in value if isinstance(value, list) else [value]:
                paths |= _paths_in(each, field.message_type, f"{prefix}{name}.")
    return paths


def _examples(descriptor: Descriptor, numbers: Iterator[int]) -> Iterator[dict[str, Any]]:
    """Messages that set, together, each field, with values that differ: one for each alternative of a oneof."""
    alternatives = [field for oneof in descriptor.oneofs if len(oneof.fields) > 1 for field in oneof.fields]
    plain = [field for field in descriptor.fields if field not in alternatives]
    for chosen in alternatives or [None]:
        deeper = [field for field in descriptor.fields if field in plain or field is chosen]
        # A message within that has alternatives makes one example for each of them.
        variants = [list(_values(field, numbers)) for field in deeper]
        for index in range(max((len(values) for values in variants), default=1)):
            yield {
                field.name: values[min(index, len(values) - 1)] for field, values in zip(deeper, variants, strict=True)
            }


def _values(field: FieldDescriptor, numbers: Iterator[int]) -> Iterator[Any]:
    if field.message_type is not None and field.message_type.GetOptions().map_entry:
        yield {"key": f"{field.name} {next(numbers)}"}
    elif field.message_type is not None and field.message_type.full_name in _WELL_KNOWN:
        yield _WELL_KNOWN[field.message_type.full_name]
    elif field.message_type is not None:
        for content in _examples(field.message_type, numbers):
            yield [content] if field.is_repeated else content
    else:
        yield [_scalar(field, numbers), _scalar(field, numbers)] if field.is_repeated else _scalar(field, numbers)


def _scalar(field: FieldDescriptor, numbers: Iterator[int]) -> Any:
    if field.enum_type is not None:
        values = field.enum_type.values
        return values[1 + next(numbers) % (len(values) - 1)].name
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        return True
    if field.type == FieldDescriptor.TYPE_BYTES:
        return base64.b64encode(f"{field.name} {next(numbers)}".encode()).decode()
    if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        return f"{field.name} {next(numbers)}"
    if field.cpp_type in _INTEGERS:
        return next(numbers)
    return next(numbers) + 0.25


if __name__ == "__main__":
    record_what_is_missing()
