"""MAVSDK's own camera server, which is a program of others, as a camera of a simulated PX4 (pip install mavsdk).

It is a component of the vehicle's system. Its bytes come over the vehicle's link, as PX4 forwards them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from typing_extensions import override

import ual
from tests.simulators import Port, Px4, UdpPort, flying
from tests.waiting import until
from ual.cameras import CameraAbility, CameraMode, StorageState
from ual.errors import NotSupportedError, RejectedByAutopilotError
from ual_daemon import UAL

mavsdk = pytest.importorskip("mavsdk", reason="no mavsdk: pip install mavsdk==4.1.0")


class Routed(Port):
    """The vehicle's link, on which a component of its system is, too."""

    def __init__(self, component: Any) -> None:
        self._port = UdpPort()
        self._component = component
        self.address = self._port.address
        self.is_cut = False
        """Whether the component is not on the link any more."""
        self.listen: Callable[[bytes], object] = lambda _: None
        """Another program on the link, which hears the component."""
        component.subscribe_raw_bytes_to_be_sent(self._from_component)

    @override
    def receive(self, now_s: float) -> list[bytes]:
        found = self._port.receive(now_s)
        for data in found:
            self._to_component(data)
        return found

    @override
    def send(self, data: bytes, now_s: float) -> None:
        self._port.send(data, now_s)
        self._to_component(data)

    @override
    def close(self) -> None:
        self._port.close()

    def _from_component(self, data: bytes) -> None:
        if not self.is_cut:
            self._port.send(bytes(data), 0.0)
            self.listen(bytes(data))

    def _to_component(self, data: bytes) -> None:
        if not self.is_cut:
            self._component.pass_received_raw_bytes(data)


class Server:
    """A camera of MAVSDK, which takes a picture at each order, unless it is told to fail."""

    def __init__(self) -> None:
        from mavsdk.plugins import camera_server as plugin

        self.plugin = plugin
        configuration = mavsdk.Configuration.create_manual(1, 100, True)
        self.component = mavsdk.Mavsdk(configuration)
        self.component.add_any_connection("raw://")
        self.camera = camera = plugin.CameraServer(self.component.server_component_by_id(100))
        self.feedback = plugin.CameraFeedback.OK
        self.storage_mib = (1000.0, 400.0)
        self.orders: list[Any] = []
        self._taken_count = 0
        for name, answer in {
            "take_photo": self._take,
            "start_video": lambda _: camera.respond_start_video(self.feedback),
            "stop_video": lambda _: camera.respond_stop_video(self.feedback),
            "set_mode": lambda _: camera.respond_set_mode(self.feedback),
            "zoom_range": lambda _: camera.respond_zoom_range(self.feedback),
            "focus_range": lambda _: camera.respond_focus_range(self.feedback),
            "storage_information": self._tell_storage,
            "capture_status": self._tell_status,
        }.items():
            getattr(camera, f"subscribe_{name}")(self._noted(name, answer))
        camera.set_information(
            plugin.Information(
                vendor_name="MAVSDK",
                model_name="Server",
                firmware_version="1.2.3.4",
                focal_length_mm=3.0,
                horizontal_sensor_size_mm=3.68,
                vertical_sensor_size_mm=2.76,
                horizontal_resolution_px=3280,
                vertical_resolution_px=2464,
            )
        )
        camera.set_video_streaming(plugin.VideoStreaming(has_rtsp_server=True, rtsp_uri="rtsp://10.0.0.2/live"))

    def _noted(self, name: str, answer: Any) -> Any:
        def on_order(value: Any, _: Any) -> None:
            self.orders.append((name, value))
            answer(value)

        return on_order

    def _take(self, _: Any) -> None:
        plugin = self.plugin
        index, self._taken_count = self._taken_count, self._taken_count + 1
        taken = plugin.CaptureInfo(
            position=plugin.Position(47.4, 8.5, 500.0, 20.0),
            attitude_quaternion=plugin.Quaternion(1.0, 0.0, 0.0, 0.0),
            time_utc_us=1_800_000_000_000_000 + index,
            is_success=True,
            index=index,
            file_url=f"http://camera/{index}.jpg",
        )
        self.camera.respond_take_photo(self.feedback, taken)

    def _tell_storage(self, storage_id: Any) -> None:
        total, free = self.storage_mib
        plugin = self.plugin.StorageInformation
        told = plugin(total - free, free, total, plugin.StorageStatus.FORMATTED, 1, plugin.StorageType.SD, 10.0, 10.0)
        self.camera.respond_storage_information(self.plugin.CameraFeedback.OK, told)

    def _tell_status(self, _: Any) -> None:
        plugin = self.plugin.CaptureStatus
        told = plugin(0.0, 0.0, 400.0, plugin.ImageStatus(0), plugin.VideoStatus(0), self._taken_count)
        self.camera.respond_capture_status(self.plugin.CameraFeedback.OK, told)


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.component.destroy()


@pytest.fixture
def port(server: Server) -> Routed:
    return Routed(server.component)


@pytest.fixture
def uav(port: Routed) -> Iterator[UAL]:
    autopilot = Px4(port)
    url = f"udpout://127.0.0.1:{port.address[1]}"
    with flying(autopilot), UAL("mavlink", url=url) as uav:
        until(lambda: any(each.abilities for each in uav.cameras.get_all()), seen=uav.cameras.get_all)
        yield uav


def test_it_is_found_and_driven_through_all(uav: UAL, server: Server) -> None:
    [info] = uav.cameras.get_all()
    camera = uav.cameras[0]
    assert (info.number, info.name, info.is_connected) == (0, "MAVSDK Server", True)
    assert (info.width_px, info.height_px) == (3280, 2464)
    assert info.intrinsics is not None
    assert info.intrinsics.focal_length_x_px == pytest.approx(3.0 / 3.68 * 3280.0)
    taken = [camera.take_photo() for _ in range(3)]
    assert [each.file_url for each in taken] == [f"http://camera/{index}.jpg" for index in range(3)]
    assert taken[0].position_geo is not None
    assert taken[0].position_geo.latitude_deg == pytest.approx(47.4)
    assert taken[0].stamp_s == pytest.approx(1.8e9)
    assert camera.photos() == taken
    assert [name for name, _ in server.orders].count("take_photo") == 3
    status = camera.status()
    assert status.storage.state is StorageState.READY
    assert (status.storage.total_mib, status.storage.available_mib) == (1000.0, 400.0)
    assert status.photos_count == 3
    if CameraAbility.MODES in info.abilities:
        camera.set_mode(CameraMode.VIDEO)
    if CameraAbility.VIDEO in info.abilities:
        camera.start_video()
        camera.stop_video()
    assert {name for name, _ in server.orders} >= {"take_photo", "start_video", "stop_video", "set_mode"}
    assert camera.status().mode is CameraMode.PHOTO  # MAVSDK 4.1 says so whatever was set
    assert [each.url for each in camera.streams()] == ["rtsp://10.0.0.2/live"]
    with pytest.raises(NotSupportedError, match="does not offer image"):
        camera.image()


def test_what_it_refuses_is_reported_in_its_words(uav: UAL, server: Server) -> None:
    camera = uav.cameras[0]
    server.feedback = server.plugin.CameraFeedback.FAILED
    with pytest.raises(RejectedByAutopilotError, match=r"camera 0 \(MAVSDK Server\) refused"):
        camera.start_video()
    with pytest.raises(ual.UalError):
        camera.take_photo()
    server.storage_mib = (100.0, 0.0)
    assert camera.status().storage.state is StorageState.FULL


def test_one_that_vanishes_is_reported_and_not_waited_for(uav: UAL, port: Routed) -> None:
    port.is_cut = True
    until(lambda: not uav.cameras.get_all()[0].is_connected, seen=uav.cameras.get_all)
    with pytest.raises(ual.LinkLostError, match="is not heard: its last message came"):
        uav.cameras[0].take_photo()


def test_pictures_by_distance_are_counted_by_the_daemon(uav: UAL) -> None:
    camera = uav.cameras[0]
    camera.start_photos(distance_m=50.0)
    until(lambda: len(camera.photos()) == 1, seen=camera.photos)
    assert camera.status().distance_m == 50.0
    camera.stop_photos()
    assert not camera.status().is_taking_photos


ASKED = {"storage_information", "capture_status"}
"""Commands that only ask."""


class Client:
    """MAVSDK's own client, a ground station on the same link."""

    def __init__(self, server: Server, port: Routed) -> None:
        from mavsdk.plugins import camera

        self.plugin = camera
        station = mavsdk.ComponentType.GROUND_STATION
        self.station = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(station))
        self.station.add_any_connection("raw://")
        self._to_station, self._to_server = ThreadPoolExecutor(1), ThreadPoolExecutor(1)
        """Not on the thread that sends: each library holds its lock there, and the other one waits for it."""
        port.listen = lambda data: self._to_station.submit(self.station.pass_received_raw_bytes, data)
        self.station.subscribe_raw_bytes_to_be_sent(
            lambda data: self._to_server.submit(server.component.pass_received_raw_bytes, bytes(data))
        )
        [system] = until(self.station.get_systems, "the system is found")
        self.camera = camera.Camera(system)
        until(lambda: self.camera.camera_list().cameras, "the camera is found")

    def close(self) -> None:
        for each in (self._to_station, self._to_server):
            each.shutdown()
        self.camera.destroy()
        self.station.destroy()


@pytest.fixture
def client(server: Server, port: Routed) -> Iterator[Client]:
    client = Client(server, port)
    yield client
    port.listen = lambda _: None
    client.close()


def test_mavsdks_own_client_does_the_same_to_it(uav: UAL, server: Server, client: Client) -> None:
    """Each order by both: the camera is ordered the same. Each sees the pictures of both."""
    ours, theirs, number, modes = uav.cameras[0], client.camera, 100, client.plugin.Mode
    assert uav.cameras.get_all()[0].name == " ".join(
        (theirs.camera_list().cameras[0].vendor_name, theirs.camera_list().cameras[0].model_name)
    )

    def done(order: Callable[[], object]) -> list[Any]:
        server.orders.clear()
        order()
        return [each for each in server.orders if each[0] not in ASKED]

    for name, by_us, by_them in (
        ("start_video", ours.start_video, lambda: theirs.start_video(number)),
        ("stop_video", ours.stop_video, lambda: theirs.stop_video(number)),
        (
            "set_mode",
            lambda: ours.set_mode(CameraMode.VIDEO),
            lambda: theirs.set_mode(number, modes.VIDEO),
        ),
        (
            "set_mode",
            lambda: ours.set_mode(CameraMode.PHOTO),
            lambda: theirs.set_mode(number, modes.PHOTO),
        ),
        ("zoom_range", lambda: ours.set_zoom(40.0), lambda: theirs.zoom_range(number, 40.0)),
        ("focus_range", lambda: ours.set_focus(60.0), lambda: theirs.focus_range(number, 60.0)),
    ):
        ordered = done(by_us)
        assert [each[0] for each in ordered] == [name]
        assert done(by_them) == ordered
    assert [each[0] for each in done(ours.take_photo)] == ["take_photo"]
    assert [each[0] for each in done(lambda: theirs.take_photo(number))] == ["take_photo"]
    until(lambda: len(ours.photos()) == 2, seen=ours.photos)

    def received_by_them() -> list[str]:
        return [each.file_url for each in theirs.list_photos(number, client.plugin.PhotosRange(0))]

    until(lambda: received_by_them() == [each.file_url for each in ours.photos()], seen=received_by_them)


def test_what_it_refuses_is_refused_to_both(uav: UAL, server: Server, client: Client) -> None:
    server.feedback = server.plugin.CameraFeedback.FAILED
    with pytest.raises(RejectedByAutopilotError):
        uav.cameras[0].start_video()
    with pytest.raises(client.plugin.CameraError):
        client.camera.start_video(100)
