"""Checks of the cameras. A picture is taken with each, and nothing else is changed."""

from __future__ import annotations

from ual.cameras import CameraAbility, CameraInfo, Image, ImageFormat, ImageKind
from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.interface import Camera

_MAGIC = {ImageFormat.PNG: b"\x89PNG", ImageFormat.JPEG: b"\xff\xd8\xff"}


@check()
def lists_the_cameras(flight: Flight) -> None:
    """The cameras are numbered from 0 on. What a camera cannot do, and one that is not there, is refused."""
    listed = _all(flight)
    require([each.number for each in listed] == list(range(len(listed))), f"the numbers are no places: {listed}")
    for each in listed:
        camera = flight.uav.cameras[each.number]
        if CameraAbility.STREAMS not in each.abilities:
            flight.refuses(NotSupportedError, camera.streams, "video streams of a camera without them")
    absent = flight.uav.cameras[len(listed)]
    error = flight.refuses(InvalidArgumentError, absent.status, "the status of a camera that is not there")
    require(str(len(listed)) in error.message, f"the refusal does not name the camera: {error.message}")


@check()
def takes_a_picture(flight: Flight) -> None:
    """A picture that was taken is listed, with its number and its stamp, and is counted."""
    for info, camera in _able(flight, CameraAbility.PHOTO):
        count = len(camera.photos())
        taken = camera.take_photo()
        listed = camera.photos(taken.number)
        require(taken in listed, f"camera {info.number} took {taken}, and lists {listed}")
        require(len(camera.photos()) > count, "the picture is not listed beside those before")
        require(camera.status().photos_count > taken.number, "the picture is not counted")
        for values in ({}, {"interval_s": 1.0, "distance_m": 1.0}, {"interval_s": -1.0}, {"distance_m": 0.0}):
            flight.refuses(
                InvalidArgumentError,
                lambda camera=camera, values=values: camera.start_photos(**values),  # type: ignore[misc]
                f"photos by {values}",
            )


@check()
def shows_what_the_camera_sees(flight: Flight) -> None:
    """A picture of each kind comes as bytes of its format, with its size. A kind that is not listed is refused."""
    for info, camera in _able(flight, CameraAbility.IMAGE):
        for kind in ImageKind:
            if kind in info.image_kinds:
                _require_picture(info, camera.image(kind=kind), kind)
            else:
                flight.refuses(NotSupportedError, lambda camera=camera, kind=kind: camera.image(kind=kind), kind.name)  # type: ignore[misc]
        flight.refuses(InvalidArgumentError, lambda camera=camera: camera.image(2**31), "a picture that was not taken")  # type: ignore[misc]


def _require_picture(info: CameraInfo, image: Image, kind: ImageKind) -> None:
    require(image.kind is kind, f"camera {info.number} gives {image.kind.name} where {kind.name} was wanted")
    require(image.width_px > 0 and image.height_px > 0, f"the picture has no size: {image!r}")
    if image.format is ImageFormat.FLOAT32:
        require(len(image.data) == 4 * image.width_px * image.height_px, f"not one number a pixel: {image!r}")
    else:
        begin = image.data[: len(_MAGIC[image.format])]
        require(begin == _MAGIC[image.format], f"camera {info.number} sends {begin!r} as {image.format.name}")
    if image.intrinsics is not None:
        expected = (image.intrinsics.width_px, image.intrinsics.height_px)
        sizes = (image.width_px, image.height_px)
        require(sizes == expected, f"the intrinsics are of {expected}, and the picture has {sizes}")


def _all(flight: Flight) -> list[CameraInfo]:
    try:
        return flight.uav.cameras.get_all()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


def _able(flight: Flight, ability: CameraAbility) -> list[tuple[CameraInfo, Camera]]:
    found = [
        (each, flight.uav.cameras[each.number])
        for each in _all(flight)
        if ability in each.abilities and each.is_connected
    ]
    if not found:
        raise CannotRunError(f"no camera offers {ability.name.lower()}")
    return found


ON_GROUND = (lists_the_cameras, takes_a_picture, shows_what_the_camera_sees)
