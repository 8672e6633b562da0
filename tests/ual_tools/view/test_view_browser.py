"""`ual view` in a real browser. Skipped loudly where there is no Chromium."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual_tools.view.browser import Page, browser
from tests.ual_tools.view.conftest import StartView, Views
from ual import Uav
from ual.types import State

VIEWERS = ("Save Canvas", "Reset View", "Reset Panel Layout")
"""Buttons of viser's own, for the browser only."""


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with browser(tmp_path / "profile") as page:
        yield page


def test_three_uavs_are_observed_executed_and_lost(
    page: Page, start_view: StartView, start_daemon: StartDaemon
) -> None:
    flags = ("--auto-arm", "--set", "light.speed_factor=10")
    daemons = [start_daemon(*flags, ns=f"uav_{n}") for n in (1, 2, 3)]
    for daemon in daemons:
        daemon.wait_for("state", new="LANDED_ARMED")
    page.open(start_view("--control"))
    for ns in ("uav_1", "uav_2", "uav_3"):
        page.wait_for(f"{ns}\tLANDED_ARMED")

    # A take-off: asked first, then confirmed.
    page.choose("uav_2")
    page.press("Take off uav_2")
    page.wait_for("uav_2: take off to 3 m: would be accepted, 3.00 m")
    page.press("Confirm: uav_2: take off to 3 m")
    page.wait_for("uav_2: FLYING_AUTO")
    assert page.evaluate("document.title") == "UAL - CONTROL"

    # Several are chosen by their marks, and all by a second click.
    assert page.chosen() == ["uav_2"]
    page.choose_too("uav_1")
    page.wait_for("Land uav_1, uav_2")
    page.wait_until(lambda: page.chosen() == ["uav_1", "uav_2"], "two that are chosen")
    page.choose_too("uav_1")
    page.wait_until(lambda: page.chosen() == ["uav_2"], "one that is chosen")
    page.choose("uav_2")
    page.wait_for("Land all 3")
    page.choose("uav_2")
    page.wait_for("Take off uav_2")

    # A go-to by a click on the ground.
    page.click(300, 500)
    words = page.wait_for("would be accepted", "uav_2: go to ")
    page.press_beginning("Confirm: uav_2: go to ")
    page.wait_until(lambda: re.search(r"uav_2: go to .*: SUCCEEDED", page.text()), "the end of the go-to")
    x, y = goal_in(words)
    with Uav("uav_2") as uav:
        position = uav.pose().pose.position
        assert uav.state() is State.FLYING_AUTO
    assert abs(position.x - x) < 0.5
    assert abs(position.y - y) < 0.5
    assert (x, y) != (0.0, 0.0)

    # A killed daemon.
    daemons[1].signal(signal.SIGKILL)
    killed_s = time.monotonic()
    page.wait_for("uav_2: LOST since", "it was FLYING_AUTO", "uav_2\tLOST")
    page.wait_until(lambda: page.evaluate("document.title") == "1 alarm - UAL - CONTROL", "the title")
    assert time.monotonic() - killed_s < LIMIT_S
    assert not page.problems


def test_a_page_that_gets_no_news_says_so_itself(
    page: Page, start_view: StartView, views: Views, daemon: DaemonProcess
) -> None:
    page.open(start_view())
    page.wait_for(f"{daemon.ns}: LANDED_ARMED", "telemetry 0.")
    page.wait_until(lambda: "NO NEWS" not in page.text(), "the present")
    assert [label for label in page.buttons() if label not in VIEWERS] == ["Look at it"]
    views[0].send_signal(signal.SIGSTOP)  # the connection stays, and nothing comes
    page.wait_for("NO NEWS since", "this is not the present")
    views[0].send_signal(signal.SIGCONT)
    page.wait_until(lambda: "NO NEWS" not in page.text(), "the present again")
    views[0].kill()
    page.wait_for("NO NEWS since")


def goal_in(words: str) -> tuple[float, float]:
    """Returns the goal of the proposed go-to."""
    found = re.search(r"uav_2: go to (\S+) (\S+) \S+ in map", words)
    assert found is not None
    return float(found[1]), float(found[2])
