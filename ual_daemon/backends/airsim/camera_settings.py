"""The cameras of a vehicle, by the simulator's settings.json."""

from __future__ import annotations

import json
import logging
import math
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

from ual.cameras import ImageKind

_log = logging.getLogger(__name__)

TYPES = {ImageKind.COLOUR: 0, ImageKind.DEPTH: 1, ImageKind.RANGE: 2, ImageKind.SEGMENTATION: 5}
"""`ImageCaptureBase::ImageType`: Scene, DepthPlanar, DepthPerspective, Segmentation."""
OF_EACH_MULTIROTOR = ("front_center", "front_right", "front_left", "bottom_center", "back_center")
"""Cameras of a multirotor without any settings. They have numbers and other names, too, which are not listed."""


class Capture(msgspec.Struct, frozen=True):
    """Picture settings of a camera for one image type. Without an entry, the simulator's own defaults."""

    image_type: int = msgspec.field(name="ImageType", default=0)
    width_px: Annotated[int, Meta(ge=1)] = msgspec.field(name="Width", default=256)
    height_px: Annotated[int, Meta(ge=1)] = msgspec.field(name="Height", default=144)
    view_deg: Annotated[float, Meta(gt=0.0, lt=180.0)] | None = msgspec.field(name="FOV_Degrees", default=None)
    projection: str = msgspec.field(name="ProjectionMode", default="")

    @property
    def tangent(self) -> float | None:
        """The tangent of half the angle of its view along the longer side; None where the settings do not say it."""
        return None if self.view_deg is None else math.tan(math.radians(self.view_deg) / 2.0)

    @property
    def is_pinhole(self) -> bool:
        """Whether it projects as a pinhole does."""
        return self.projection.lower() != "orthographic"


class _CameraEntry(msgspec.Struct, frozen=True):
    captures: tuple[Capture, ...] = msgspec.field(name="CaptureSettings", default=())


class _Vehicle(msgspec.Struct, frozen=True):
    cameras: dict[str, _CameraEntry] = msgspec.field(name="Cameras", default_factory=dict)


class _Settings(msgspec.Struct, frozen=True):
    defaults: _CameraEntry = msgspec.field(name="CameraDefaults", default=_CameraEntry())
    vehicles: dict[str, _Vehicle] = msgspec.field(name="Vehicles", default_factory=dict)


class NamedCamera(NamedTuple):
    """A camera by its name, with the captures that the settings name."""

    name: str
    captures: tuple[Capture, ...] = ()

    def capture(self, kind: ImageKind) -> Capture:
        """Returns how it makes a kind of pictures."""
        number = TYPES[kind]
        found = [each for each in self.captures if each.image_type == number]
        return found[-1] if found else Capture(number)


def cameras_of(settings: str, vehicle: str) -> tuple[NamedCamera, ...]:
    """Returns the cameras of a vehicle: first those that each has. The settings are those that the simulator tells."""
    try:
        found = msgspec.convert(json.loads(settings or "{}"), _Settings)
    except ValueError as error:
        _log.warning("the simulator's settings of cameras are not understood, and its defaults are taken: %s", error)
        found = _Settings()
    own = found.vehicles.get(vehicle, _Vehicle()).cameras
    names = (*OF_EACH_MULTIROTOR, *(name for name in own if name not in OF_EACH_MULTIROTOR))
    defaults = found.defaults.captures
    return tuple(NamedCamera(name, (*defaults, *own[name].captures) if name in own else defaults) for name in names)
