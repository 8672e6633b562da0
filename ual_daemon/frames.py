"""The tree of frames: ``map`` -> ``<ns>/odom`` -> ``<ns>/base_link``, and those that are added."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from types import MappingProxyType

from ual.errors import InvalidArgumentError, UnknownFrameError, WrongStateError
from ual.geometry import IDENTITY, Pose, Quaternion, Transform, Vector3
from ual.types import Frame

from ual_daemon.settings import ConfigError, VehicleSettings

MAP = "map"


class FrameTree:
    """All frames of one UAV. Every member may be called from any thread.

    The body moves, so its pose in ``<ns>/odom`` is handed in by the caller where a chain may pass it; None where it is
    not known. Links are replaced as a whole (copy on write): readers take no lock.
    """

    def __init__(self, ns: str, settings: VehicleSettings) -> None:
        self.odom = f"{ns}/odom"
        self.body = f"{ns}/base_link"
        self._lock = threading.Lock()
        # Child -> transform to its parent; None where it is not known yet.
        self._links: Mapping[str, Transform | None] = MappingProxyType({})
        self._parents: Mapping[str, str] = MappingProxyType({self.body: self.odom})
        self._fixed = {MAP, self.odom, self.body, *(frame.frame_id for frame in settings.frames)}
        self._build(settings)

    def _build(self, settings: VehicleSettings) -> None:
        home: Transform | None = Transform(
            Vector3(*settings.home_pose), IDENTITY, settings.home_pose_parent_frame, self.odom
        )
        if settings.map_origin_geo is not None:
            home = None  # follows from the autopilot's position: set_home
        links: dict[str, Transform | None] = {self.odom: home}
        parents = {self.odom: settings.home_pose_parent_frame, self.body: self.odom}
        for index, frame in enumerate(settings.frames):
            if frame.frame_id in parents or frame.frame_id == MAP:
                raise ConfigError(f"the frame {frame.frame_id} is there already", f"frames[{index}].frame_id")
            turn = Quaternion.from_euler(frame.roll_rad, frame.pitch_rad, frame.yaw_rad)
            links[frame.frame_id] = Transform(Vector3(*frame.translation), turn, frame.parent_frame_id, frame.frame_id)
            parents[frame.frame_id] = frame.parent_frame_id
        for index, frame in enumerate(settings.frames):
            if not _leads_to_map(frame.frame_id, parents):
                raise ConfigError(
                    f"the frame {frame.frame_id} does not lead to {MAP}: its parent {frame.parent_frame_id} is not "
                    "known, or they make a loop",
                    f"frames[{index}].parent_frame_id",
                )
        if not _leads_to_map(self.odom, parents):
            raise ConfigError(
                f"the frame {settings.home_pose_parent_frame} is not known, or lies below {self.odom}",
                "home_pose_parent_frame",
            )
        if settings.pose_frame_id is not None and settings.pose_frame_id not in {MAP, *parents}:
            raise ConfigError(f"the frame {settings.pose_frame_id} is not known", "pose_frame_id")
        self._links, self._parents = MappingProxyType(links), MappingProxyType(parents)

    def set_home(self, position_in_map: Vector3) -> None:
        """Puts ``<ns>/odom`` at a position in ``map``."""
        with self._lock:
            self._replace(Transform(position_in_map, IDENTITY, MAP, self.odom))

    def has_home(self) -> bool:
        """Whether it is known where ``<ns>/odom`` lies."""
        return self._links[self.odom] is not None

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
            if child in self._chain(parent):
                raise InvalidArgumentError(
                    f"transform.header.frame_id: {child} cannot hang below itself ({parent} lies below it)",
                    {"field": "transform.header.frame_id"},
                )
            self._replace(Transform(transform.translation, transform.rotation, parent, child, transform.stamp_s))

    def _replace(self, link: Transform) -> None:
        self._parents = MappingProxyType({**self._parents, link.child_frame_id: link.frame_id})
        self._links = MappingProxyType({**self._links, link.child_frame_id: link})

    def names(self) -> list[str]:
        """All frames, the root first."""
        return [MAP, *self._parents]

    def frames(self, body: Pose | None) -> list[Frame]:
        """All frames with their parents."""
        links = self._links
        result = [Frame(MAP, "", None, True)]
        for child, parent in self._parents.items():
            link = self._body_link(body) if child == self.body else links.get(child)
            result.append(Frame(child, parent, link, child != self.body))
        return result

    def lookup(self, target: str, source: str, body: Pose | None) -> Transform:
        """What takes coordinates in the source frame to the target frame.

        Raises `UnknownFrameError`, and `WrongStateError` where a link of the chain is not known (yet).
        """
        self.require(target)
        self.require(source)
        if target == source:
            return Transform(Vector3(), IDENTITY, target, source)
        up_from_target = self._chain(target)
        common = next(name for name in self._chain(source) if name in up_from_target)
        to_common = self._climb(source, common, body)
        return self._climb(target, common, body).inverse().compose(to_common)

    def _climb(self, name: str, ancestor: str, body: Pose | None) -> Transform:
        result = Transform(Vector3(), IDENTITY, name, name)
        while result.frame_id != ancestor:
            child = result.frame_id
            link = self._body_link(body) if child == self.body else self._links[child]
            if link is None:
                raise WrongStateError(f"it is not known yet where the frame {child} is in {self._parents[child]}")
            result = link.compose(result)
        return result

    def _body_link(self, body: Pose | None) -> Transform | None:
        if body is None:
            return None
        return Transform(body.position, body.orientation, self.odom, self.body)

    def _chain(self, name: str) -> list[str]:
        chain = [name]
        while name != MAP:
            name = self._parents[name]
            chain.append(name)
        return chain

    def require(self, name: str) -> None:
        """Raises `UnknownFrameError` unless there is such a frame."""
        if name != MAP and name not in self._parents:
            known = ", ".join(self.names())
            raise UnknownFrameError(f"there is no frame {name}; known are {known}", {"frame_id": name, "known": known})


def _leads_to_map(name: str, parents: Mapping[str, str]) -> bool:
    seen: set[str] = set()
    while name != MAP:
        if name in seen or name not in parents:
            return False
        seen.add(name)
        name = parents[name]
    return True


def horizontal(pose: Pose) -> Pose:
    """The pose levelled: its heading without roll and pitch.

    Commands in ``<ns>/base_link`` mean "ahead" and "above" of the UAV, not of its momentary tilt.
    """
    return Pose(pose.position, Quaternion.from_yaw(pose.yaw_rad))
