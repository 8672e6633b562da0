"""The links: real sockets, a stand-in for cflib's drivers, and what is said of wrong URLs and missing parts."""

from __future__ import annotations

import contextlib
import errno
import queue
import socket
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest
from cflib.crtp.crtpstack import CRTPPacket
from cflib.drivers import crazyradio

from tests.waiting import LIMIT_S, until
from ual.geometry import Vector3
from ual_daemon.backends import registry
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.crazyflie import CrazyflieBackend, links, packets
from ual_daemon.backends.crazyflie.links import CflibLink, CrtpLinkError, CrtpUdpLink, ScannedLink, make_link
from ual_daemon.backends.crazyflie.outbox import MOST_PACKETS, OLDEST_PACKET_S, OLDEST_POSE_S, PacketOutbox
from ual_daemon.backends.crazyflie.packets import CrtpPacket
from ual_daemon.backends.crazyflie.session import CrazyflieSession
from ual_daemon.backends.crazyflie.settings import CrazyflieSettings
from ual_daemon.settings import ConfigError

RADIO = "radio://0/80/2M/E7E7E7E7E7"
PACKET = CrtpPacket(5, 1, b"\x05")


def received(link: links.CrtpLink) -> list[CrtpPacket]:
    found: list[CrtpPacket] = []

    def has_come() -> bool:
        found.extend(link.receive(0.05))
        return bool(found)

    until(has_come)
    return found


def test_udp_both_directions() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as firmware:
        firmware.bind(("127.0.0.1", 0))
        firmware.settimeout(LIMIT_S)
        link = CrtpUdpLink(*firmware.getsockname())
        link.open()
        link.send(PACKET)
        data, client = firmware.recvfrom(64)
        assert CrtpPacket.decode(data) == PACKET
        firmware.sendto(b"\xff", client)  # empty
        firmware.sendto(PACKET.encode(), client)
        assert received(link) == [PACKET]
        link.close()


def test_udp_to_nobody_is_silence() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    link = CrtpUdpLink("127.0.0.1", port)
    link.open()
    for _ in range(5):
        link.send(PACKET)
        assert link.receive(0.01) == []
    link.close()
    link.send(PACKET)  # is lost


class BrokenSocket:
    """A socket with an error that waits."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._near, self._far = socket.socketpair()
        self._far.send(b"x")

    def fileno(self) -> int:
        return self._near.fileno()

    def recv(self, _: int) -> bytes:
        raise OSError(self._number, "an error")

    def close(self) -> None:
        self._near.close()
        self._far.close()


@pytest.mark.parametrize("number", [errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ECONNREFUSED])
def test_a_host_that_cannot_be_reached_now_is_silence(number: int) -> None:
    link = CrtpUdpLink("127.0.0.1", 9)
    link._socket = BrokenSocket(number)  # type: ignore[assignment]
    assert link.receive(LIMIT_S) == []
    link.close()


def test_any_other_error_of_the_socket_is_one_of_the_link() -> None:
    link = CrtpUdpLink("127.0.0.1", 9)
    link._socket = BrokenSocket(errno.ENOMEM)  # type: ignore[assignment]
    with pytest.raises(CrtpLinkError, match="an error"):
        link.receive(LIMIT_S)
    link.close()


def test_a_name_that_no_host_can_have_is_an_error_of_the_link() -> None:
    with pytest.raises(CrtpLinkError):
        CrtpUdpLink("crazy..lab", 19850).open()


@pytest.mark.parametrize("is_opened_later", [False, True])
def test_a_link_that_is_closed_while_it_is_being_opened_is_closed_in_the_end(*, is_opened_later: bool) -> None:
    closed, may_open, is_opening = threading.Event(), threading.Event(), threading.Event()

    class SlowLink(CrtpUdpLink):
        def open(self) -> None:
            is_opening.set()
            may_open.wait(LIMIT_S)
            super().open()

        def close(self) -> None:
            super().close()
            if may_open.is_set():
                closed.set()

    link = SlowLink("127.0.0.1", 9)
    if not is_opened_later:
        may_open.set()
    session = CrazyflieSession(link, CrazyflieSettings(), MonotonicClock(), lambda _: None, 1.0)
    session.thread.open()
    assert is_opening.wait(LIMIT_S)
    session.thread.close()
    may_open.set()
    assert closed.wait(LIMIT_S)
    until(lambda: link._socket is None)


class Driver:
    """As cflib's."""

    def __init__(self) -> None:
        self.sent: queue.Queue[CRTPPacket] = queue.Queue()
        self.arriving: queue.Queue[CRTPPacket] = queue.Queue()
        self.is_closed = False

    def receive_packet(self, wait: float) -> CRTPPacket | None:
        try:
            return self.arriving.get(wait > 0, wait or None)
        except queue.Empty:
            return None

    def send_packet(self, packet: CRTPPacket) -> None:
        self.sent.put(packet)

    def close(self) -> None:
        self.is_closed = True


class Crtp:
    """Stands in for the module `cflib.crtp`."""

    def __init__(self) -> None:
        self.driver = Driver()
        self.found: tuple[str, ...] = ()
        self.error = ""

    @property
    def CLASSES(self) -> list[type]:  # noqa: N802  as cflib calls it
        """Its drivers: each finds the Crazyflies of its own scheme."""

        def scan_interface(scheme: str) -> list[list[str]]:
            return [[url, ""] for url in self.found if url.startswith(scheme)]

        class RadioDriver:
            def scan_interface(self, _: None) -> list[list[str]]:
                return scan_interface("radio:")

        class UsbDriver:
            def scan_interface(self, _: None) -> list[list[str]]:
                return scan_interface("usb:")

        return [RadioDriver, UsbDriver]

    def get_link_driver(self, url: str, _: object, on_error: Callable[[str], None]) -> Driver:
        if self.error:
            raise OSError(self.error)
        self.on_error = on_error
        return self.driver


@pytest.fixture
def crtp(monkeypatch: pytest.MonkeyPatch) -> Crtp:
    stand_in = Crtp()
    monkeypatch.setattr(links, "load_cflib", lambda: stand_in)
    monkeypatch.setattr(crazyradio, "get_serials", lambda: ("a dongle",))
    return stand_in


def test_a_radio_both_directions(crtp: Crtp) -> None:
    link = make_link(RADIO)
    assert isinstance(link, CflibLink)
    link.open()
    for send in (link.send, link.send_now):
        send(PACKET)
        sent = crtp.driver.sent.get(timeout=LIMIT_S)
        assert (sent.port, sent.channel, bytes(sent.data)) == PACKET
    crtp.driver.arriving.put(CRTPPacket(PACKET.encode()[0], PACKET.data))
    assert received(link) == [PACKET]
    link.close()
    assert crtp.driver.is_closed


def test_what_was_passed_to_a_radio_leaves_before_it_is_closed(crtp: Crtp) -> None:
    link = make_link(RADIO)
    link.open()
    for _ in range(20):
        link.send(PACKET)
    link.close()
    assert crtp.driver.sent.qsize() == 20


def pose(number: int) -> CrtpPacket:
    return packets.external_position(Vector3(number, 0.0, 1.0))


def test_only_the_newest_pose_leaves_and_after_all_else() -> None:
    outbox = PacketOutbox(lambda: 0.0)
    for number in range(100):
        outbox.put_pose(pose(number))
    outbox.put(PACKET)
    outbox.put(PACKET)
    assert [outbox.take() for _ in range(3)] == [PACKET, PACKET, pose(99)]
    outbox.close()
    assert outbox.take() is None


def test_a_pose_that_had_to_wait_for_too_long_does_not_leave() -> None:
    time_s = 0.0
    outbox = PacketOutbox(lambda: time_s)
    outbox.put_pose(pose(1))
    time_s = OLDEST_POSE_S + 0.01
    outbox.put(PACKET)
    outbox.close()
    assert [outbox.take() for _ in range(2)] == [PACKET, None]


def test_a_command_that_had_to_wait_for_too_long_does_not_leave() -> None:
    """A radio that blocked for half a minute must not arm what its pilot has given up, nor stop what flies by now."""
    time_s = 0.0
    outbox = PacketOutbox(lambda: time_s)
    for _ in range(MOST_PACKETS):
        outbox.put(packets.arm(12, is_armed=True))
    time_s = 30.0
    outbox.put(PACKET)
    time_s += OLDEST_PACKET_S
    outbox.close()
    assert [outbox.take() for _ in range(2)] == [PACKET, None]


def test_a_stale_pose_is_passed_over_for_what_comes_next() -> None:
    times_s = iter([0.0, OLDEST_POSE_S + 0.01, 1.0, 1.0])
    outbox = PacketOutbox(lambda: next(times_s))
    outbox.put_pose(pose(1))
    taken: list[CrtpPacket | None] = []
    taking = threading.Thread(target=lambda: taken.append(outbox.take()))
    taking.start()
    until(lambda: outbox._pose is None)
    outbox.put_pose(pose(2))
    taking.join(LIMIT_S)
    assert taken == [pose(2)]


def test_poses_passed_while_a_radio_is_blocked_do_not_leave_later(crtp: Crtp) -> None:
    is_blocked, may_send = threading.Event(), threading.Event()
    send = crtp.driver.send_packet

    def send_slowly(packet: CRTPPacket) -> None:
        is_blocked.set()
        may_send.wait(LIMIT_S)
        send(packet)

    crtp.driver.send_packet = send_slowly  # type: ignore[method-assign]
    link = make_link(RADIO)
    link.open()
    link.send_pose(pose(0))
    assert is_blocked.wait(LIMIT_S)
    for number in range(1, 100):
        link.send_pose(pose(number))
    link.send(PACKET)
    may_send.set()
    sent = [crtp.driver.sent.get(timeout=LIMIT_S) for _ in range(2)]
    assert [CrtpPacket(each.port, each.channel, bytes(each.data)) for each in sent] == [pose(0), PACKET]
    link.close()
    rest = [bytes(crtp.driver.sent.get_nowait().data) for _ in range(crtp.driver.sent.qsize())]
    assert rest in ([], [pose(99).data])  # it has left, unless this computer was slow


def test_a_radio_that_is_unplugged_is_reported(crtp: Crtp) -> None:
    link = make_link(RADIO)
    link.open()
    crtp.on_error("Error communicating with crazy radio\nException: many lines")
    with pytest.raises(CrtpLinkError, match=r"^Error communicating with crazy radio$"):
        link.receive(0.01)
    link.close()
    crtp.error = "Cannot find a Crazyradio Dongle"
    with pytest.raises(CrtpLinkError, match="Cannot find a Crazyradio Dongle"):
        link.open()


def test_the_only_crazyflie_of_a_scan_is_taken(crtp: Crtp) -> None:
    crtp.found = (RADIO,)
    link = ScannedLink()
    link.open()
    link.send(PACKET)
    assert crtp.driver.sent.get(timeout=LIMIT_S).port == PACKET.port
    assert link.url == RADIO
    link.close()


def test_several_crazyflies_are_listed(crtp: Crtp) -> None:
    crtp.found = (RADIO, "usb://0")
    with pytest.raises(CrtpLinkError, match=f"several Crazyflies: give --url, one of {RADIO}, usb://0"):
        ScannedLink().open()
    crtp.found = ()
    with pytest.raises(CrtpLinkError, match=r"^no Crazyflie found$"):
        ScannedLink().open()


def test_without_a_dongle_the_radio_is_not_scanned_and_the_lack_is_reported(
    crtp: Crtp, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crazyradio, "get_serials", tuple)
    crtp.found = (RADIO,)
    with pytest.raises(CrtpLinkError, match=r"^no Crazyflie found, and no Crazyradio$"):
        ScannedLink().open()
    crtp.found = (RADIO, "usb://0")
    assert links.scan() == ["usb://0"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # cflib's UDP driver leaves sockets open
def test_a_scan_of_the_real_drivers_prints_and_logs_nothing(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crazyradio, "get_serials", tuple)
    with contextlib.suppress(CrtpLinkError):
        links.scan()
    assert (capfd.readouterr(), caplog.records) == (("", ""), [])


@pytest.mark.parametrize("url", [RADIO, "usb://0", None])
def test_without_cflib_the_extra_is_named(url: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cflib.crtp", None)
    with pytest.raises(ConfigError, match=r"pip install 'ual-daemon\[crazyflie\]'"):
        registry.make("crazyflie", BackendOptions("uav_1", url))


def test_udp_needs_no_cflib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cflib.crtp", None)
    assert isinstance(registry.make("crazyflie", BackendOptions("uav_1", "udp://127.0.0.1:19850")), CrazyflieBackend)


@pytest.mark.parametrize(
    "url", ["tcp://127.0.0.1:1", "udp://127.0.0.1", "udp://127.0.0.1:x", "udp://h:70000", "udp://[::1", "nonsense"]
)
def test_wrong_urls_are_refused(url: str) -> None:
    with pytest.raises(ConfigError, match="is no URL of a Crazyflie"):
        make_link(url)
    assert CrazyflieBackend.vehicle_key(url)


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        (RADIO, "radio://0/80/2M/e7e7e7e7e7", True),
        (RADIO, "radio://0/80/2M", True),
        (RADIO, "radio://0/80", True),
        (RADIO, "radio://1/80/2M/E7E7E7E7E7", True),  # another dongle
        (RADIO, f"{RADIO}/?rate_limit=100", True),
        (RADIO, "radio://0/80/2M/E7E7E7E701", False),
        (RADIO, "radio://0/81/2M/E7E7E7E7E7", False),
        (RADIO, "radio://0/80/1M/E7E7E7E7E7", False),
        ("radio://0/80/2M/01", "radio://0/80/2M/0000000001", True),
        ("udp://127.0.0.1:19850", "udp://localhost:19850", True),
        ("udp://127.0.0.1:19850", "UDP://127.0.0.1:19850/", True),
        ("udp://127.0.0.1:19850", "udp://127.0.0.1:19851", False),
        ("udp://LAB:19850", "udp://lab:19850", True),
        ("usb://0", "usb://0/", True),
        ("usb://0", "usb://1", False),
        ("nonsense", "other nonsense", False),
    ],
)
def test_urls_of_one_vehicle_are_known(one: str, other: str, *, is_same: bool) -> None:
    key = CrazyflieBackend.vehicle_key
    assert (key(one) == key(other)) is is_same


def test_a_fleet_has_a_url_for_each() -> None:
    options = [BackendOptions(f"uav_{i}", f"udp://127.0.0.1:{19850 + i}") for i in (1, 2)]
    fleet: list[Any] = list(registry.make_fleet("crazyflie", options, ()))
    assert [each.url for each in fleet] == [each.url for each in options]
    assert all(isinstance(each, Backend) for each in fleet)
    with pytest.raises(ConfigError, match="--fleet-url"):
        registry.make_fleet("crazyflie", [BackendOptions("uav_1")], ())
