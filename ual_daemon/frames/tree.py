"""The tree of frames: ``map`` -> ``<ns>/odom`` -> ``<ns>/base_link``, and the frames that are added."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from ual.errors import InvalidArgumentError, ResourceExhaustedError, UnknownFrameError, WrongStateError
from ual.geometry import IDENTITY, Pose, Quaternion, Transform, Vector3, wrap_angle
from ual.types import Frame
from ual_daemon.settings import ConfigError, VehicleSettings

MAP = "map"

MOST_FRAMES = 200
"""With ``map``. Each frame costs time with every answer that lists them, and with every move of one."""
MOST_LEVELS = 32
"""Levels below ``map``. Each level costs time with every pose that is requested in a frame below it."""
EXTRAPOLATION_S = 0.5
"""Seconds after its last update for which a client's frame goes on at its velocity; then it stands still."""
_UPDATE_GAP_S = 2.0 * EXTRAPOLATION_S
"""Updates that are no further apart tell that a frame moves, also while it stands. Others put it elsewhere."""
_VELOCITY_SMOOTHING_S = 0.2
_FASTEST_FRAME_M_S = 100.0
"""A frame that seems to move faster has not moved: the client has put it elsewhere."""


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """Motion of a client's frame in its parent, from `since_s` (backend clock) on."""

    since_s: float
    velocity: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0

    def extrapolate(self, link: Transform, now_s: float) -> Transform:
        """Returns where the frame is at a time."""
        passed_s = max(0.0, min(EXTRAPOLATION_S, now_s - self.since_s))
        if passed_s == 0.0:
            return link
        rotation = Quaternion.from_yaw(self.yaw_rate_rad_s * passed_s) * link.rotation
        return replace(link, translation=link.translation + self.velocity * passed_s, rotation=rotation)


@dataclass(frozen=True, slots=True)
class _Link:
    """The link of a frame to its parent.

    Attributes:
        parent: The parent frame.
        transform: From the frame to its parent; None if not known yet, and for the body.
        motion: How it moves; None until a client has moved it.
        updated_s: When it was last updated.
        turned: Of a frame that is attached: how it is turned now.

    """

    parent: str
    transform: Transform | None
    motion: FrameMotion | None = None
    updated_s: float = 0.0
    turned: Callable[[], Quaternion | None] | None = None

    @property
    def is_still(self) -> bool:
        """Whether it stays where it is."""
        return self.motion is None and self.turned is None

    def at(self, now_s: float | None) -> Transform | None:
        """Returns the transform at a time; None: as it was last updated."""
        if self.turned is not None and self.transform is not None:
            rotation = self.turned()
            return None if rotation is None else replace(self.transform, rotation=rotation)
        if self.motion is None or self.transform is None or now_s is None:
            return self.transform
        return self.motion.extrapolate(self.transform, now_s)


_Links = Mapping[str, _Link]


class FrameTree:
    """All frames of one UAV. Every member may be called from any thread.

    The body moves, so callers pass its pose in ``<ns>/odom`` where a chain may go through it; None if it is not known.
    The links are replaced as a whole (copy on write): a reader takes no lock, and sees one state of the tree from
    beginning to end.
    """

    def __init__(self, ns: str, settings: VehicleSettings) -> None:
        self.odom = f"{ns}/odom"
        self.body = f"{ns}/base_link"
        self._lock = threading.Lock()
        self._fixed = {MAP, self.odom, self.body, *(frame.frame_id for frame in settings.frames)}
        self.links = self._build(settings)
        """Parent of each frame: another object whenever a frame was added, moved or removed. It changes only here; an
        attribute, because each setpoint looks.
        """
        self._odom_in_map: tuple[_Links, Transform | None] = ({}, None)
        """The transform from odom to map, and the links from which it was computed."""

    def _build(self, settings: VehicleSettings) -> _Links:
        """Returns the links of the configuration. Raises `ConfigError` if they do not make a tree."""
        links = self._configured_links(settings)
        for index, frame in enumerate(settings.frames):
            if not _leads_to_map(frame.frame_id, links):
                raise ConfigError(
                    f"the frame {frame.frame_id} does not lead to {MAP}: its parent {frame.parent_frame_id} is not "
                    "known, or they make a loop",
                    f"frames[{index}].parent_frame_id",
                )
            if len(_chain(frame.frame_id, links)) - 1 > MOST_LEVELS:
                raise ConfigError(
                    f"the frame {frame.frame_id} is more than {MOST_LEVELS} levels below {MAP}",
                    f"frames[{index}].parent_frame_id",
                )
        if len(links) + 1 > MOST_FRAMES:
            raise ConfigError(f"these are more than {MOST_FRAMES} frames", "frames")
        if not _leads_to_map(self.odom, links):
            raise ConfigError(
                f"the frame {settings.home_pose_parent_frame} is not known, or lies below {self.odom}",
                "home_pose_parent_frame",
            )
        if settings.pose_frame_id is not None and settings.pose_frame_id not in {MAP, *links}:
            raise ConfigError(f"the frame {settings.pose_frame_id} is not known", "pose_frame_id")
        return MappingProxyType(links)

    def _configured_links(self, settings: VehicleSettings) -> dict[str, _Link]:
        home: Transform | None = Transform(
            Vector3(*settings.home_pose), IDENTITY, settings.home_pose_parent_frame, self.odom
        )
        if settings.map_origin_geo is not None:
            home = None  # it follows from the autopilot's position; see `set_home`
        links = {self.odom: _Link(settings.home_pose_parent_frame, home), self.body: _Link(self.odom, None)}
        for index, frame in enumerate(settings.frames):
            if frame.frame_id in links or frame.frame_id == MAP:
                raise ConfigError(f"the frame {frame.frame_id} is there already", f"frames[{index}].frame_id")
            rotation = Quaternion.from_euler(frame.roll_rad, frame.pitch_rad, frame.yaw_rad)
            transform = Transform(Vector3(*frame.translation), rotation, frame.parent_frame_id, frame.frame_id)
            links[frame.frame_id] = _Link(frame.parent_frame_id, transform)
        return links

    def set_home(self, position_in_map: Vector3, turn: Quaternion = IDENTITY) -> None:
        """Moves ``<ns>/odom`` to a position in ``map``."""
        with self._lock:
            self._replace(Transform(position_in_map, turn, MAP, self.odom))

    def forget_home(self) -> None:
        """Makes it unknown where ``<ns>/odom`` lies in ``map``."""
        with self._lock:
            self.links = MappingProxyType({**self.links, self.odom: replace(self.links[self.odom], transform=None)})

    def has_home(self) -> bool:
        """Returns whether it is known where ``<ns>/odom`` lies."""
        return self.links[self.odom].transform is not None

    def odom_in_map(self) -> Transform | None:
        """Returns the transform from ``<ns>/odom`` to ``map``; None if not known. Cached: each sample calls it."""
        links = self.links
        cached_for, transform = self._odom_in_map
        if cached_for is not links:
            transform = self.lookup(MAP, self.odom, None) if self.has_home() else None
            self._odom_in_map = (links, transform)
        return transform

    def is_fixed(self, name: str) -> bool:
        """Returns whether a frame never moves: it is built in or configured, and not the body or attached to it."""
        link = self.links.get(name)
        return name in self._fixed and name != self.body and (link is None or link.turned is None)

    def is_below(self, name: str, other: str) -> bool:
        """Returns whether a frame is another one, or below it."""
        return other in _chain(name, self.links)

    def is_below_odom(self, name: str) -> bool:
        """Returns whether a frame is ``<ns>/odom``, or below it."""
        return self.is_below(name, self.odom)

    def is_below_body(self, name: str) -> bool:
        """Returns whether a frame is the body, or below it. Raises `UnknownFrameError` if there is no such frame."""
        links = self.links
        _require(name, links)
        return self.body in _chain(name, links)

    def is_moving(self, name: str) -> bool:
        """Returns whether a client moves a frame, or one above it. Frames below the body do not count.

        Raises `UnknownFrameError` if there is no such frame.
        """
        links = self.links
        _require(name, links)
        chain = _chain(name, links)
        return self.body not in chain and any(each != MAP and links[each].motion is not None for each in chain)

    def add(self, transform: Transform, now_s: float = 0.0) -> None:
        """Adds a frame, or moves one that was added before, at a time of the backend's clock.

        An empty parent means ``map``. The velocity of a frame is estimated from one move to the next. By its stamp, a
        move that comes after a later one is left out, and one that is repeated tells nothing new.

        Raises:
            UnknownFrameError: There is no such parent.
            InvalidArgumentError: The frame is built in or configured, or would be below itself.
            ResourceExhaustedError: There would be too many frames, or too many levels of them.

        """
        parent = transform.frame_id or MAP
        child = transform.child_frame_id
        with self._lock:
            self.require(parent)
            if child in self._fixed:
                raise InvalidArgumentError(
                    f"transform.child_frame_id: the frame {child} is built in or configured and stays where it is",
                    {"field": "transform.child_frame_id"},
                )
            if child in _chain(parent, self.links):
                raise InvalidArgumentError(
                    f"transform.header.frame_id: {child} cannot hang below itself ({parent} lies below it)",
                    {"field": "transform.header.frame_id"},
                )
            _require_room(parent, child, self.links)
            old = self.links.get(child)
            link = Transform(transform.translation, transform.rotation, parent, child, transform.stamp_s)
            if old is None or not _is_overtaken(old, link):
                self._replace(link, _estimated_motion(old, link, now_s), now_s)

    def attach(self, name: str, place: Vector3, turned: Callable[[], Quaternion | None]) -> None:
        """Adds a frame below the body that turns by itself, as a gimbal does. Callers can neither move nor remove it.

        `turned` is called with each look at the frame, from any thread, and returns None while that is not known. So
        the links stay the same while it turns. A frame of this name that was added before is replaced.
        """
        with self._lock:
            self._fixed.add(name)
            link = _Link(self.body, Transform(place, IDENTITY, self.body, name), turned=turned)
            self.links = MappingProxyType({**self.links, name: link})

    def remove(self, name: str) -> None:
        """Removes a frame that was added.

        Raises:
            UnknownFrameError: There is no such frame.
            InvalidArgumentError: The frame is built in or configured, or other frames lie below it.

        """
        with self._lock:
            self.require(name)
            if name in self._fixed:
                raise InvalidArgumentError(
                    f"frame_id: the frame {name} is built in or configured and stays", {"field": "frame_id"}
                )
            children = ", ".join(child for child, link in self.links.items() if link.parent == name)
            if children:
                raise InvalidArgumentError(
                    f"frame_id: frames lie below {name}; remove them first: {children}", {"field": "frame_id"}
                )
            self.links = MappingProxyType({other: link for other, link in self.links.items() if other != name})

    def _replace(self, transform: Transform, motion: FrameMotion | None = None, updated_s: float = 0.0) -> None:
        link = _Link(transform.frame_id, transform, motion, updated_s)
        self.links = MappingProxyType({**self.links, transform.child_frame_id: link})

    def names(self) -> list[str]:
        """Returns the names of all frames, the root first."""
        return [MAP, *self.links]

    def frames(self, body: Pose | None) -> list[Frame]:
        """Returns all frames with their parents."""
        result = [Frame(MAP, "", None, True)]
        for name, link in self.links.items():
            transform = self._body_transform(body) if name == self.body else link.at(None)
            result.append(Frame(name, link.parent, transform, name != self.body and link.is_still))
        return result

    def lookup(
        self, target: str, source: str, body: Pose | None, now_s: float | None = None, links: _Links | None = None
    ) -> Transform:
        """Returns the transform from the source frame to the target frame.

        With `now_s` (backend clock), the positions of moving frames are extrapolated to that time. `links` are those
        of several lookups that belong together; None: the present ones.

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: A link between the frames is not known (yet).

        """
        links = self.links if links is None else links
        _require(target, links)
        _require(source, links)
        if target == source:
            return Transform(Vector3(), IDENTITY, target, source)
        up_from_target = _chain(target, links)
        common = next(name for name in _chain(source, links) if name in up_from_target)
        to_common = self._climb(source, common, links, body, now_s)
        if common == target:
            return to_common
        return self._climb(target, common, links, body, now_s).inverse().compose(to_common)

    def _climb(self, name: str, ancestor: str, links: _Links, body: Pose | None, now_s: float | None) -> Transform:
        result = Transform(Vector3(), IDENTITY, name, name)
        while result.frame_id != ancestor:
            child = result.frame_id
            transform = self._body_transform(body) if child == self.body else links[child].at(now_s)
            if transform is None:
                raise WrongStateError(f"it is not known yet where the frame {child} is in {links[child].parent}")
            result = transform.compose(result) if result.frame_id != name else _first_link(transform, name)
        return result

    def _body_transform(self, body: Pose | None) -> Transform | None:
        if body is None:
            return None
        return Transform(body.position, body.orientation, self.odom, self.body)

    def require(self, name: str) -> None:
        """Raises `UnknownFrameError` if there is no such frame."""
        _require(name, self.links)


def _first_link(link: Transform, child: str) -> Transform:
    """Returns the chain of one link, without composing it with an identity."""
    return Transform(link.translation, link.rotation, link.frame_id, child)


def _is_overtaken(old: _Link, link: Transform) -> bool:
    """Returns whether a later update came before, by the client's stamps. A clock that was set back is no such case."""
    before = old.transform
    if before is None or old.parent != link.frame_id or not (before.stamp_s > 0.0 and link.stamp_s > 0.0):
        return False
    return 0.0 < before.stamp_s - link.stamp_s <= _UPDATE_GAP_S


def _estimated_motion(old: _Link | None, link: Transform, now_s: float) -> FrameMotion | None:
    """Estimates how a frame moves after an update: smoothed, and by the client's stamps if it gives them."""
    if old is None or old.transform is None or old.parent != link.frame_id:
        return None
    before = old.transform
    are_stamped = before.stamp_s > 0.0 and link.stamp_s > 0.0
    passed_s = link.stamp_s - before.stamp_s if are_stamped else now_s - old.updated_s
    is_same = before.translation == link.translation and before.rotation == link.rotation
    if old.motion is None and is_same and passed_s > _UPDATE_GAP_S:  # a program that starts again adds its frames again
        return None
    last = old.motion or FrameMotion(now_s)
    if passed_s == 0.0:  # a repeated update
        return last
    velocity = (link.translation - before.translation) / passed_s
    yaw_rate_rad_s = wrap_angle((link.rotation * before.rotation.inverse()).yaw_rad) / passed_s
    if velocity.norm() > _FASTEST_FRAME_M_S or abs(passed_s) > _UPDATE_GAP_S:
        return FrameMotion(now_s)
    # The first time, too: two updates close in time do not give a good velocity.
    share = passed_s / (passed_s + _VELOCITY_SMOOTHING_S)
    return FrameMotion(
        now_s,
        last.velocity + (velocity - last.velocity) * share,
        last.yaw_rate_rad_s + (yaw_rate_rad_s - last.yaw_rate_rad_s) * share,
    )


def _require(name: str, links: _Links) -> None:
    if name != MAP and name not in links:
        known = ", ".join([MAP, *links])
        same = next((each for each in (MAP, *links) if each.lower() == name.lower()), "")
        meant = f"; did you mean {same}?" if same else ""
        raise UnknownFrameError(
            f"there is no frame {name}; known are {known}{meant}", {"frame_id": name, "known": known}
        )


def _require_room(parent: str, child: str, links: _Links) -> None:
    """Raises `ResourceExhaustedError` if a new link would exceed a limit of the tree."""
    old = links.get(child)
    if old is None and len(links) + 1 >= MOST_FRAMES:  # one more for the root, which has no link
        raise ResourceExhaustedError(
            f"{child}: there can be at most {MOST_FRAMES} frames; remove one first", {"limit": str(MOST_FRAMES)}
        )
    if old is not None and old.parent == parent:
        return
    levels = len(_chain(parent, links)) + (0 if old is None else _levels_below(child, links))
    if levels > MOST_LEVELS:
        raise ResourceExhaustedError(
            f"{child}: frames can be at most {MOST_LEVELS} levels below {MAP}, and this would make {levels}",
            {"limit": str(MOST_LEVELS)},
        )


def _levels_below(name: str, links: _Links) -> int:
    """Returns how many levels of frames a frame has below it."""
    chains = (_chain(each, links) for each in links)
    return max(chain.index(name) for chain in chains if name in chain)


def _chain(name: str, links: _Links) -> list[str]:
    """Returns a frame and all frames above it, up to ``map``."""
    chain = [name]
    while name != MAP:
        name = links[name].parent
        chain.append(name)
    return chain


def _leads_to_map(name: str, links: _Links) -> bool:
    seen: set[str] = set()
    while name != MAP:
        if name in seen or name not in links:
            return False
        seen.add(name)
        name = links[name].parent
    return True


def horizontal(pose: Pose) -> Pose:
    """Returns the pose with its heading, but without roll and pitch.

    Commands in ``<ns>/base_link`` mean "ahead of" and "above" the level UAV, whatever its tilt is at the moment.
    """
    return Pose(pose.position, Quaternion.from_yaw(pose.yaw_rad))
