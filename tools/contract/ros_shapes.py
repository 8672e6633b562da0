"""The messages, services and actions of ROS as they follow from the contract."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from google.protobuf.descriptor import Descriptor, FieldDescriptor, MethodDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool

from tools.contract import ros_comments, ros_names
from tools.contract.options import Options
from tools.contract.ros_rules import NUMBERED, FieldPart, Flat, RosField, Rules, named
from tools.contract.ros_values import Hint, arguments_of, hints_of, kind_of, members_of
from tools.contract.words import snake

_IN_A_FRAME = tuple(f"geometry_msgs/{name}Stamped" for name in ("Point", "Pose", "Transform", "Twist"))


@dataclass(frozen=True)
class Variant:
    """One kind of what a message with a oneof can be."""

    name: str
    kind: str
    part: FieldPart


@dataclass(frozen=True)
class Struct:
    """A message of ROS, and the class whose values it tells."""

    name: str
    kind: str
    head: str
    items: tuple[RosField, ...]
    part: FieldPart
    constants: tuple[str, ...] = ()
    variants: tuple[Variant, ...] = ()
    is_asked: bool = False
    is_told: bool = False
    is_part: bool = False
    """It has only a part of the attributes of its class."""


@dataclass(frozen=True)
class Served:
    """A method of the contract as a service of ROS."""

    method: str
    name: str
    type: str
    head: str
    request: FieldPart
    response: FieldPart
    request_items: tuple[RosField, ...]
    response_items: tuple[RosField, ...]
    service: str
    member: str
    """Member that it calls, as ``uav.gripper.grip``; empty: by hand."""
    arguments: tuple[tuple[str, str], ...]
    constants: tuple[str, ...]
    frames: tuple[str, ...]
    """The fields of a request that name the frames that it is given in."""
    goal_items: tuple[RosField, ...]
    """Of the action that flies it."""
    goal_frames: tuple[str, ...]
    has_plan: bool
    is_by_hand: bool
    """The node calls it by hand."""
    is_whole: bool
    """All arguments of its member are in the request."""
    answer_kind: str
    """The class that the fields of the answer are the attributes of; empty: the answer has one field."""

    @property
    def is_of_service(self) -> bool:
        """Whether it is no service of flying."""
        return self.service != "UalService"

    @property
    def has_service(self) -> bool:
        """Whether it is a service, and not an action alone."""
        return self.method not in ros_names.NO_SERVICE

    @property
    def is_simulation(self) -> bool:
        """Whether only simulated UAVs have it."""
        return self.service == "SimulationService"


class Shapes:
    """All of them."""

    def __init__(self, contract: FileDescriptorSet) -> None:
        self._options = Options(contract)
        pool = DescriptorPool()
        for file in contract.file:
            pool.AddSerializedFile(file.SerializeToString())  # type: ignore[no-untyped-call]
        self._files = [
            pool.FindFileByName(file.name)  # type: ignore[no-untyped-call]
            for file in contract.file
            if file.package == "ual.v1" and file.name not in ("ual/v1/options.proto", "ual/v1/network.proto")
        ]
        self._comments = {**ros_comments.comments(contract, self._names()), **ros_names.HEADS}
        self._asked = frozenset(self._reached("Request"))
        self._told = frozenset(self._reached("Response"))
        self.rules = Rules(self._comments, ros_names.FIELDS, self._asked, self._struct_name, self._options)

    @cached_property
    def messages(self) -> dict[str, Descriptor]:
        """The messages of the contract."""
        return {name: each for file in self._files for name, each in file.message_types_by_name.items()}

    @cached_property
    def methods(self) -> list[MethodDescriptor]:
        """The methods of the contract."""
        return [each for file in self._files for service in file.services_by_name.values() for each in service.methods]

    def _names(self) -> dict[str, str]:
        """The names of the contract that ROS has otherwise: of methods, and of fields with a unit."""
        fields = {each.name: named(each) for message in self.messages.values() for each in message.fields}
        methods = {each.name: self.name_of(each.name) for each in self.methods if each.name not in ros_names.NO_SERVICE}
        requests = {f"{name}Request": found for name, found in methods.items()}
        return {**methods, **requests, **{name: other for name, other in fields.items() if name != other}}

    @staticmethod
    def name_of(method: str) -> str:
        """Returns the name of a method's service."""
        return ros_names.NAMES.get(method, snake(method))

    def unknown(self) -> list[str]:
        """Returns what the table names, and the contract has not; to be called once all was made."""
        methods = {each.name for each in self.methods}
        of_methods = {*ros_names.NAMES, *ros_names.TYPES, *ros_names.OWN, *ros_names.NO_SERVICE}
        of_messages = {*ros_names.INSTEAD, *ros_names.EXTRA, *ros_names.ORDER, *ros_names.MESSAGES}
        return sorted(
            (ros_names.FIELDS.keys() - self.rules.used) | (of_methods - methods) | (of_messages - self.messages.keys())
        )

    def structs(self) -> Iterator[Struct]:
        """Yields the messages of ROS."""
        for name, message in self.messages.items():
            if self._is_struct(name):
                yield self._struct(message)

    def _is_struct(self, name: str) -> bool:
        if name in ros_names.MESSAGES:
            return True
        return not (name.endswith(("Request", "Response")) or name in ros_names.INSTEAD or name in self._within)

    @cached_property
    def _within(self) -> frozenset[str]:
        """The messages that stand flat in others, or are one kind of what others can be."""
        flat = {
            each.message_type.name
            for message in self.messages.values()
            for each in message.fields
            if isinstance(ros_names.FIELDS.get(f"{message.name}.{each.name}"), Flat)
        }
        kinds = {
            each.message_type.name for found in self.messages.values() for each in _kinds(found) if each.message_type
        }
        return frozenset(flat | kinds)

    def _struct_name(self, message: Descriptor) -> str:
        found: str = ros_names.INSTEAD.get(message.name, message.name)
        return ros_names.MESSAGES.get(message.name, found)

    def _struct(self, message: Descriptor) -> Struct:
        head = ros_comments.without_unset(self._comments.get(message.full_name, ""))
        name = self._struct_name(message)
        extra = ros_names.EXTRA.get(message.name, ros_names.Extra())
        asked, told = message.name in self._asked, message.name in self._told or message.name in ros_names.MESSAGES
        if kinds := _kinds(message):
            return self._union(message, name, kinds, extra)
        only = ros_names.ONLY.get(message.name, tuple(each.name for each in message.fields))
        hints = hints_of(kind_of(message)) if name != "GeoPoint" else {}
        part = self._ordered(message, self.rules.parts(message, hints, only))
        items = (*extra.before, *part.items, *extra.after)
        kind = kind_of(message) if name != "GeoPoint" else ""
        return Struct(
            name, kind, head, items, part, _constants(message), (), asked, told, message.name in ros_names.ONLY
        )

    def _union(self, message: Descriptor, name: str, kinds: list[FieldDescriptor], extra: ros_names.Extra) -> Struct:
        """Returns a message with the fields of all kinds that one with a oneof can be."""
        own = [
            self.rules.part(each, {each.name: Hint(False, None, str)})
            for each in message.fields
            if each.containing_oneof is None
        ]
        common = FieldPart(tuple(i for p in own for i in p.items), tuple(r for p in own for r in p.reads))
        variants = [
            Variant(
                each.name.upper(),
                kind_of(each.message_type),
                self._ordered(each.message_type, self.rules.parts(each.message_type)),
            )
            for each in kinds
        ]
        names = ros_comments.listed([each.name for each in variants])
        kind = RosField("string", "kind", "", f"{names}; what follows is of the kinds that have it")
        items = (*extra.before, *common.items, kind, *_merged(variants), *extra.after)
        constants = next(filter(None, (_constants(each.message_type) for each in kinds)), ())
        head = self._comments.get(message.full_name, "")
        is_asked, is_told = message.name in self._asked, message.name in self._told
        return Struct(name, kind_of(message), head, items, common, constants[:2], tuple(variants), is_asked, is_told)

    @staticmethod
    def _ordered(message: Descriptor, parts: Sequence[FieldPart]) -> FieldPart:
        items = [item for part in parts for item in part.items]
        order = {name: index for index, name in enumerate(ros_names.ORDER.get(message.name, ()))}
        items.sort(key=lambda item: order.get(item.name, len(order)))
        return FieldPart(tuple(items), tuple(read for part in parts for read in part.reads))

    # --- Services -----------------------------------------------------------------------------------------------------

    def served(self, *, also_actions: bool = False) -> Iterator[Served]:
        """Yields the services of ROS; with actions, also what is an action alone."""
        for method in self.methods:
            if method.name not in ros_names.NO_SERVICE or (also_actions and method.name in ros_names.ONLY_ACTIONS):
                yield self._served(method)

    def _served(self, method: MethodDescriptor) -> Served:
        member, hints = self._member(method)
        request = self._ordered(method.input_type, self.rules.parts(method.input_type, hints))
        response = self._ordered(method.output_type, self.rules.parts(method.output_type, {}))
        asked = ros_names.EXTRA.get(method.input_type.name, ros_names.Extra())
        told = ros_names.EXTRA.get(method.output_type.name, ros_names.Extra())
        request_items = (*asked.before, *request.items, *asked.after)
        response_items = (*told.before, *response.items, *told.after)
        goal_items: tuple[RosField, ...] = ()
        told_fields = {each.name for each in method.output_type.fields}
        if "task" in told_fields and method.name not in ros_names.NO_TASKS:
            goal_items = request_items
            request_items = (*(i for i in request_items if i.name not in ros_names.ONLY_ACTION), ros_names.BLOCKING)
            response_items = (ros_names.TASK_ID,)
        is_simulation = method.containing_service.name == "SimulationService"
        reads = dict(request.reads)
        lacking = [each for each in hints if each not in reads]
        if lacking and method.name not in ros_names.OWN:
            raise SystemExit(f"{method.name}: nothing in ROS is the argument {lacking[0]} of {member}")
        return Served(
            method=method.name,
            name="simulation/" * is_simulation + self.name_of(method.name),
            type=ros_names.TYPES.get(method.name, method.name if request_items or response_items else "Trigger"),
            head=self._comments.get(method.full_name, ""),
            request=request,
            response=response,
            request_items=request_items,
            response_items=response_items,
            service=method.containing_service.name,
            member=member,
            arguments=() if lacking else tuple((each, reads[each]) for each in hints),
            constants=_constants(method.input_type),
            frames=() if method.name in ros_names.NO_FRAMES else _frames(request_items),
            goal_items=goal_items,
            goal_frames=_frames(goal_items),
            has_plan="plan" in told_fields,
            is_by_hand=method.name in ros_names.OWN,
            is_whole=not lacking,
            answer_kind=self._answer_kind(method),
        )

    def _member(self, method: MethodDescriptor) -> tuple[str, dict[str, Hint]]:
        """Returns the member of `ual.Uav` that makes a call, and its arguments."""
        if method.name in ros_names.NO_MEMBER:
            return "", {}
        service = method.containing_service
        of_service = self._options.read("Service", "service_facts", service.GetOptions())
        member = self._options.read("Method", "facts", method.GetOptions()).member or snake(method.name)
        if service.name == "UalService":
            return f"uav.{member}", arguments_of("Uav", member)
        interface, number = of_service.part or service.name.removesuffix("Service"), snake(of_service.each)
        part = f"uav.{snake(interface)}"
        if number and any(each.name == number for each in method.input_type.fields):
            return f"{part}[request.{number}].{member}", arguments_of(of_service.each, member)
        return f"{part}.{member}", arguments_of(interface, member)

    @staticmethod
    def _answer_kind(method: MethodDescriptor) -> str:
        [*fields] = method.output_type.fields
        is_flat = len(fields) == 1 and isinstance(
            ros_names.FIELDS.get(f"{method.output_type.name}.{fields[0].name}"), Flat
        )
        return kind_of(fields[0].message_type) if is_flat else ""

    def _reached(self, suffix: str) -> Iterator[str]:
        waiting = [each for name, each in self.messages.items() if name.endswith(suffix)]
        seen = set()
        while waiting:
            message = waiting.pop()
            if message.name not in seen:
                seen.add(message.name)
                yield message.name
                waiting += [
                    each.message_type
                    for each in message.fields
                    if each.message_type is not None and each.message_type.file in self._files
                ]


def _frames(items: Sequence[RosField]) -> tuple[str, ...]:
    """Returns the fields of a request that name the frames that it is given in."""
    stamped = (f"{each.name}.header.frame_id" for each in items if each.type in _IN_A_FRAME)
    return (*stamped, *(each.name for each in items if each.name == "frame_id"))


def _kinds(message: Descriptor) -> list[FieldDescriptor]:
    real = [each for each in message.oneofs if not each.name.startswith("_")]
    return list(real[0].fields) if len(real) == 1 and real[0].name == "kind" else []


def _merged(variants: Sequence[Variant]) -> Iterator[RosField]:
    """Yields the fields of all kinds, each once, with the kinds that have it."""
    found: dict[str, list[tuple[str, RosField]]] = {}
    for variant in variants:
        for item in variant.part.items:
            found.setdefault(item.name, []).append((variant.name, item))
    for same in found.values():
        names = [name for name, _ in same]
        item = next((each for _, each in same if each.comment), same[0][1])
        of = f"of {', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else f"of {names[0]}"
        yield RosField(item.type, item.name, "", f"{of}: {item.comment}" if item.comment else of)


def _constants(message: Descriptor) -> tuple[str, ...]:
    """Returns the declarations of the numbers that a field may have."""
    enums = [
        each.enum_type for each in message.fields if each.enum_type is not None and each.enum_type.name in NUMBERED
    ]
    return tuple(
        f"uint8 {name} = {number}" for enum in enums for number, name in enumerate(members_of(kind_of(enum)), 1)
    )
