"""The comments of the contract, by what they are about."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from google.protobuf.descriptor_pb2 import DescriptorProto, EnumDescriptorProto, FileDescriptorProto

_MESSAGE, _ENUM, _SERVICE, _SYNTAX = 4, 5, 6, 12
_FIELD, _NUMBER, _METHOD = 2, 2, 2


def comments(file: FileDescriptorProto) -> Mapping[str, str]:
    """Returns the comments by what they are above: ``Gripper``, ``Gripper.name``, ``GripperService.Grip``.

    That of the file has no name.
    """
    found = {tuple(each.path): each.leading_comments for each in file.source_code_info.location}
    return {name: found.get(path, "") for path, name in _paths(file)} | {"": found.get((_SYNTAX,), "")}


def _paths(file: FileDescriptorProto) -> Iterator[tuple[tuple[int, ...], str]]:
    for index, message in enumerate(file.message_type):
        yield from _inside((_MESSAGE, index), message.name, _FIELD, message)
    for index, enum in enumerate(file.enum_type):
        yield from _inside((_ENUM, index), enum.name, _NUMBER, enum)
    for index, service in enumerate(file.service):
        yield (_SERVICE, index), service.name
        for number, method in enumerate(service.method):
            yield (_SERVICE, index, _METHOD, number), f"{service.name}.{method.name}"


def _inside(
    path: tuple[int, int], name: str, kind: int, owner: DescriptorProto | EnumDescriptorProto
) -> Iterator[tuple[tuple[int, ...], str]]:
    yield path, name
    parts = [each.name for each in (owner.field if isinstance(owner, DescriptorProto) else owner.value)]
    for number, part in enumerate(parts):
        yield (*path, kind, number), f"{name}.{part}"
