"""The tree of frames: ``map`` -> ``<ns>/odom`` -> ``<ns>/base_link``, and those that are added."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from ual.errors import InvalidArgumentError, UnknownFrameError, WrongStateError
from ual.geometry import IDENTITY, Pose, Quaternion, Transform, Vector3, wrap_angle
from ual.types import Frame
from ual_daemon.settings import ConfigError, VehicleSettings

MAP = "map"


CARRIED_ON_S = 0.5
"""A frame that a client moves goes on as it went for so long after it was last told where it is; then it stands."""
_SMOOTHED_S = 0.2
_FASTEST_M_S = 100.0
"""What moves faster has not moved: it was put elsewhere."""


@dataclass(frozen=True, slots=True)
class Drift:
    """How a frame that a client moves goes on in its parent, from `since_s` (backend clock) on."""

    since_s: float
    velocity: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0

    def carry_on(self, link: Transform, now_s: float) -> Transform:
        """Where the frame is by now."""
        passed_s = max(0.0, min(CARRIED_ON_S, now_s - self.since_s))
        if passed_s == 0.0:
            return link
        turn = Quaternion.from_yaw(self.yaw_rate_rad_s * passed_s)
        return replace(link, translation=link.translation + self.velocity * passed_s, rotation=turn * link.rotation)


@dataclass(frozen=True, slots=True)
class _Link:
    """Where a frame hangs; `transform` takes it to its parent, None where that is not known yet (or the body's).

    `drift` is set once a client has moved it, and `told_s` is when it was last told where it is.
    """

    parent: str
    transform: Transform | None
    drift: Drift | None = None
    told_s: float = 0.0

    def at(self, now_s: float | None) -> Transform | None:
        """The transform at a time; None: as it was told last."""
        if self.drift is None or self.transform is None or now_s is None:
            return self.transform
        return self.drift.carry_on(self.transform, now_s)


_Links = Mapping[str, _Link]


class FrameTree:
    """All frames of one UAV. Every member may be called from any thread.

    The body moves, so its pose in ``<ns>/odom`` is handed in by the caller where a chain may pass it; None where it is
    not known. The links are replaced as a whole (copy on write): readers take no lock, and look at one picture of the
    tree from beginning to end.
    """

    def __init__(self, ns: str, settings: VehicleSettings) -> None:
        self.odom = f"{ns}/odom"
        self.body = f"{ns}/base_link"
        self._lock = threading.Lock()
        self._fixed = {MAP, self.odom, self.body, *(frame.frame_id for frame in settings.frames)}
        self._links = self._build(settings)
        self._odom_in_map: tuple[_Links, Transform | None] = ({}, None)
        """Of which links it was found."""

    def _build(self, settings: VehicleSettings) -> _Links:
        home: Transform | None = Transform(
            Vector3(*settings.home_pose), IDENTITY, settings.home_pose_parent_frame, self.odom
        )
        if settings.map_origin_geo is not None:
            home = None  # follows from the autopilot's position: set_home
        links = {self.odom: _Link(settings.home_pose_parent_frame, home), self.body: _Link(self.odom, None)}
        for index, frame in enumerate(settings.frames):
            if frame.frame_id in links or frame.frame_id == MAP:
                raise ConfigError(f"the frame {frame.frame_id} is there already", f"frames[{index}].frame_id")
            turn = Quaternion.from_euler(frame.roll_rad, frame.pitch_rad, frame.yaw_rad)
            transform = Transform(Vector3(*frame.translation), turn, frame.parent_frame_id, frame.frame_id)
            links[frame.frame_id] = _Link(frame.parent_frame_id, transform)
        for index, frame in enumerate(settings.frames):
            if not _leads_to_map(frame.frame_id, links):
                raise ConfigError(
                    f"the frame {frame.frame_id} does not lead to {MAP}: its parent {frame.parent_frame_id} is not "
                    "known, or they make a loop",
                    f"frames[{index}].parent_frame_id",
                )
        if not _leads_to_map(self.odom, links):
            raise ConfigError(
                f"the frame {settings.home_pose_parent_frame} is not known, or lies below {self.odom}",
                "home_pose_parent_frame",
            )
        if settings.pose_frame_id is not None and settings.pose_frame_id not in {MAP, *links}:
            raise ConfigError(f"the frame {settings.pose_frame_id} is not known", "pose_frame_id")
        return MappingProxyType(links)

    def set_home(self, position_in_map: Vector3) -> None:
        """Puts ``<ns>/odom`` at a position in ``map``."""
        with self._lock:
            self._replace(Transform(position_in_map, IDENTITY, MAP, self.odom))

    def has_home(self) -> bool:
        """Whether it is known where ``<ns>/odom`` lies."""
        return self._links[self.odom].transform is not None

    def odom_in_map(self) -> Transform | None:
        """Takes ``<ns>/odom`` to ``map``; None while it is not known where it lies. Kept, as each sample asks."""
        links = self._links
        found_of, found = self._odom_in_map
        if found_of is not links:
            found = self.lookup(MAP, self.odom, None) if self.has_home() else None
            self._odom_in_map = (links, found)
        return found

    def is_fixed(self, name: str) -> bool:
        """Whether a frame is built in or configured, and no body: it stays where it is."""
        return name in self._fixed and name != self.body

    def is_below_odom(self, name: str) -> bool:
        """Whether a frame is ``<ns>/odom``, or hangs on it."""
        return self.odom in _chain(name, self._links)

    def is_moving(self, name: str) -> bool:
        """Whether a client has moved a frame, or one that it hangs on: it may move on. Not what hangs on the body."""
        links = self._links
        chain = _chain(name, links)
        return self.body not in chain and any(each != MAP and links[each].drift is not None for each in chain)

    def add(self, transform: Transform, now_s: float = 0.0) -> None:
        """Adds a frame, or moves one that was added before, at a time of the backend's clock; an empty parent means
        ``map``. From one move to the next, its velocity is learnt.

        Raises `UnknownFrameError` for the parent, `InvalidArgumentError` for a built-in or configured frame and for a
        loop.
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
            if child in _chain(parent, self._links):
                raise InvalidArgumentError(
                    f"transform.header.frame_id: {child} cannot hang below itself ({parent} lies below it)",
                    {"field": "transform.header.frame_id"},
                )
            link = Transform(transform.translation, transform.rotation, parent, child, transform.stamp_s)
            self._replace(link, _drift(self._links.get(child), link, now_s), now_s)

    def _replace(self, link: Transform, drift: Drift | None = None, told_s: float = 0.0) -> None:
        self._links = MappingProxyType({**self._links, link.child_frame_id: _Link(link.frame_id, link, drift, told_s)})

    def names(self) -> list[str]:
        """All frames, the root first."""
        return [MAP, *self._links]

    def frames(self, body: Pose | None) -> list[Frame]:
        """All frames with their parents."""
        result = [Frame(MAP, "", None, True)]
        for name, link in self._links.items():
            transform = self._body_transform(body) if name == self.body else link.transform
            result.append(Frame(name, link.parent, transform, name != self.body and link.drift is None))
        return result

    def lookup(self, target: str, source: str, body: Pose | None, now_s: float | None = None) -> Transform:
        """What takes coordinates in the source frame to the target frame.

        With `now_s` (backend clock), moving frames are where they have gone on to by then.

        Raises `UnknownFrameError`, and `WrongStateError` where a link of the chain is not known (yet).
        """
        links = self._links
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
            result = transform.compose(result) if result.frame_id != name else _as_given(transform, name)
        return result

    def _body_transform(self, body: Pose | None) -> Transform | None:
        if body is None:
            return None
        return Transform(body.position, body.orientation, self.odom, self.body)

    def require(self, name: str) -> None:
        """Raises `UnknownFrameError` unless there is such a frame."""
        _require(name, self._links)


def _as_given(link: Transform, child: str) -> Transform:
    """A link as the first of a chain: it is the chain."""
    return Transform(link.translation, link.rotation, link.frame_id, child)


def _drift(old: _Link | None, link: Transform, now_s: float) -> Drift | None:
    """How a frame goes on that is told where it is again: smoothed, by the client's stamps where it gives them."""
    if old is None or old.transform is None or old.parent != link.frame_id:
        return None
    before = old.transform
    are_stamped = before.stamp_s > 0.0 and link.stamp_s > 0.0
    passed_s = link.stamp_s - before.stamp_s if are_stamped else now_s - old.told_s
    last = old.drift or Drift(now_s)
    if passed_s <= 0.0:  # told twice, or out of order
        return replace(last, since_s=now_s)
    velocity = (link.translation - before.translation) / passed_s
    yaw_rate = wrap_angle((link.rotation * before.rotation.inverse()).yaw_rad) / passed_s
    if velocity.norm() > _FASTEST_M_S or passed_s > 2 * CARRIED_ON_S:
        return Drift(now_s)
    share = passed_s / (passed_s + _SMOOTHED_S)  # the first time, too: two places close in time tell little
    return Drift(
        now_s,
        last.velocity + (velocity - last.velocity) * share,
        last.yaw_rate_rad_s + (yaw_rate - last.yaw_rate_rad_s) * share,
    )


def _require(name: str, links: _Links) -> None:
    if name != MAP and name not in links:
        known = ", ".join([MAP, *links])
        raise UnknownFrameError(f"there is no frame {name}; known are {known}", {"frame_id": name, "known": known})


def _chain(name: str, links: _Links) -> list[str]:
    """A frame and all above it, up to ``map``."""
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
    """The pose levelled: its heading without roll and pitch.

    Commands in ``<ns>/base_link`` mean "ahead" and "above" of the UAV, not of its momentary tilt.
    """
    return Pose(pose.position, Quaternion.from_yaw(pose.yaw_rad))
