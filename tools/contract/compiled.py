"""The contract as protoc reads it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from google.protobuf.descriptor_pb2 import DescriptorProto, FileDescriptorProto, FileDescriptorSet
from grpc_tools import protoc  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[2]
PROTO = ROOT / "proto"
OPTIONS = "ual/v1/options.proto"
_WELL_KNOWN = Path(protoc.__file__).parent / "_proto"


def contract_files() -> list[str]:
    """Returns the files that have messages and services, as they import each other."""
    found = sorted(path.relative_to(PROTO).as_posix() for path in (PROTO / "ual" / "v1").glob("*.proto"))
    return [path for path in found if path != OPTIONS]


def compiled(files: Sequence[str] = (), room: Path = PROTO) -> FileDescriptorSet:
    """Returns the contract with its options and comments, and all that it imports.

    `files` are those of another contract, in its `room`, which may import the options of this one.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "contract.binpb"
        paths = [f"--proto_path={each}" for each in dict.fromkeys((room, PROTO, _WELL_KNOWN))]
        image = (f"--descriptor_set_out={file}", "--include_imports", "--include_source_info")
        run_protoc(*paths, *image, *(files or contract_files()))
        return FileDescriptorSet.FromString(file.read_bytes())


def without_options(contract: FileDescriptorSet) -> FileDescriptorSet:
    """Returns the contract without what only this repository's tools read.

    So the stubs of Python import no more than messages and services: descriptor_pb2 takes 1.2 ms, and memory.
    """
    bare = FileDescriptorSet()
    bare.CopyFrom(contract)
    kept = [file for file in bare.file if file.name not in (OPTIONS, "google/protobuf/descriptor.proto")]
    for file in kept:
        _remove_options(file)
    return FileDescriptorSet(file=kept)


def _remove_options(file: FileDescriptorProto) -> None:
    if OPTIONS in file.dependency:
        file.dependency.remove(OPTIONS)
    for message in file.message_type:
        _remove_options_of(message)
    for enum in file.enum_type:
        enum.ClearField("options")
    for service in file.service:
        service.ClearField("options")
        for method in service.method:
            method.ClearField("options")


def _remove_options_of(message: DescriptorProto) -> None:
    """Removes those of a message, and the names that protoc adds to each field; the contract names none."""
    if not message.options.map_entry:  # which is no option of ours, but what makes a map of it
        message.ClearField("options")
    for field in message.field:
        field.ClearField("json_name")
        field.ClearField("options")
    for nested in message.nested_type:
        _remove_options_of(nested)


def run_protoc(*arguments: str) -> None:
    """Runs protoc.

    Raises:
        SystemExit: It refuses the contract; it has said why.

    """
    if protoc.main(["protoc", *arguments]):
        raise SystemExit("protoc refuses the contract")
