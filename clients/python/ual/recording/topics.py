"""Topics of a recording: the name of a series of messages, and the schema by which other programs read them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from google.protobuf.message import Message

PROTOBUF = "protobuf"
JSON = "json"


@dataclass(frozen=True, slots=True)
class Schema:
    """Encoding of messages: in MCAP's terms the schema's name, its encoding, and its text or descriptors."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True, eq=False)
class Topic:
    """One series of messages. `schema` is None where `encoding` says all."""

    name: str
    encoding: str
    schema: Schema | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


def of_protobuf(name: str, kind: type[Message]) -> Topic:
    """Returns a topic of messages of a protobuf type."""
    return Topic(name, PROTOBUF, protobuf_schema(kind))


def of_json(name: str, schema: Schema) -> Topic:
    """Returns a topic of JSON objects."""
    return Topic(name, JSON, schema)


def protobuf_schema(kind: type[Message]) -> Schema:
    """Returns the schema of a protobuf type, with the files that it needs."""
    from mcap_protobuf.schema import build_file_descriptor_set

    return Schema(kind.DESCRIPTOR.full_name, PROTOBUF, build_file_descriptor_set(kind).SerializeToString())


def json_schema(name: str, description: str, **properties: Mapping[str, Any]) -> Schema:
    """Returns the JSON schema of an object with these properties."""
    text = {"title": name, "description": description, "type": "object", "properties": properties}
    return Schema(name, "jsonschema", json.dumps(text).encode())
