"""`ual camera`: pictures and videos by the cameras that the UAV carries."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import click

from ual.cameras import CameraInfo, CameraMode, CameraStatus, Image, ImageFormat, ImageKind, Photo
from ual.errors import InvalidArgumentError
from ual.geometry import PoseStamped
from ual.shared import whole_file
from ual_tools import fetched, values
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table

_FILE = click.Path(path_type=Path, dir_okay=False)
_camera = click.option(
    "--camera", "number", type=click.IntRange(0), default=0, show_default=True, help="Which one, as listed."
)


@click.group(
    "camera",
    cls=UalGroup,
    section=Section.CARRIED,
    examples=(
        "ual camera list",
        "ual camera photo",
        "ual camera distance 5",
        "ual camera stop",
        "ual camera image seen.png",
        "ual camera fetch survey",
    ),
)
def camera() -> None:
    """Take pictures and videos.

    No command moves the UAV, so none needs the lease.
    """


@camera.command("list", cls=UalCommand, examples=("ual camera list",))
@pass_session
def list_cameras(session: CommandSession) -> None:
    """List the cameras, and what each can do."""
    with session.connect() as uav:
        found = uav.cameras.get_all()
    if session.as_json:
        for each in found:
            session.emit(each)
    elif found:
        print_table(("number", "name", "size", "can", "note"), [_row(each) for each in found])
    else:
        click.echo("no camera was found")


@camera.command("status", cls=UalCommand, examples=("ual camera status",))
@_camera
@pass_session
def status(session: CommandSession, number: int) -> None:
    """Print what a camera does now."""
    with session.connect() as uav:
        found = uav.cameras[number].status()
    session.emit(found, _status_text(found))


@camera.command("photo", cls=UalCommand, examples=("ual camera photo", "ual camera photo --camera 1"))
@_camera
@pass_session
def photo(session: CommandSession, number: int) -> None:
    """Take a picture."""
    with session.connect() as uav:
        taken = uav.cameras[number].take_photo()
    session.emit(taken, _photo_text(taken))


@camera.command("interval", cls=UalCommand, examples=("ual camera interval 2", "ual camera interval 0.5 --count 10"))
@click.argument("seconds", type=values.number)
@click.option("--count", type=click.IntRange(1), help="End after so many.")
@_camera
@pass_session
def interval(session: CommandSession, seconds: float, count: int | None, number: int) -> None:
    """Take a picture each SECONDS, until `stop`."""
    with session.connect() as uav:
        uav.cameras[number].start_photos(interval_s=seconds, count=count or 0)
    _done(session, "camera interval")


@camera.command("distance", cls=UalCommand, examples=("ual camera distance 5",))
@click.argument("metres", type=values.number)
@_camera
@pass_session
def distance(session: CommandSession, metres: float, number: int) -> None:
    """Take a picture each METRES that are flown, until `stop`.

    The first one is taken at once.
    """
    with session.connect() as uav:
        uav.cameras[number].start_photos(distance_m=metres)
    _done(session, "camera distance")


@camera.command("stop", cls=UalCommand, examples=("ual camera stop",))
@_camera
@pass_session
def stop(session: CommandSession, number: int) -> None:
    """Take no more pictures by time or distance."""
    with session.connect() as uav:
        uav.cameras[number].stop_photos()
    _done(session, "camera stop")


@camera.command("photos", cls=UalCommand, examples=("ual camera photos", "ual camera photos --first 100"))
@click.option("--first", type=click.IntRange(0), default=0, help="Only from this number on.")
@_camera
@pass_session
def photos(session: CommandSession, first: int, number: int) -> None:
    """List the pictures that were taken since the daemon was started."""
    with session.connect() as uav:
        found = uav.cameras[number].photos(first)
    for each in found:
        session.emit(each, _photo_text(each))


@camera.command("video", cls=UalCommand, examples=("ual camera video start", "ual camera video stop"))
@click.argument("action", type=click.Choice(["start", "stop"]))
@_camera
@pass_session
def video(session: CommandSession, action: str, number: int) -> None:
    """Record a video in the camera."""
    with session.connect() as uav:
        chosen = uav.cameras[number]
        (chosen.start_video if action == "start" else chosen.stop_video)()
    _done(session, f"camera video {action}")


@camera.command("mode", cls=UalCommand, examples=("ual camera mode video",))
@click.argument("mode", type=click.Choice([each.name.lower() for each in CameraMode]))
@_camera
@pass_session
def mode(session: CommandSession, mode: str, number: int) -> None:
    """Set the mode of a camera that has modes."""
    with session.connect() as uav:
        uav.cameras[number].set_mode(CameraMode[mode.upper()])
    _done(session, "camera mode")


@camera.command("zoom", cls=UalCommand, examples=("ual camera zoom 50",))
@click.argument("percent", type=values.number)
@_camera
@pass_session
def zoom(session: CommandSession, percent: float, number: int) -> None:
    """Zoom to PERCENT: 0 is wide."""
    with session.connect() as uav:
        uav.cameras[number].set_zoom(percent)
    _done(session, "camera zoom")


@camera.command("focus", cls=UalCommand, examples=("ual camera focus", "ual camera focus 100"))
@click.argument("percent", type=values.number, required=False)
@_camera
@pass_session
def focus(session: CommandSession, percent: float | None, number: int) -> None:
    """Focus at PERCENT: 0 is near. Without it the camera focuses by itself, once."""
    with session.connect() as uav:
        uav.cameras[number].set_focus(percent)
    _done(session, "camera focus")


@camera.command("streams", cls=UalCommand, examples=("ual camera streams",))
@_camera
@pass_session
def streams(session: CommandSession, number: int) -> None:
    """Print where its videos can be watched.

    A player such as ffplay or VLC opens the addresses.
    """
    with session.connect() as uav:
        found = uav.cameras[number].streams()
    for each in found:
        details = (each.name, each.encoding, f"{each.width_px}x{each.height_px}", f"{each.rate_hz:g} Hz")
        session.emit(each, f"{each.url} ({', '.join(filter(None, details))})")


@camera.command(
    "image",
    cls=UalCommand,
    examples=("ual camera image seen.png", "ual camera image 3.png --photo 3", "ual camera image far.pfm --kind depth"),
)
@click.argument("file", type=_FILE)
@click.option(
    "--photo", "photo_number", type=click.IntRange(0), help="A picture that was taken, in place of a new one."
)
@click.option(
    "--kind",
    type=click.Choice([each.name.lower() for each in ImageKind]),
    default="colour",
    show_default=True,
    help="What the pixels mean.",
)
@_camera
@pass_session
def image(session: CommandSession, file: Path, photo_number: int | None, kind: str, number: int) -> None:
    """Write what the camera sees to FILE.

    The format is the camera's own, whatever FILE ends in; the result names it. Depths and ranges are metres, written
    as a portable float map (PFM).
    """
    with session.connect() as uav:
        found = uav.cameras[number].image(photo_number, ImageKind[kind.upper()])
    try:
        whole_file.write(file, _portable(found) if found.format is ImageFormat.FLOAT32 else found.data)
    except OSError as error:
        raise InvalidArgumentError(f"{file}: {error.strerror}", {"field": "file"}) from None
    size = f"{found.width_px}x{found.height_px}"
    session.emit(
        {"done": "camera image", "file": str(file), "format": found.format.name, "stamp_s": found.stamp_s},
        f"{size}, {found.format.name}, {_pose_text(found.camera)}: {file}",
    )


@camera.command("fetch", cls=UalCommand, examples=("ual camera fetch survey", "ual camera fetch survey --first 100"))
@click.argument("directory", type=click.Path(path_type=Path, file_okay=False))
@click.option("--first", type=click.IntRange(0), default=0, help="Only from this number on.")
@_camera
@pass_session
def fetch(session: CommandSession, directory: Path, first: int, number: int) -> None:
    """Write what was taken into DIRECTORY, as JPEG with places.

    Each file says when, where and in which direction it was taken, for programs that make maps. Files that are there
    already are left as they are. One that cannot be had keeps none after it from being written.
    """
    with session.connect() as uav:
        fetching = fetched.Fetching(uav, number, directory)
        for each in uav.cameras[number].photos(first):
            file, what = fetching.fetch(each)
            session.emit(
                {"photo": each.number, "file": str(file), "done": what}, f"photo {each.number}: {what}: {file}"
            )
    if fetching.error is not None:
        raise fetching.error


def _done(session: CommandSession, command: str) -> None:
    session.emit({"done": command}, "done")


def _row(info: CameraInfo) -> tuple[str, str, str, str, str]:
    size = f"{info.width_px}x{info.height_px}" if info.width_px else ""
    can = ", ".join(each.name.lower() for each in sorted(info.abilities, key=lambda it: it.value))
    notes = "; ".join(filter(None, ("" if info.is_connected else "is not heard", info.note)))
    return str(info.number), info.name, size, can, notes


def _status_text(status: CameraStatus) -> str:
    storage = status.storage
    parts = [
        "" if status.mode is None else f"mode {status.mode.name.lower()}",
        f"{status.photos_count} photos",
        f"{status.missed_count} missed" if status.missed_count else "",
        f"takes one each {status.interval_s:g} s" if status.interval_s else "",
        f"takes one each {status.distance_m:g} m" if status.distance_m else "",
        f"records since {status.recording_s:.0f} s" if status.is_recording else "",
        "" if storage.state is None else f"storage {storage.state.name.lower()}",
        "" if storage.available_mib is None else f"{storage.available_mib:.0f} MiB free",
        "" if status.zoom_percent is None else f"zoom {status.zoom_percent:.0f} %",
        "" if status.battery_percent is None else f"battery {status.battery_percent:.0f} %",
    ]
    return ", ".join(filter(None, parts))


def _photo_text(photo: Photo) -> str:
    stamp = datetime.fromtimestamp(photo.stamp_s, timezone.utc).strftime("%H:%M:%S.%f")[:-3]
    failed = "" if photo.is_stored else ", failed"
    url = f", {photo.file_url}" if photo.file_url else ""
    return f"photo {photo.number} at {stamp} UTC, {_pose_text(photo.body)}{failed}{url}"


def _portable(image: Image) -> bytes:
    """Returns a portable float map: its rows begin at the bottom, and a scale below 0 says little-endian."""
    size = 4 * image.width_px
    rows = [image.data[begin : begin + size] for begin in range(0, len(image.data), size)]
    return f"Pf\n{image.width_px} {image.height_px}\n-1.0\n".encode() + b"".join(reversed(rows))


def _pose_text(pose: PoseStamped | None) -> str:
    if pose is None:
        return "place not known"
    x, y, z = pose.pose.position
    return f"{x:.2f} {y:.2f} {z:.2f} m in {pose.frame_id}"


COMMANDS = (camera,)
