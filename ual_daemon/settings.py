"""The settings of a UAV that do not depend on its backend: types, ranges and defaults. Names end in the unit.

The same names are keys of the configuration file (see ``docs/reference/configuration.md``).
"""

from __future__ import annotations

import math
import re
import typing
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

FRAME_ID_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*\Z"
LONGEST_NAMESPACE_CHARACTERS = 64
NAMESPACE_PATTERN = rf"^[A-Za-z_][A-Za-z0-9_]{{0,{LONGEST_NAMESPACE_CHARACTERS - 1}}}\Z"

Positive = Annotated[float, Meta(gt=0.0)]
NotNegative = Annotated[float, Meta(ge=0.0)]
FrameId = Annotated[str, Meta(pattern=FRAME_ID_PATTERN)]
Angle = Annotated[float, Meta(ge=-math.tau, le=math.tau)]
"""Radians. What is more than a full turn is meant in degrees."""
AngleWithin = Annotated[float, Meta(gt=0.0, le=math.pi)]
"""Tolerance of a heading in radians; more than half a turn is refused as a value in degrees."""
MAX_TURN_RAD_S = 2.0 * math.tau
"""Of what is commanded: more than two turns a second are meant in degrees."""
TurnRate = Annotated[float, Meta(gt=0.0, le=MAX_TURN_RAD_S)]
"""The highest rate of turn, in rad/s."""
Coordinate = Annotated[float, Meta(ge=-1e7, le=1e7)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Latitude = Annotated[float, Meta(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Meta(ge=-180.0, le=180.0)]
GeoPosition = tuple[
    Latitude,
    Longitude,
    Annotated[float, Meta(ge=-1e5, le=1e5)],
]


class ConfigError(Exception):
    """A setting is not valid. `key` says which (``light.max_speed_m_s``; empty for the whole section)."""

    def __init__(self, message: str, key: str = "") -> None:
        super().__init__(f"{key}: {message}" if key else message)
        self.message = message
        self.key = key


class Settings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every section of the configuration: unknown keys and wrong types are errors."""


class FrameSettings(Settings, frozen=True, kw_only=True):
    """A static frame and its pose in its parent (metres, radians)."""

    frame_id: FrameId
    parent_frame_id: FrameId = "map"
    translation: Position = (0.0, 0.0, 0.0)
    roll_rad: Angle = 0.0
    pitch_rad: Angle = 0.0
    yaw_rad: Angle = 0.0


class LimitSettings(Settings, frozen=True, kw_only=True):
    """The user's limits. The smaller one of each of these and the autopilot's limit applies."""

    horizontal_speed_m_s: Positive = math.inf
    climb_speed_m_s: Positive = math.inf
    descent_speed_m_s: Positive = math.inf
    horizontal_acceleration_m_s2: Positive = math.inf
    vertical_acceleration_m_s2: Positive = math.inf
    yaw_rate_rad_s: TurnRate = math.inf


class ToleranceSettings(Settings, frozen=True, kw_only=True):
    """Conditions of arrival, once the reference is at the goal: the mean over `dwell_s` is within these values.

    The defaults are for a satellite receiver without corrections: in PX4's simulator the estimate of a UAV that hovers
    wanders by 0.3 to 0.5 m and 0.4 m/s (docs/reference/backends/mavlink.md).
    """

    position_m: Positive = 0.5
    heading_rad: AngleWithin = 0.1
    speed_m_s: Positive = 0.5
    dwell_s: NotNegative = 0.3


class GeofenceSettings(Settings, frozen=True, kw_only=True):
    """Geofence within which the UAV may be sent: a polygon, a height band, or both.

    `polygon` has x, y (metres) in `frame_id`, `polygon_geo` latitude and longitude (degrees) instead; the heights are z
    in `frame_id`. None is ``<ns>/odom``.
    """

    frame_id: FrameId | None = None
    polygon: tuple[tuple[Coordinate, Coordinate], ...] = ()
    polygon_geo: tuple[tuple[Latitude, Longitude], ...] = ()
    min_height_m: Coordinate | None = None
    max_height_m: Coordinate | None = None


Name = Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}\Z")]
Instance = Annotated[int, Meta(ge=1, le=6)]
PwmMicroseconds = Annotated[int, Meta(ge=500, le=2500)]


class GripperSettings(Settings, frozen=True, kw_only=True):
    """A gripper that may be moved. `instance` is its number at the autopilot."""

    name: Name
    instance: Instance = 1


class WinchSettings(Settings, frozen=True, kw_only=True):
    """A winch that may be moved: by one order at most `longest_m` of line, and never faster than `fastest_m_s`."""

    name: Name
    instance: Instance = 1
    longest_m: Annotated[float, Meta(gt=0.0, le=1000.0)] = 10.0
    fastest_m_s: Annotated[float, Meta(gt=0.0, le=20.0)] = 1.0


class ServoSettings(Settings, frozen=True, kw_only=True):
    """A servo that may be moved: its output channel, the bounds of its pulse width, and named positions."""

    name: Name
    channel: Annotated[int, Meta(ge=1, le=32)]
    min_pwm_us: PwmMicroseconds
    max_pwm_us: PwmMicroseconds
    positions: dict[Name, PwmMicroseconds] = {}

    def __post_init__(self) -> None:
        if self.min_pwm_us >= self.max_pwm_us:
            raise ValueError(f"min_pwm_us: {self.min_pwm_us} is not below max_pwm_us, {self.max_pwm_us}")
        for name, pwm_us in self.positions.items():
            if not self.min_pwm_us <= pwm_us <= self.max_pwm_us:
                bounds = f"{self.min_pwm_us} to {self.max_pwm_us}"
                raise ValueError(f"positions: {name}: {pwm_us} is not from {bounds}, the bounds of {self.name}")


class RelaySettings(Settings, frozen=True, kw_only=True):
    """A relay that may be switched: its number, counted from 1, and the names of its states."""

    name: Name
    number: Annotated[int, Meta(ge=1, le=16)]
    on_name: Name = "on"
    off_name: Name = "off"

    def __post_init__(self) -> None:
        if self.on_name == self.off_name:
            raise ValueError(f"on_name: both states of {self.name} are called {self.on_name}")


class PayloadSettings(Settings, frozen=True, kw_only=True):
    """Payload devices that may be moved. What is not named here is never moved."""

    grippers: Annotated[tuple[GripperSettings, ...], Meta(max_length=6)] = ()
    winches: Annotated[tuple[WinchSettings, ...], Meta(max_length=6)] = ()
    servos: Annotated[tuple[ServoSettings, ...], Meta(max_length=32)] = ()
    relays: Annotated[tuple[RelaySettings, ...], Meta(max_length=16)] = ()

    def __post_init__(self) -> None:
        for section, names in (
            ("grippers", [each.name for each in self.grippers]),
            ("grippers", [f"instance {each.instance}" for each in self.grippers]),
            ("winches", [each.name for each in self.winches]),
            ("winches", [f"instance {each.instance}" for each in self.winches]),
            ("servos", [each.name for each in self.servos]),
            ("servos", [f"channel {each.channel}" for each in self.servos]),
            ("relays", [each.name for each in self.relays]),
            ("relays", [f"number {each.number}" for each in self.relays]),
        ):
            twice = next((each for each in names if names.count(each) > 1), None)
            if twice is not None:
                raise ValueError(f"{section}: two of them have {twice}")


class Tracker(Enum):
    """Controller of go-tos and paths."""

    REFERENCE = "reference"
    """By a smooth trajectory in time, with its velocity and acceleration as feed-forward. Straight and fast."""
    PURSUIT = "pursuit"
    """By pure pursuit: towards a point of the path a little ahead of the UAV, without feed-forward."""


class VehicleSettings(Settings, frozen=True, kw_only=True):
    """Frames, limits and tolerances of one UAV.

    `floor_m` and `ceiling_m` are heights above the ground of the take-off, between which commands may lead; None: no
    such limit. Goals and ways stay at least `clearance_m` above the floor (None: as much as the body of this kind of
    vehicle needs). A goal lies at most `reach_m` from the UAV; None: anywhere. `rtl_height_m` is the height above that
    ground at which `return_to_launch` flies at least, where the call gives none, and the ceiling and the geofence
    allow it. `payload` names what may be moved of what it carries.
    """

    home_pose: Position = (0.0, 0.0, 0.0)
    home_pose_parent_frame: FrameId = "map"
    map_origin_geo: GeoPosition | None = None
    pose_frame_id: FrameId | None = None
    frames: tuple[FrameSettings, ...] = ()
    limits: LimitSettings = LimitSettings()
    tolerance: ToleranceSettings = ToleranceSettings()
    tracker: Tracker = Tracker.REFERENCE
    floor_m: Coordinate | None = 0.0
    ceiling_m: Coordinate | None = 120.0
    clearance_m: NotNegative | None = None
    reach_m: Positive | None = 10_000.0
    rtl_height_m: Positive = 15.0
    geofence: GeofenceSettings | None = None
    payload: PayloadSettings = PayloadSettings()


S = TypeVar("S", bound=Settings)


def convert(values: Mapping[str, Any], kind: type[S], section: str = "") -> S:
    """Converts the values of one section to its settings.

    Raises:
        ConfigError: A value is not valid; names the key.
    """
    try:
        settings = msgspec.convert(dict(values), kind)
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at `$")
        key = path.rstrip("`").lstrip(".")
        if "unknown field" in message:  # msgspec names the field in the message, and the path of its parent
            name = message.split("`")[1]
            key = f"{key}.{name}".lstrip(".")
            known = [_within(section, each) for each in keys(kind)]
            meant = did_you_mean(_within(section, key), known) or _inside(_within(section, key), known)
            message = "there is no such setting" + meant
        else:
            message = human_readable(message, kind, key)
        raise ConfigError(message, _within(section, key)) from None
    _refuse_not_finite(values, section)
    return settings


def _within(section: str, key: str) -> str:
    return ".".join(part for part in (section, key) if part)


def _refuse_not_finite(value: object, key: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{value} is not a finite number", key)
    if isinstance(value, Mapping):
        for name, inner in value.items():
            _refuse_not_finite(inner, f"{key}.{name}".lstrip("."))
    elif isinstance(value, (list, tuple)):
        for index, inner in enumerate(value):
            _refuse_not_finite(inner, f"{key}[{index}]")


# --- What is wrong, in words: msgspec quotes regular expressions and types, and names no other value ------------------

_NAME = "a name: letters, digits and _, beginning with a letter or _"
_PATTERN = re.compile(r"Expected `str` matching regex '(.*)'")
_EXPECTED = re.compile(r"Expected `([^`]+)`(?: (of length|>=|>|<=|<) ([^,]+))?(?:, got `?([^`]+)`?)?")
_TYPES = {
    "int": "a whole number",
    "float": "a number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "a section",
    "null": "nothing",
}
_BOUNDS = {"of length": "of length", ">=": "of at least", ">": "above", "<=": "of at most", "<": "below"}
_NAME_SIMILARITY = 0.75
_INDEX = re.compile(r"\[[^]]*\]")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Returns the question after names that are spelled in a similar way; empty where there are none.

    A setting that is in another section is meant by its own name, but not where the word is of a list's item: those
    have names as common as `name`.
    """
    import difflib  # imported late, for a faster start

    names = list(known)
    last = word.rsplit(".", maxsplit=1)[-1]
    alike = [] if "[" in word else [name for name in names if name.split(".")[-1] == last]
    word = _INDEX.sub("", word)
    alike = alike or difflib.get_close_matches(word, names, n=3, cutoff=_NAME_SIMILARITY)
    return f"; did you mean {' or '.join(alike)}?" if alike else ""


def _inside(word: str, known: Iterable[str]) -> str:
    """Returns what there is in the section of a name; empty for one of the uppermost."""
    section, dot, _ = _INDEX.sub("", word).rpartition(".")
    names = [name.removeprefix(section + dot) for name in known if dot and name.startswith(section + dot)]
    return f"; {section} has {', '.join(name for name in names if '.' not in name)}" if names else ""


def human_readable(message: str, kind: type[Settings], key: str) -> str:
    """Returns the message of msgspec about the value of a key (``frames[0].frame_id``), as a person reads it."""
    if pattern := _PATTERN.fullmatch(message):
        length = re.search(r"\{0,(\d+)\}", pattern[1])
        at_most = f", of at most {int(length[1]) + 1} characters" if length else ""
        return f"expected {_NAME}{at_most}" + (", parts joined by /" if "/" in pattern[1] else "")
    if message.endswith((f"<= {math.tau}", f">= -{math.tau}")):
        return "is more than a full turn: give radians, not degrees"
    if message.endswith(f"<= {math.pi}"):
        return "is more than half a turn: give radians, not degrees"
    if message.endswith(f"<= {MAX_TURN_RAD_S}"):
        return "is more than two turns a second: give radians a second, not degrees"
    if message.startswith("Invalid enum value"):
        known = list(_values(_type_at(kind, key)))
        return f"{message.removeprefix('Invalid enum value ')} is not one of: {', '.join(known)}"
    if expected := _EXPECTED.fullmatch(message):
        types, relation, bound, got = expected.groups()
        within = f" {_BOUNDS[relation]} {bound.removesuffix('.0')}" if relation else ""
        return f"expected {_type_words(types)}{within}" + (f", got {_TYPES.get(got, got)}" if got else "")
    return message


def _type_words(types: str) -> str:
    """Returns ``int | null`` as words."""
    wanted = [each for each in types.split(" | ") if each != "null"]
    return " or ".join(_TYPES.get(each, each) for each in wanted)


def keys(kind: Any) -> Iterator[str]:  # noqa: ANN401 (a type, or what stands for one in an annotation)
    """Yields the keys of a section and of those inside it, with their dots."""
    for name, annotation in typing.get_type_hints(_struct(kind)).items():
        yield name
        if _struct(annotation) is not None:
            yield from (f"{name}.{inner}" for inner in keys(annotation))


def _type_at(kind: Any, key: str) -> Any:  # noqa: ANN401 (see `keys`)
    for name in _INDEX.sub("", key).split("."):
        kind = typing.get_type_hints(_struct(kind))[name]
    return kind


def _struct(annotation: Any) -> type[msgspec.Struct] | None:  # noqa: ANN401 (see `keys`)
    """Returns the section that an annotation allows: by itself, in a union, or in a tuple."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return annotation
    return next((found for each in typing.get_args(annotation) if (found := _struct(each)) is not None), None)


def _values(annotation: Any) -> Iterator[str]:  # noqa: ANN401 (see `keys`)
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        yield from (str(each.value) for each in annotation)
    elif typing.get_origin(annotation) is typing.Literal:
        yield from map(str, typing.get_args(annotation))
    elif annotation is float:
        yield "a number"
    else:
        for each in typing.get_args(annotation):
            yield from _values(each)
