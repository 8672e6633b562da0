"""The contract stays compatible: recorded bytes read and write as before; buf finds what would break programs."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto

from tests import wire
from tests.contract_files import SERVICES
from tests.wire import Record, read_records

ALL = [record for service in SERVICES for record in read_records(service)]
BUF = wire.ROOT / "tools" / "node_modules" / ".bin" / "buf"


@pytest.mark.parametrize("record", ALL, ids=lambda record: record.message)
def test_recorded_bytes_are_read_and_written_as_ever(record: Record) -> None:
    problem = wire.problem_of(record, wire.contract_pool())
    assert not problem, problem


def test_each_field_of_the_baseline_is_recorded() -> None:
    missing = wire.unrecorded(wire.baseline_pool())
    assert missing == [], "no bytes are recorded of these: make wire"


def take_off(file: FileDescriptorProto) -> tuple[DescriptorProto, FieldDescriptorProto]:
    [message] = [message for message in file.message_type if message.name == "TakeOffRequest"]
    [height] = [field for field in message.field if field.name == "height_m"]
    return message, height


def renumber(file: FileDescriptorProto) -> None:
    take_off(file)[1].number = 99


def retype(file: FileDescriptorProto) -> None:
    take_off(file)[1].type = FieldDescriptorProto.TYPE_FLOAT


def rename(file: FileDescriptorProto) -> None:
    take_off(file)[1].name = "altitude_m"


def delete(file: FileDescriptorProto) -> None:
    message, height = take_off(file)
    message.field.remove(height)


def swap(file: FileDescriptorProto) -> None:
    [vector] = [message for message in file.message_type if message.name == "Vector3"]
    vector.field[0].number, vector.field[1].number = vector.field[1].number, vector.field[0].number


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (renumber, "TakeOffRequest"),
        (retype, "TakeOffRequest"),
        (rename, "TakeOffRequest"),
        (delete, "TakeOffRequest"),
        (swap, "GoToWaypointRequest"),
    ],
)
def test_a_change_that_breaks_programs_is_found_and_explained(
    change: Callable[[FileDescriptorProto], None], message: str
) -> None:
    pool = wire.changed_pool(change)
    problems = [problem for record in ALL if (problem := wire.problem_of(record, pool))]
    assert any(problem.startswith(f"ual.v1.{message}") for problem in problems)
    assert all(wire.REMEDY in problem for problem in problems)


def test_a_new_field_breaks_nothing() -> None:
    def add(file: FileDescriptorProto) -> None:
        take_off(file)[0].field.add(
            name="new", number=99, type=FieldDescriptorProto.TYPE_BOOL, label=FieldDescriptorProto.LABEL_OPTIONAL
        )

    pool = wire.changed_pool(add)
    assert [problem for record in ALL if (problem := wire.problem_of(record, pool))] == []


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("double height_m = 1;", "double height_m = 99;", "height_m"),
        ("double height_m = 1;", "float height_m = 1;", "height_m"),
        ("rpc Land(", "rpc TouchDown(", "Land"),
        ("double height_m = 1;", "double height_m = 1;\n  bool brand_new = 99;", ""),
    ],
    ids=["renumbered", "retyped", "method renamed", "field added"],
)
def test_buf_refuses_what_breaks_programs(old: str, new: str, complaint: str, tmp_path: Path) -> None:
    if not BUF.exists():
        pytest.skip("no buf: make tools/node_modules")
    shutil.copytree(wire.ROOT / "proto", tmp_path / "proto")
    shutil.copy(wire.ROOT / "buf.yaml", tmp_path)
    contract = tmp_path / "proto" / "ual" / "v1" / "ual.proto"
    text = contract.read_text(encoding="utf-8")
    assert old in text
    contract.write_text(text.replace(old, new), encoding="utf-8")
    command = [str(BUF), "breaking", "--against", str(wire.BASELINE)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60.0)
    assert (done.returncode != 0) == bool(complaint), done.stderr
    assert complaint in done.stdout
