"""`ual camera`, the clients and the service, with a daemon of a light UAV."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import grpc
import PIL.Image
import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.waiting import until
from ual._derived_parts import Camera
from ual.cameras import CameraMode, CameraStatus, Image, Photo
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.recording.reader import Recording
from ual.v1 import camera_pb2, camera_pb2_grpc
from ual.wire.images import CHUNK_BYTES, image_from_protos
from ual_tools.main import cli


@pytest.fixture
def daemon(start_daemon: StartDaemon, tmp_path: Path) -> DaemonProcess:
    file = tmp_path / "daemon.yaml"
    file.write_text(
        "light: {cameras: [{width_px: 320, height_px: 240, noise: 9.0}, {name: forward, mount_pitch_rad: 0.0}]}\n"
    )
    return start_daemon("--config", str(file), backend="light")


def run(daemon: DaemonProcess, *words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *map(str, words)])


def done(daemon: DaemonProcess, *words: str | Path) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_does_all(daemon: DaemonProcess, tmp_path: Path) -> None:
    listed = [json.loads(line) for line in done(daemon, "--json", "camera", "list").splitlines()]
    assert [(each["number"], each["name"], each["width_px"]) for each in listed] == [
        (0, "light camera", 320),
        (1, "forward", 640),
    ]
    assert "forward" in done(daemon, "camera", "list")
    assert "photo 0 at " in done(daemon, "camera", "photo")
    done(daemon, "camera", "interval", "0.1", "--count", "2", "--camera", "1")
    done(daemon, "camera", "stop", "--camera", "1")
    done(daemon, "camera", "distance", "5")
    assert "takes one each 5 m" in done(daemon, "camera", "status")
    done(daemon, "camera", "stop")
    done(daemon, "camera", "video", "start")
    done(daemon, "camera", "mode", "survey")
    done(daemon, "camera", "zoom", "50")
    status = json.loads(done(daemon, "--json", "camera", "status"))
    assert (status["is_recording"], status["mode"], status["zoom_percent"]) == (True, "SURVEY", 50.0)
    done(daemon, "camera", "video", "stop")
    assert done(daemon, "camera", "photos").count("photo ") == 2
    assert done(daemon, "camera", "photos", "--first", "1").count("photo ") == 1
    file = tmp_path / "seen.png"
    assert "320x240, PNG, " in done(daemon, "camera", "image", file, "--photo", "1")
    assert file.read_bytes()[:4] == b"\x89PNG"
    far = tmp_path / "far.pfm"
    assert "320x240, FLOAT32, " in done(daemon, "camera", "image", far, "--kind", "range")
    header, size, scale, numbers = far.read_bytes().split(b"\n", 3)
    assert (header, size, scale, len(numbers)) == (b"Pf", b"320 240", b"-1.0", 4 * 320 * 240)
    for words in (("streams",), ("focus",), ("image", file, "--photo", "99"), ("status", "--camera", "2")):
        refused = run(daemon, "camera", *words)
        assert refused.exit_code == 1, refused.output


def test_both_clients_have_the_same_values_and_errors(daemon: DaemonProcess) -> None:
    async def ask() -> tuple[Photo, list[Photo], CameraStatus, Image]:
        async with ual.aio.Uav(address=daemon.address) as uav:
            camera = uav.cameras[0]
            with pytest.raises(NotSupportedError, match="does not offer streams"):
                await camera.streams()
            with pytest.raises(InvalidArgumentError, match=r"^distance_m: "):
                await camera.start_photos(distance_m=-1.0)
            await camera.set_mode(CameraMode.VIDEO)
            taken = await camera.take_photo()
            found = [each async for each in uav.cameras]
            assert len(found) == 2
            return taken, await camera.photos(), await camera.status(), await camera.image(taken.number)

    taken, listed, status, image = asyncio.run(ask())
    assert listed == [taken]
    assert status.mode is CameraMode.VIDEO
    with ual.Uav(address=daemon.address) as uav:
        camera = uav.cameras[0]
        assert camera.photos() == listed
        assert camera.image(taken.number) == image
        assert len(image.data) > 2 * CHUNK_BYTES  # noise does not compress
        assert (image.width_px, image.height_px) == (320, 240)
        assert image.stamp_s == pytest.approx(taken.stamp_s, abs=1e-6)
        assert image.camera is not None
        assert image.intrinsics == uav.cameras.get_all()[0].intrinsics
        assert [repr(each).startswith("<Camera ") for each in uav.cameras] == [True, True]
        with pytest.raises(InvalidArgumentError, match="there is no picture 5"):
            camera.image(5)
        bad = uav.cameras[-1]
        with pytest.raises(InvalidArgumentError, match="camera"):
            bad.status()


def test_a_lease_keeps_nobody_from_taking_pictures(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as holder, ual.Uav(address=daemon.address) as other, holder.lease("holder"):
        assert other.cameras[0].take_photo().number == 0


def test_a_program_that_does_not_read_its_picture_keeps_no_other_one_from_theirs(daemon: DaemonProcess) -> None:
    with grpc.insecure_channel(daemon.address) as channel, ual.Uav(address=daemon.address) as uav:
        stub = camera_pb2_grpc.CameraServiceStub(channel)
        unread = [stub.GetImage(camera_pb2.GetImageRequest(camera=0, max_age_s=60.0)) for _ in range(3)]
        seen = uav.cameras[0].image(max_age_s=60.0)
        assert len(seen.data) > CHUNK_BYTES
        for each in unread:
            assert image_from_protos(list(each)) == seen
        assert uav.cameras[0].image().data != seen.data


def test_pictures_are_fetched_once_as_files_with_their_positions(daemon: DaemonProcess, tmp_path: Path) -> None:
    for _ in range(2):
        done(daemon, "camera", "photo")
    directory = tmp_path / "set" / "one"
    told = [json.loads(line) for line in done(daemon, "--json", "camera", "fetch", directory).splitlines()]
    assert [(each["photo"], each["done"]) for each in told] == [(0, "written"), (1, "written")]
    files = sorted(directory.iterdir())
    assert [str(each) for each in files] == [each["file"] for each in told]
    assert re.fullmatch(rf"{daemon.ns}_camera_0_\d{{8}}T\d{{9}}_00000\.jpg", files[0].name)
    with ual.Uav(address=daemon.address) as uav:
        [photo] = uav.cameras[0].photos(1)
    assert photo.position_geo is not None
    with PIL.Image.open(files[1]) as picture:
        tags = picture.getexif()
    degrees, minutes, seconds = map(float, tags.get_ifd(0x8825)[2])
    assert degrees + minutes / 60 + seconds / 3600 == pytest.approx(photo.position_geo.latitude_deg, abs=2e-9)
    assert tags[0x0110] == "light camera"
    files[0].unlink()
    assert done(daemon, "camera", "fetch", directory).count(": is there: ") == 1
    assert done(daemon, "camera", "fetch", directory, "--first", "2") == ""
    blocked = tmp_path / "file"
    blocked.write_text("")
    refused = run(daemon, "camera", "fetch", blocked / "in")
    assert refused.exit_code == 1
    assert "Not a directory" in refused.output


def test_a_picture_that_cannot_be_had_keeps_none_after_it_from_being_fetched(
    daemon: DaemonProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(3):
        done(daemon, "camera", "photo")
    given = Camera.image

    def image(self: Camera, photo: int | None = None, **options: Any) -> Image:
        if photo == 1:
            raise InvalidArgumentError("photo: the bytes of picture 1 are kept no more", {"field": "photo"})
        return given(self, photo, **options)

    monkeypatch.setattr(Camera, "image", image)
    told = run(daemon, "camera", "fetch", tmp_path)
    assert [each.name[-9:] for each in sorted(tmp_path.glob("*.jpg"))] == ["00000.jpg", "00002.jpg"]
    assert "photo 1: failed: photo: the bytes of picture 1 are kept no more" in told.output
    assert told.exit_code == 1


def test_pictures_are_recorded_where_that_is_requested(daemon: DaemonProcess, tmp_path: Path) -> None:
    words = ["--json", "--address", daemon.address, "record", "--directory", str(tmp_path), "--pictures"]
    command = [sys.executable, "-c", "from ual_tools.main import main; main()", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith("recording uav_1 into ")
        with ual.Uav(address=daemon.address) as uav:
            taken = uav.cameras[0].take_photo()
            wanted = uav.cameras[0].image(taken.number).data
            file = next(iter(tmp_path.glob("*.mcap")))
            until(lambda: any(wanted in each.data for each in Recording(file).messages()), "the picture is in the file")
        process.send_signal(signal.SIGINT)
        told = json.loads(process.communicate(timeout=60.0)[0])
    assert (told["pictures_count"], told["pictures_without_bytes_count"]) == (1, 0)
    topics = json.loads(run(daemon, "--json", "record", "info", file).stdout)["topics"]
    found = {name: each["count"] for name, each in topics.items() if "camera" in name}
    assert found == {f"/uav_1/camera_0/{name}": 1 for name in ("photos", "image", "calibration", "tf")}
