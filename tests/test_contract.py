"""Generated sources are those of the contract, and its options agree with each other."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract import values_source, wire_source
from tools.contract.__main__ import out_of_date
from tools.contract.compiled import compiled, without_options
from tools.contract.description import services
from tools.contract.faces_source import source as faces
from tools.contract.parts import parts
from tools.contract.values import all_values
from ual.access.roles import Role
from ual.contract.method import Kind, Moves
from ual.contract.methods import METHODS


@pytest.fixture(scope="module")
def contract() -> FileDescriptorSet:
    return compiled()


def changed(contract: FileDescriptorSet, name: str, new_name: str, *, without_facts: bool = False) -> FileDescriptorSet:
    """The contract with another method instead of one of the gripper's."""
    copy = FileDescriptorSet()
    copy.CopyFrom(contract)
    [file] = [each for each in copy.file if each.name == "ual/v1/gripper.proto"]
    [method] = [each for each in file.service[0].method if each.name == name]
    method.name = new_name
    if without_facts:
        method.ClearField("options")
    return copy


def test_what_is_derived_is_up_to_date() -> None:
    assert not out_of_date(), "make proto"


def test_each_method_must_say_who_may_call_it(contract: FileDescriptorSet) -> None:
    with pytest.raises(SystemExit, match=r"GripperService\.Throw does not say who may call it"):
        services(changed(contract, "Release", "Throw", without_facts=True))


def test_no_two_methods_have_one_name(contract: FileDescriptorSet) -> None:
    with pytest.raises(SystemExit, match="two methods of the contract are called Abort"):
        services(changed(contract, "Release", "Abort"))


def test_each_method_must_have_a_member_and_each_member_a_behaviour(contract: FileDescriptorSet) -> None:
    with pytest.raises(SystemExit, match=r"ual\.interface\.Gripper has no throw, for GripperService"):
        parts(changed(contract, "Release", "Throw"))
    found = parts(contract)
    [gripper] = [each for each in found if each.name == "Gripper"]
    unserved = replace(gripper, members=[replace(gripper.members[0], name="juggle")])
    with pytest.raises(SystemExit, match=r"services\.gripper\.VehicleGripper has no juggle"):
        faces([unserved])


def test_a_method_that_needs_the_lease_must_take_it(contract: FileDescriptorSet) -> None:
    [gripper] = [each for each in parts(contract) if each.name == "Gripper"]
    for member in gripper.members:
        other = replace(member, needs_lease=not member.needs_lease)
        with pytest.raises(SystemExit, match=rf"^the lease: .*VehicleGripper\.{member.name} takes"):
            faces([replace(gripper, members=[other])])


def test_a_new_field_of_telemetry_needs_its_row_only(contract: FileDescriptorSet) -> None:
    """Derived code writes the fields that change rarely, and reads all fields."""
    copy = FileDescriptorSet()
    copy.CopyFrom(contract)
    [file] = [each for each in copy.file if each.name == "ual/v1/ual.proto"]
    [sample] = [each for each in file.message_type if each.name == "Telemetry"]
    [like] = [each for each in sample.field if each.name == "status_text"]
    [optional] = [each for message in file.message_type for each in message.field if each.name == "link_quality"]
    wind = sample.field.add(name="wind_m_s", number=41, label=like.label, options=like.options)
    wind.type, wind.proto3_optional, wind.oneof_index = optional.type, True, 0
    sample.oneof_decl.add(name="_wind_m_s")
    sample.field.add(name="words", number=42, label=like.label, type=like.type)
    values = all_values(copy)["ual"]
    made = wire_source.source(values)
    assert '    wind_m_s: float | None = None\n    words: str = ""\n' in values_source.source(values)
    assert '"wind_m_s": lambda message: message.wind_m_s if message.HasField("wind_m_s") else None,' in made
    assert "    if value.wind_m_s is not None:\n        message.wind_m_s = value.wind_m_s\n" in made
    assert '"words": lambda message: message.words,' in made
    assert "message.words = value.words" not in made


def test_the_stubs_of_python_import_no_options(contract: FileDescriptorSet) -> None:
    bare = without_options(contract)
    assert {path for file in bare.file for path in file.dependency} <= {file.name for file in bare.file}
    assert not any(method.HasField("options") for file in bare.file for each in file.service for method in each.method)


@pytest.mark.parametrize("name", METHODS)
def test_the_facts_of_a_method_agree_with_each_other(name: str) -> None:
    facts = METHODS[name]
    if facts.moves is not Moves.NOTHING:
        assert facts.needs_lease
        assert facts.stale_after_s < math.inf
    if facts.needs_lease:
        assert facts.role >= Role.PILOT
        assert facts.is_audited
    if facts.role is Role.OBSERVER:
        assert facts.kind in (Kind.QUESTION, Kind.SIMULATION)
    if facts.caller_limit_s is not None and facts.limit_s < math.inf:
        assert facts.limit_s < facts.caller_limit_s, "the daemon must give up before its caller"
    if facts.kind is Kind.STOP:
        assert facts.stale_after_s == math.inf
