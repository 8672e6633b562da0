"""The rules by which ROS 2 follows from the contract: a new field needs no line, and a forgotten one stops the tool."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorSet

import ual.interface
from tools.contract import ros
from tools.contract.compiled import compiled


@pytest.fixture(scope="module")
def contract() -> FileDescriptorSet:
    return compiled()


def changed(contract: FileDescriptorSet, name: str, change: Callable[[DescriptorProto], object]) -> FileDescriptorSet:
    """The contract with another message of the gripper's file."""
    copy = FileDescriptorSet()
    copy.CopyFrom(contract)
    [file] = [each for each in copy.file if each.name == "ual/v1/gripper.proto"]
    [message] = [each for each in file.message_type if each.name == name]
    change(message)
    return copy


def made(contract: FileDescriptorSet, name: str) -> str:
    [text] = [text for path, text in ros.derived(contract).items() if path.name == name]
    return text


def add(message: DescriptorProto, name: str, kind: FieldDescriptorProto.Type.ValueType) -> None:
    message.field.add(name=name, number=99, type=kind, label=FieldDescriptorProto.LABEL_OPTIONAL)


def rename(message: DescriptorProto, name: str) -> None:
    message.field[0].name = name


def test_a_new_field_is_there_without_its_unit(contract: FileDescriptorSet) -> None:
    with_load = changed(contract, "WinchStatus", lambda it: add(it, "load_n", FieldDescriptorProto.TYPE_DOUBLE))
    assert "float64 load               # N\n" in made(with_load, "WinchStatus.msg")
    assert '"load": value.load_n' in next(text for path, text in ros.derived(with_load).items() if is_of_node(path))


class Juggler:
    """A part of `ual.interface` that is not there."""

    def enable_juggler(self, is_on: bool) -> None:
        """Enables it."""


def test_a_new_service_needs_no_row(contract: FileDescriptorSet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ual.interface, "Juggler", Juggler, raising=False)
    copy = FileDescriptorSet()
    copy.CopyFrom(contract)
    file = copy.file.add(name="ual/v1/juggler.proto", package="ual.v1", syntax="proto3")
    add(file.message_type.add(name="EnableJugglerRequest"), "is_on", FieldDescriptorProto.TYPE_BOOL)
    file.message_type.add(name="EnableJugglerResponse")
    types = (".ual.v1.EnableJugglerRequest", ".ual.v1.EnableJugglerResponse")
    service = file.service.add(name="JugglerService")
    service.method.add(name="EnableJuggler", input_type=types[0], output_type=types[1])
    assert "bool is_on\n---\nbool success" in made(copy, "EnableJuggler.srv")
    assert 'Service("enable_juggler", srv.EnableJuggler, "EnableJuggler")' in made(copy, "services.py")
    assert "await uav.juggler.enable_juggler(is_on=request.is_on)" in made(copy, "calls.py")
    assert "  srv/EnableJuggler.srv\n" in made(copy, "CMakeLists.txt")


def is_of_node(path: Path) -> bool:
    return path.parts[-2:] == ("derived", "values.py")


def test_an_argument_that_ros_cannot_say_stops_the_tool(contract: FileDescriptorSet) -> None:
    with pytest.raises(SystemExit, match=r"Grip: nothing in ROS is the argument gripper of uav\.gripper\.grip"):
        ros.derived(changed(contract, "GripRequest", lambda it: rename(it, "claw")))


def test_what_the_table_names_must_be_in_the_contract(contract: FileDescriptorSet) -> None:
    with pytest.raises(SystemExit, match=r"the contract has not: GetEquipmentResponse\.grippers"):
        ros.derived(changed(contract, "GetEquipmentResponse", lambda it: rename(it, "claws")))


def test_each_interface_says_who_writes_it() -> None:
    for path in ros.files():
        if path.suffix in (".msg", ".srv", ".action"):
            assert "`make proto` writes this file: do not edit" in path.read_text(encoding="utf-8"), path
