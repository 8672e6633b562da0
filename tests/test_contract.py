"""Generated sources are those of the contract, and its options agree with each other."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract.__main__ import out_of_date
from tools.contract.compiled import compiled, without_options
from tools.contract.description import services
from tools.contract.faces_source import source as faces
from tools.contract.parts import parts
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
