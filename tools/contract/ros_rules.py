"""Rules by which a field of the contract becomes fields of ROS, and code that fills and reads them.

A part is what ROS has of one field of a message. Its expressions are templates: ``{name}`` is an attribute or an
argument of Python, ``{self}`` the value that has them, and ``{m}`` the message of ROS.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from google.protobuf.descriptor import Descriptor, FieldDescriptor

from tools.contract import ros_comments
from tools.contract.options import Options
from tools.contract.ros_values import Hint, hints_of, kind_of, members_of, zero_of
from tools.contract.words import snake

_UNITS = {
    "m": "m",
    "s": "seconds",
    "rad": "rad",
    "deg": "degrees",
    "m_s": "m/s",
    "m_s2": "m/s^2",
    "rad_s": "rad/s",
    "px": "pixels",
    "hz": "Hz",
    "us": "microseconds",
    "n": "N",
    "v": "V",
    "a": "A",
    "c": "degrees Celsius",
    "bytes": "bytes",
    "ratio": "0 to 1",
    "percent": "0 to 1",
    "mib": "bytes",
}
"""Suffixes that ROS has not, and what a comment says instead."""
_UNIT = re.compile(rf"(?:_|^(?=percent$))({'|'.join(sorted(_UNITS, key=len, reverse=True))})$")
_TYPES = {
    FieldDescriptor.TYPE_BOOL: "bool",
    FieldDescriptor.TYPE_STRING: "string",
    FieldDescriptor.TYPE_DOUBLE: "float64",
    FieldDescriptor.TYPE_INT32: "int32",
    FieldDescriptor.TYPE_UINT32: "uint32",
    FieldDescriptor.TYPE_UINT64: "uint64",
}
_EMPTY = {"float64": "math.nan", "string": '""', "uint32": "0"}
"""Values for a message that is lacking, and stands flat in another one."""
NUMBERED = ("AltitudeReference", "PathHeading")
"""Enums that are constants in ROS, as in UAL for ROS 1. Of all others ROS has the names."""
_GEOMETRY = {
    "Vector3": ("geometry_msgs/Vector3", "vector({x})", "values.vector({f})"),
    "Quaternion": ("geometry_msgs/Quaternion", "quaternion({x})", "orientation({f})"),
    "PoseStamped": ("geometry_msgs/PoseStamped", "pose_stamped({x})", "values.pose_stamped({f})"),
    "PointStamped": ("geometry_msgs/PointStamped", "point_stamped({x})", "point_of({f})"),
    "TwistStamped": ("geometry_msgs/TwistStamped", "twist_stamped({x})", "values.twist_stamped({f})"),
    "Transform": (
        "geometry_msgs/TransformStamped",
        "transform_stamped({x})",
        "values.transform_stamped({f}, values.stamp_s({f}.header.stamp))",
    ),
    "AngleRange": ("float64[2]", "angle_range({x})", "read_angle_range({f})"),
}
"""Messages that ROS has of its own, and arrays."""
_ALWAYS = {"Quaternion": "values.quaternion({f})", "PointStamped": "values.point_stamped({f})"}
"""Reading of values that are never lacking."""
_LACKING = {"Quaternion": "zeros", "AngleRange": "NaN", "PointStamped": "an empty frame_id"}
"""Sign that one of these is lacking."""


@dataclass(frozen=True)
class RosField:
    """A field of ROS, and the expression of its content."""

    type: str
    name: str
    told: str = ""
    comment: str = ""


@dataclass(frozen=True)
class FieldPart:
    """Part of a ROS message that stands for one field: its fields, and the attributes and expressions that read
    them.
    """

    items: tuple[RosField, ...] = ()
    reads: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, type: str, name: str, told: str, attribute: str, read: str, comment: str = "") -> FieldPart:  # noqa: A002
        """Makes one of one field and one attribute."""
        return cls((RosField(type, name, told, comment),), ((attribute, read),))


_PLACE = ("latitude_deg", "longitude_deg", "altitude_m")
_FIX = FieldPart(
    (
        RosField(
            "sensor_msgs/NavSatFix",
            "waypoint",
            "fix({latitude_deg}, {longitude_deg}, {altitude_m})",
            "degrees and metres; status and covariance are ignored",
        ),
    ),
    (
        ("latitude_deg", "{m}.waypoint.latitude"),
        ("longitude_deg", "{m}.waypoint.longitude"),
        ("altitude_m", "{m}.waypoint.altitude"),
    ),
)
"""A place on Earth with its altitude."""


@dataclass(frozen=True)
class Called:
    """Another name, or another type, than the rules give."""

    name: str = ""
    type: str = ""


@dataclass(frozen=True)
class Flat:
    """The fields of a message stand in the one around it."""


@dataclass(frozen=True)
class Flag:
    """A field that may be lacking has another one beside it that says so."""

    name: str


Otherwise: TypeAlias = "FieldPart | Called | Flat | Flag | None"


class Rules:
    """The rules, and the table of what is otherwise.

    Args:
        comments: The comments of the contract.
        otherwise: Parts and names by ``Message.field``.
        asked: The messages that requests are made of: what is not set is 0 in them, else NaN.
        struct_of: Names the message of ROS that has the fields of one of the contract.
        options: The options of the contract.

    """

    def __init__(
        self,
        comments: dict[str, str],
        otherwise: dict[str, Otherwise],
        asked: frozenset[str],
        struct_of: Callable[[Descriptor], str],
        options: Options,
    ) -> None:
        self._comments = comments
        self._otherwise = otherwise
        self._asked = asked
        self._struct_of = struct_of
        self._options = options
        self.used: set[str] = set()

    def parts(
        self, message: Descriptor, hints: dict[str, Hint] | None = None, only: Sequence[str] | None = None
    ) -> list[FieldPart]:
        """Returns what ROS has of each field of a message. The hints are of its class, or of the arguments."""
        if hints is None:
            hints = hints_of(kind_of(message))
        fields = [field for field in message.fields if only is None or field.name in only]
        rest = [field for field in fields if field.name not in _PLACE]
        if len(fields) - len(rest) < len(_PLACE):
            return [self.part(field, hints) for field in fields]
        return [_FIX, *(self.part(field, hints) for field in rest)]

    def part(self, field: FieldDescriptor, hints: dict[str, Hint]) -> FieldPart:
        """Returns what ROS has of a field."""
        key = f"{field.containing_type.name}.{field.name}"
        comment = self._comments.get(field.full_name, "")
        found = self._otherwise.get(key, Called())
        if key in self._otherwise:
            self.used.add(key)
        if found is None:
            return FieldPart()
        if isinstance(found, Flat):
            return self._flat(field, hints)
        if isinstance(found, Flag):
            return self._flagged(field, found.name, comment)
        if isinstance(found, FieldPart):
            return FieldPart(tuple(_commented(each, comment) for each in found.items), found.reads)
        part = self._by_rule(field, comment, hints)
        if found.name or found.type:
            [item] = part.items
            other = replace(item, name=found.name or item.name, type=found.type or item.type)
            [(attribute, read)] = part.reads
            read = read.replace(f"{{m}}.{item.name}", f"{{m}}.{other.name}").replace(
                f'"{item.name}"', f'"{other.name}"'
            )
            return FieldPart((other,), ((attribute, read),))
        return part

    def _attribute(self, field: FieldDescriptor) -> str:
        """Returns the name of a field in Python: times and durations end in their unit there."""
        is_time = field.message_type is not None and field.message_type.name in ("Timestamp", "Duration")
        named: str = self._options.read("Field", "field_facts", field.GetOptions()).name
        return named or (f"{field.name}_s" if is_time else field.name)

    def _by_rule(self, field: FieldDescriptor, comment: str, hints: dict[str, Hint]) -> FieldPart:
        attribute = self._attribute(field)
        hint = hints.get(attribute, Hint(field.has_presence and field.message_type is None, None, None))
        if field.message_type is not None:
            return self._of_message(field, attribute, hint, comment)
        if field.enum_type is not None:
            return self._of_enum(field, attribute, hint, comment)
        return self._of_scalar(field, attribute, hint, comment)

    def _flat(self, field: FieldDescriptor, hints: dict[str, Hint]) -> FieldPart:
        """Returns the fields of a message that stand in the one around it. Arguments stand flat in Python, too."""
        attribute = field.name
        parts = self.parts(field.message_type)
        items = [each for part in parts for each in part.items]
        reads = [each for part in parts for each in part.reads]
        hint = hints.get(attribute)
        if hint is None:
            return FieldPart(tuple(items), tuple(reads))
        kind = kind_of(field.message_type)
        made = f"{kind}({', '.join(f'{name}={read}' for name, read in reads)})"
        if not hint.is_optional:
            inside = tuple(replace(each, told=_inside(each.told, attribute)) for each in items)
            return FieldPart(inside, ((attribute, made),))
        inside = tuple(
            replace(
                each,
                told=f"{_EMPTY[each.type]} if {{{attribute}}} is None else {_inside(each.told, attribute)}",
                comment=each.comment
                if "NaN" in each.comment or each.type != "float64"
                else f"{each.comment}; NaN: not known",
            )
            for each in items
        )
        first = items[0]
        lacks = f"math.isnan({{m}}.{first.name})" if first.type == "float64" else f"not {{m}}.{first.name}"
        return FieldPart(inside, ((attribute, f"None if {lacks} else {made}"),))

    def _flagged(self, field: FieldDescriptor, flag: str, comment: str) -> FieldPart:
        attribute, name = self._attribute(field), named(field)
        x, f, unit = f"{{{attribute}}}", f"{{m}}.{name}", _UNIT.search(field.name)
        kind = _TYPES[field.type]
        zero = "0.0" if kind == "float64" else "0"
        text = ros_comments.trailing(_UNITS[unit[1]] if unit else "", ros_comments.unset(comment, "not given"))
        return FieldPart(
            (
                RosField("bool", flag, f"{x} is not None", f"whether `{name}` is given"),
                RosField(kind, name, f"{zero} if {x} is None else {x}", text),
            ),
            ((attribute, f"{f} if {{m}}.{flag} else None"),),
        )

    # --- Numbers and texts --------------------------------------------------------------------------------------------

    def _of_scalar(self, field: FieldDescriptor, attribute: str, hint: Hint, comment: str) -> FieldPart:
        unit = _UNIT.search(field.name)
        name = named(field)
        comment = ros_comments.without_unit(comment) if unit else comment
        kind, x, f = _TYPES[field.type], f"{{{attribute}}}", f"{{m}}.{name}"
        if unit is not None and kind == "float64" and unit[1] == "percent":
            comment = re.sub(r"\bto 100\b", "to 1", comment)
        if field.is_repeated:
            text = ros_comments.trailing(_UNITS[unit[1]] if unit else "", comment)
            return FieldPart.of(f"{kind}[]", name, f"list({x})", attribute, f"{_container(hint)}({f})", text)
        if kind == "bool" and hint.is_optional:
            return FieldPart(
                (
                    RosField("bool", name, f"bool({x})", ros_comments.trailing(ros_comments.without_unset(comment))),
                    RosField("bool", f"{name}_known", f"{x} is not None", "false: it does not say"),
                ),
                ((attribute, f"{f} if {f}_known else None"),),
            )
        is_asked = field.containing_type.name in self._asked
        told, read, absent = _scalar(kind, hint, x, f, is_asked=is_asked)
        if unit is not None and unit[1] in ("percent", "mib") and kind == "float64":
            told, read = _scaled(unit[1], x, f, hint)
        comment = ros_comments.unset(comment, absent or "false")
        if absent and absent not in comment:
            comment = ros_comments.trailing(
                comment, f"{absent}: not known" if not is_asked else f"{absent}: none is given"
            )
        return FieldPart.of(kind, name, told, attribute, read, ros_comments.trailing(_says(unit, comment), comment))

    # --- Enums --------------------------------------------------------------------------------------------------------

    def _of_enum(self, field: FieldDescriptor, attribute: str, hint: Hint, comment: str) -> FieldPart:
        name, x, f = field.name, f"{{{attribute}}}", f"{{m}}.{field.name}"
        kind = kind_of(field.enum_type)
        names = members_of(kind)
        if field.enum_type.name in NUMBERED:
            read = f"values.{snake(field.enum_type.name)}({f})"
            text = ros_comments.trailing("one of the above", f"0 is taken as {names[0]}")
            return FieldPart.of("uint8", name, f"{x}.value", attribute, read, text)
        listed = ros_comments.listed(names)
        if field.is_repeated:
            read = f"frozenset({kind}[each] for each in {f})"
            return FieldPart.of(
                "string[]", name, f"names_of({x})", attribute, read, ros_comments.trailing(listed, comment)
            )
        text = ros_comments.trailing(listed, ros_comments.unset(comment, "empty"))
        is_asked = field.containing_type.name in self._asked
        read = f'named({kind}, {f}, "{name}")' if is_asked else f"{kind}[{f}]"
        if (zero := zero_of(kind)) is not None:  # one that stands for what is not named
            text = ros_comments.trailing(text, f"empty: {zero.lower()}")
            return FieldPart.of("string", name, f"name_of({x})", attribute, f"{read} if {f} else {kind}.{zero}", text)
        if hint.is_optional:
            if "empty" not in text:
                text += "; empty: not known"
            return FieldPart.of("string", name, f"name_of({x})", attribute, f"{read} if {f} else None", text)
        return FieldPart.of("string", name, f"{x}.name", attribute, read, text)

    # --- Messages -----------------------------------------------------------------------------------------------------

    def _of_message(self, field: FieldDescriptor, attribute: str, hint: Hint, comment: str) -> FieldPart:
        name, x, f = named(field), f"{{{attribute}}}", f"{{m}}.{named(field)}"
        kind, text = field.message_type.name, ros_comments.trailing(comment)
        if kind == "Timestamp":
            absent = ros_comments.trailing(ros_comments.unset(comment, "zero"))
            return FieldPart.of(
                "builtin_interfaces/Time",
                name,
                f"stamp({x})",
                attribute,
                f"values.stamp_s({f}){' or None' * hint.is_optional}",
                absent,
            )
        if kind == "Duration":
            told, read, absent = _scalar("float64", hint, x, f, is_asked=False)
            text = ros_comments.trailing("seconds", comment, f"{absent}: not known" if absent else "")
            return FieldPart.of("float64", name, told, attribute, read, text)
        if kind == "MissionPlace":  # two attributes in Python
            return FieldPart(
                (RosField("GeoPoint", name, "geo_point_fields(({latitude_deg}, {longitude_deg}))", text),),
                (("latitude_deg", f"{f}.latitude"), ("longitude_deg", f"{f}.longitude")),
            )
        if kind in _GEOMETRY:
            unit = _UNIT.search(field.name)
            type_, told, read = _GEOMETRY[kind]
            if not hint.is_optional:
                read = _ALWAYS.get(kind, read)
            text = ros_comments.without_unit(ros_comments.unset(comment, _LACKING.get(kind, "zero")))
            if hint.is_optional and kind in _LACKING and _LACKING[kind] not in text:
                text = f"{text.removesuffix('.')}; {_LACKING[kind]}: not known"
            text = ros_comments.trailing(_UNITS[unit[1]] if unit else "", text)
            return FieldPart.of(type_, name, _in(told, x, f), attribute, _in(read, x, f), text)
        struct = self._struct_of(field.message_type)
        told, read = f"{snake(struct)}_fields", f"read_{snake(struct)}"
        if field.is_repeated:
            items = f"[{told}(each) for each in {x}]"
            if field.containing_type.name in self._asked:
                return FieldPart.of(
                    f"{struct}[]", name, items, attribute, f'{_container(hint)}(read_all({read}, {f}, "{name}"))', text
                )
            return FieldPart.of(f"{struct}[]", name, items, attribute, f"{_container(hint)}(map({read}, {f}))", text)
        if hint.is_optional:
            items = f"[] if {x} is None else [{told}({x})]"
            text = ros_comments.trailing(ros_comments.unset(comment, "none"))
            return FieldPart.of(f"{struct}[<=1]", name, items, attribute, f"next(map({read}, {f}), None)", text)
        return FieldPart.of(struct, name, f"{told}({x})", attribute, f"{read}({f})", text)


def named(field: FieldDescriptor) -> str:
    """Returns the name of a field in ROS: without its unit."""
    return _UNIT.sub("", field.name) or field.name


def _commented(item: RosField, comment: str) -> RosField:
    return item if item.comment else replace(item, comment=ros_comments.trailing(comment))


def _inside(template: str, attribute: str) -> str:
    """Returns a template for the attributes of an attribute."""
    return re.sub(r"\{(\w+)\}", lambda found: f"{{{attribute}}}.{found[1]}", template)


def _container(hint: Hint) -> str:
    return "tuple" if hint.container is tuple else "list"


def _in(template: str, x: str, f: str) -> str:
    return template.replace("{x}", x).replace("{f}", f)


def _says(unit: re.Match[str] | None, comment: str) -> str:
    if unit is None or (unit[1] in ("percent", "ratio") and re.search(r"\bto 1\b", comment)):
        return ""
    return _UNITS[unit[1]]


def _scalar(kind: str, hint: Hint, x: str, f: str, *, is_asked: bool) -> tuple[str, str, str]:
    """Returns how a number or a text is told and read, and what is told where it is not known."""
    if not hint.is_optional:
        told = f"float({x})" if kind == "float64" and hint.inner is not float else x
        return (x if hint.inner is None else told), f, ""
    if kind != "float64":
        return f"{x} or 0", f"{f} or None", "0"
    if is_asked:
        return f"{x} or 0.0", f"{f} or None", "0"
    return f"values.known({x})", f"number({f})", "NaN"


def _scaled(unit: str, x: str, f: str, hint: Hint) -> tuple[str, str]:
    if unit == "mib":
        return f"in_bytes({x})", f"in_mib({f})"
    if hint.is_optional:
        return f"ratio({x})", f"percent({f})"
    return f"{x} / 100.0", f"100.0 * {f}"
