"""The page of `ual view` as a liar sees it: what it offers, and what it refuses, whatever is sent. Needs no browser."""

from __future__ import annotations

import math
import ssl
import subprocess
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus

from tests.conftest import DaemonProcess, StartDaemon
from tests.ual_tools.view.conftest import StartView
from ual import LeaseHeldError, State, Team, Uav
from ual.simulation import LinkLost

pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

from tests.ual_tools.view.forger import Forger, forger
from tests.waiting import until

CLICK: dict[str, Any] = {
    "type": "ScenePointerMessage",
    "event_type": "click",
    "ray_origin": (0.0, 0.0, 5.0),
    "ray_direction": (0.1, 0.1, -1.0),
    "screen_pos": ((0.5, 0.5),),
    "modifier": None,
}
NO_HEIGHTS: tuple[object, ...] = ("high", None, [], 1e300, -5.0, {"a": 1})


def forge_everything(page: Forger) -> None:
    """Sends every message that viser takes from a browser, for each element of the panel."""
    page.send(**CLICK)
    page.send(type="ShareUrlRequest")
    for uuid, element in page.elements.items():
        kind = element["type"]
        if kind in ("GuiButtonMessage", "GuiCheckboxMessage"):
            page.send(type="GuiUpdateMessage", uuid=uuid, updates={"value": True})
        page.send(type="GuiButtonHoldMessage", uuid=uuid, frequency=10.0)
        page.send(type="GuiFormSubmitMessage", uuid=uuid)
        page.send(type="CommandTriggerMessage", uuid=uuid)


def status(request: urllib.request.Request, context: ssl.SSLContext | None = None) -> int:
    try:
        with urllib.request.urlopen(request, context=context) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def commands_in(daemon: DaemonProcess) -> list[dict[str, Any]]:
    return [each for each in daemon.events if each["event"] in ("command", "refused")]


def test_a_page_without_control_cannot_fly(daemon: DaemonProcess, start_view: StartView) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view()) as page:
        page.read_until("Log")
        page.read_until_text("<td>LANDED_ARMED</td>")
        labels = {each.get("label") for each in page.elements.values()}
        assert labels - {None, "UAV", "Show", "Frames", "Pictures", "Gimbals", "Look at it", "Log"} == set()
        assert page.enabled_clicks == []
        forge_everything(page)
        # It answers in order: so it has done with all of that once it has answered to what is sent last.
        page.send(type="GuiUpdateMessage", uuid=page.read_until("UAV"), updates={"value": "none"})
        page.read_until_text(f"<tr class='' data-ual-ns='{daemon.ns}'>")
    assert commands_in(daemon) == []
    with Uav(daemon.ns) as uav:
        assert uav.state() is State.LANDED_ARMED


def test_a_page_with_control_flies_by_the_same_messages(daemon: DaemonProcess, start_view: StartView) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view("--control")) as page:
        button = page.read_until(f"Take off {daemon.ns}")
        page.send(type="GuiUpdateMessage", uuid=button, updates={"value": True})
        confirm = page.read_until(f"Confirm: {daemon.ns}: take off to 3 m")
        assert commands_in(daemon) == []  # a dry run begins nothing
        page.send(type="GuiUpdateMessage", uuid=confirm, updates={"value": True})
        daemon.wait_for("command", command="take_off")


def test_a_late_click_does_not_confirm_what_was_proposed_after_it(daemon: DaemonProcess, start_view: StartView) -> None:
    """On a slow link the browser still shows the first proposal while the second one is there."""
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view("--control")) as page:
        button = page.read_until(f"Take off {daemon.ns}")
        height = page.read_until("Take-off height (m)")
        page.send(type="GuiUpdateMessage", uuid=button, updates={"value": True})
        first = page.read_until(f"Confirm: {daemon.ns}: take off to 3 m")
        page.send(type="GuiUpdateMessage", uuid=height, updates={"value": 2.0})
        page.send(type="GuiUpdateMessage", uuid=button, updates={"value": True})
        second = page.read_until(f"Confirm: {daemon.ns}: take off to 2 m")
        assert second != first
        point = page.now()
        page.send(type="GuiUpdateMessage", uuid=first, updates={"value": True})
        page.send(type="GuiUpdateMessage", uuid=page.read_until("Cancel"), updates={"value": True})
        page.read_until_new("Choose a UAV", point)
        assert commands_in(daemon) == []


def test_a_page_lands_all_and_those_that_are_chosen(start_daemon: StartDaemon, start_view: StartView) -> None:
    names = ("uav_1", "uav_2", "uav_3")
    daemon = start_daemon("--fleet", "3", "--auto-arm", "--set", "light.speed_factor=10")
    for ns in names:
        daemon.wait_for("state", ns=ns, new="LANDED_ARMED")
    with Team(names) as team:
        team.take_off(2.0)
        with forger(start_view("--control")) as page:
            choice = page.read_until("UAV")
            land = page.read_until("Land all 3")
            page.send(type="GuiUpdateMessage", uuid=choice, updates={"value": "uav_3, uav_1"})
            page.read_until("Land uav_1, uav_3")
            page.send(type="GuiUpdateMessage", uuid=land, updates={"value": True})
            page.read_until_text("land\\: 2 of 2 done")
            assert team["uav_2"].state() is State.FLYING_AUTO
            page.send(type="GuiUpdateMessage", uuid=choice, updates={"value": "all UAVs"})
            page.read_until("Land all 3")
            page.send(type="GuiUpdateMessage", uuid=land, updates={"value": True})
            page.read_until_text("land\\: 3 of 3 done")
        landed = {each["ns"] for each in daemon.events if each["event"] == "command" and each["command"] == "land"}
        assert landed == set(names)
        team.wait_for(State.LANDED_ARMED, State.LANDED_DISARMED)


def test_what_one_refuses_is_reported_next_to_what_the_others_did(
    start_daemon: StartDaemon, start_view: StartView
) -> None:
    names = ("uav_1", "uav_2", "uav_3")
    daemon = start_daemon("--fleet", "3", "--auto-arm", "--set", "light.speed_factor=10")
    for ns in names:
        daemon.wait_for("state", ns=ns, new="LANDED_ARMED")
    with forger(start_view("--control")) as page:
        hold = page.read_until("Hold all 3")
        page.send(type="GuiUpdateMessage", uuid=hold, updates={"value": True})
        page.read_until_text("hold\\: 0 of 3 done; REFUSED\\: uav")


def test_a_page_takes_and_releases_the_lease_after_it_was_confirmed(
    daemon: DaemonProcess, start_view: StartView
) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view("--control")) as page, Uav(daemon.ns) as other:
        take = page.read_until(f"Take lease of {daemon.ns}")
        release = page.read_until(f"Release lease of {daemon.ns}")
        page.send(type="GuiUpdateMessage", uuid=take, updates={"value": True})
        confirm = page.read_until(f"Confirm: {daemon.ns}: take the lease")
        assert other.lease_info() is None
        page.send(type="GuiUpdateMessage", uuid=confirm, updates={"value": True})
        until(lambda: other.lease_info() is not None)
        with pytest.raises(LeaseHeldError):
            other.take_off(2.0)
        point = page.now()
        page.send(type="GuiUpdateMessage", uuid=release, updates={"value": True})
        page.read_until_new("release the lease\\: done", point)
        assert other.lease_info() is None
        point = page.now()
        page.send(type="GuiUpdateMessage", uuid=release, updates={"value": True})
        page.read_until_new("these pages do not hold the lease", point)


def test_values_that_no_page_sends_fly_nothing_and_end_nothing(daemon: DaemonProcess, start_view: StartView) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view("--control")) as page:
        button = page.read_until(f"Take off {daemon.ns}")
        height = page.read_until("Take-off height (m)")
        for height_m, wrong in enumerate(NO_HEIGHTS, 2):
            page.send(type="GuiUpdateMessage", uuid=height, updates={"value": wrong})
            page.send(type="GuiUpdateMessage", uuid=button, updates={"value": True})
            page.send(type="GuiUpdateMessage", uuid=height, updates={"value": float(height_m)})
            page.send(type="GuiUpdateMessage", uuid=button, updates={"value": True})
            page.read_until(f"Confirm: {daemon.ns}: take off to {height_m} m")
    assert [each for each in commands_in(daemon) if each["event"] == "command"] == []


def test_a_uav_whose_autopilot_is_silent_is_lost_although_its_daemon_answers(
    daemon: DaemonProcess, start_view: StartView
) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view()) as page, Uav(daemon.ns) as uav:
        page.read_until_text("LANDED\\_ARMED")
        uav.simulation.begin_fault(LinkLost())
        page.read_until_text("no new pose for")
        uav.simulation.end_fault()
        page.read_until_text("### uav\\_1: LANDED\\_ARMED")


def test_the_path_of_anothers_task_and_the_fence_are_drawn(start_daemon: StartDaemon, start_view: StartView) -> None:
    fence = ("--set", "geofence.polygon=[[-5, -5], [9, -5], [9, 9], [-5, 9]]", "--set", "geofence.max_height_m=8")
    daemon = start_daemon("--auto-arm", *fence)
    daemon.wait_for("state", new="LANDED_ARMED")
    with forger(start_view()) as page, Uav(daemon.ns) as uav:
        corners = page.read_until_paths("/fence/0")
        assert len(corners) == 24
        assert {point[2] for point in corners} == {0.5, 8.0}
        assert {point[:2] for point in corners} == {(-5.0, -5.0), (9.0, -5.0), (9.0, 9.0), (-5.0, 9.0)}
        uav.simulation.set_speed_factor(0.1)  # the take-off lasts until the page has shown its way
        uav.take_off(2.0, blocking=False)
        above = pytest.approx((0.0, 0.0, 2.0), abs=0.3)
        page.read_until_paths("/uav/0/way", lambda ends: bool(ends) and ends[-1] == above)


def test_where_pictures_were_taken_and_the_last_one_are_drawn(start_daemon: StartDaemon, start_view: StartView) -> None:
    daemon = start_daemon("--set", 'light.cameras=[{"mount_position": [0.5, 0, 0]}]')
    daemon.wait_for("state", new="LANDED_DISARMED")
    with forger(start_view()) as page, Uav(daemon.ns) as uav:
        uav.cameras[0].take_photo()
        ends = page.read_until_paths("/pictures/0/places")
        assert len(ends) == 6
        assert ends[0] == pytest.approx((0.35, 0.0, 0.0), abs=1e-6)
        last = "/pictures/0/last"
        until(lambda: last in page.nodes, last, between=lambda: page.read(60.0))
        assert page.nodes[last]["_image_data"] is None
        assert page.nodes[last]["aspect"] == pytest.approx(640 / 480)
        page.send(type="GuiUpdateMessage", uuid=page.read_until("Pictures"), updates={"value": True})
        until(lambda: page.nodes[last]["_image_data"] is not None, "the picture", between=lambda: page.read(60.0))
        uav.cameras[0].take_photo()
        page.read_until_paths("/pictures/0/places", lambda ends: len(ends) == 12)


def test_where_a_gimbal_points_is_drawn_while_a_page_wants_it(start_daemon: StartDaemon, start_view: StartView) -> None:
    daemon = start_daemon("--set", 'light.gimbals=[{"position": [0.5, 0, 0]}]')
    daemon.wait_for("state", new="LANDED_DISARMED")
    with forger(start_view()) as page, Uav(daemon.ns) as uav:
        page.read_until_text("LANDED_DISARMED")
        checkbox = page.read_until("Gimbals")
        views = "/gimbals/0"
        assert views not in page.nodes
        page.send(type="GuiUpdateMessage", uuid=checkbox, updates={"value": True})
        ends = page.read_until_paths(views)
        assert len(ends) == 16
        assert ends[0] == pytest.approx((0.5, 0.0, 0.0), abs=1e-3)
        assert ends[1] == pytest.approx((1.5, 0.3, 0.2), abs=1e-3)
        uav.gimbals[0].set_angles(math.pi / 2.0)
        page.read_until_paths(views, lambda ends: ends[1] == pytest.approx((0.7, 0.3, -1.0), abs=1e-3))
        page.send(type="GuiUpdateMessage", uuid=checkbox, updates={"value": False})
        until(lambda: not page.nodes[views].get("visible"), "it is hidden", between=lambda: page.read(60.0))


def test_the_panel_says_what_a_uav_carries(start_daemon: StartDaemon, start_view: StartView) -> None:
    payload = ('payload.grippers=[{"name": "claw"}]', 'payload.relays=[{"name": "lamp", "number": 1}]')
    daemon = start_daemon(*(word for each in payload for word in ("--set", each)))
    daemon.wait_for("state", new="LANDED_DISARMED")
    with forger(start_view()) as page, Uav(daemon.ns) as uav:
        page.read_until_text("gripper claw | open")
        page.read_until_text("relay lamp | off")
        uav.gripper.grip()
        page.read_until_text("gripper claw | closed; ordered\\: grip")


def test_a_page_of_another_site_gets_no_connection(start_view: StartView) -> None:
    url = start_view("--control")
    for headers in ({"Origin": "https://evil.example"}, {"Origin": "null"}):
        with pytest.raises(InvalidStatus) as refused, forger(url, headers):
            pass
        assert refused.value.response.status_code == 403
    bare, _, token = url.partition("/?token=")
    assert len(token) >= 32
    with forger(url, {"Origin": bare}) as page:
        page.read_until("Log")
    for headers in ({}, {"Cookie": "ual_view_token=x"}):  # another user of this computer
        with pytest.raises(InvalidStatus) as refused, forger(bare, headers):
            pass
        assert refused.value.response.status_code == 403


def test_the_page_is_shown_by_no_other_and_loads_nothing(start_view: StartView) -> None:
    with urllib.request.urlopen(start_view()) as answer:
        policy = answer.headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in policy
        assert "default-src 'self'" in policy
        assert answer.headers["X-Frame-Options"] == "DENY"


def test_a_name_that_leads_here_is_not_this_computer(start_view: StartView) -> None:
    assert status(urllib.request.Request(start_view(), headers={"Host": "evil.example"})) == 403


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    files = {"-keyout": tmp_path / "key.pem", "-out": tmp_path / "certificate.pem"}
    options = ["-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=127.0.0.1"]
    options += ["-addext", "subjectAltName=IP:127.0.0.1"]
    paths = [str(each) for pair in files.items() for each in pair]
    subprocess.run(["openssl", "req", *options, *paths], check=True, capture_output=True)
    return files["-out"], files["-keyout"]


def test_beyond_loopback_it_takes_tls_and_a_token(certificate: tuple[Path, Path], start_view: StartView) -> None:
    where = ("--host", "0.0.0.0", "--tls-certificate", str(certificate[0]), "--tls-key", str(certificate[1]))
    printed = start_view(*where, "--control")
    assert printed.startswith("https://0.0.0.0:")
    url = printed.replace("0.0.0.0", "127.0.0.1")
    bare, _, token = url.partition("?token=")
    assert len(token) >= 32
    context = ssl.create_default_context(cafile=str(certificate[0]))

    # The client of websockets reads and writes in two threads. Before Python 3.13 ssl does not stand that with TLS 1.3:
    # both may take up the server's session tickets, and the request is lost (or the interpreter).
    for_threads = ssl.create_default_context(cafile=str(certificate[0]))
    for_threads.maximum_version = ssl.TLSVersion.TLSv1_2

    with urllib.request.urlopen(url, context=context) as answer:
        assert answer.status == 200
        cookie = answer.headers["Set-Cookie"]
        assert f"={token};" in cookie
    for wrong in (bare, f"{bare}?token=x"):
        assert status(urllib.request.Request(wrong), context) == 403
        with pytest.raises(InvalidStatus), forger(wrong, tls=for_threads):
            pass
    with forger(bare, {"Cookie": cookie.partition(";")[0]}, for_threads) as page:
        page.read_until("Log")


def test_uavs_of_this_computer_and_of_an_address(start_daemon: StartDaemon, start_view: StartView) -> None:
    here, there = start_daemon(ns="uav_1"), start_daemon(ns="uav_2")
    for each in (here, there):
        each.wait_for("listening")
    with forger(start_view("--ns", "uav_1", "--address", there.address)) as page:
        page.read_until_text("data-ual-ns='uav_1'")
        page.read_until_text("data-ual-ns='uav_2'")
