"""The tree of frames: ``map`` -> ``<ns>/odom`` -> ``<ns>/base_link``, and those that are added."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ual.errors import InvalidArgumentError, UnknownFrameError, WrongStateError
from ual.geometry import IDENTITY, Pose, Quaternion, Transform, Vector3
from ual.types import Frame
from ual_daemon.settings import ConfigError, VehicleSettings

MAP = "map"


@dataclass(frozen=True, slots=True)
class _Link:
    """Where a frame hangs; `transform` takes it to its parent, None where that is not known yet (or the body's)."""

    parent: str
    transform: Transform | None


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

    def add(self, transform: Transform) -> None:
        """Adds a frame, or moves one that was added before; an empty parent means ``map``.

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
            self._replace(Transform(transform.translation, transform.rotation, parent, child, transform.stamp_s))

    def _replace(self, link: Transform) -> None:
        self._links = MappingProxyType({**self._links, link.child_frame_id: _Link(link.frame_id, link)})

    def names(self) -> list[str]:
        """All frames, the root first."""
        return [MAP, *self._links]

    def frames(self, body: Pose | None) -> list[Frame]:
        """All frames with their parents."""
        result = [Frame(MAP, "", None, True)]
        for name, link in self._links.items():
            transform = self._body_transform(body) if name == self.body else link.transform
            result.append(Frame(name, link.parent, transform, name != self.body))
        return result

    def lookup(self, target: str, source: str, body: Pose | None) -> Transform:
        """What takes coordinates in the source frame to the target frame.

        Raises `UnknownFrameError`, and `WrongStateError` where a link of the chain is not known (yet).
        """
        links = self._links
        _require(target, links)
        _require(source, links)
        if target == source:
            return Transform(Vector3(), IDENTITY, target, source)
        up_from_target = _chain(target, links)
        common = next(name for name in _chain(source, links) if name in up_from_target)
        to_common = self._climb(source, common, links, body)
        return self._climb(target, common, links, body).inverse().compose(to_common)

    def _climb(self, name: str, ancestor: str, links: _Links, body: Pose | None) -> Transform:
        result = Transform(Vector3(), IDENTITY, name, name)
        while result.frame_id != ancestor:
            child = result.frame_id
            transform = self._body_transform(body) if child == self.body else links[child].transform
            if transform is None:
                raise WrongStateError(f"it is not known yet where the frame {child} is in {links[child].parent}")
            result = transform.compose(result)
        return result

    def _body_transform(self, body: Pose | None) -> Transform | None:
        if body is None:
            return None
        return Transform(body.position, body.orientation, self.odom, self.body)

    def require(self, name: str) -> None:
        """Raises `UnknownFrameError` unless there is such a frame."""
        _require(name, self._links)


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
