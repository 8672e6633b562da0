"""Position of the buttons that stop a flight in the page of `ual view`, in a real browser of three sizes and in each
state.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import StartDaemon
from tests.ual_tools.view.browser import Page, browser
from tests.ual_tools.view.conftest import StartView

SIZES = ((1280, 720), (1600, 900), (1920, 1080))
_VISIBLE = """(() => {
  const found = [...document.querySelectorAll(%r)].filter(e => e.innerText.trim().startsWith(%r)).pop()
  if (!found) return "it is not there"
  const box = found.getBoundingClientRect()
  if (!box.height) return "it has no height"
  const inside = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2)
  if (inside && (found.contains(inside) || inside.contains(found))) return ""
  return "it is hidden: " + JSON.stringify(box)
})()"""


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with browser(tmp_path / "profile") as page:
        yield page


def scroll(page: Page, share: float) -> None:
    """Scrolls all that a user can scroll."""
    page.evaluate(
        "document.querySelectorAll('*').forEach(e => {"
        f"if (/auto|scroll/.test(getComputedStyle(e).overflowY)) e.scrollTop = {share} * e.scrollHeight}})"
    )


def all_visible(page: Page, *labels: str, kind: str = "button") -> None:
    """Each is in sight at each size, whatever is scrolled."""
    for width, height in SIZES:
        page.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        for share in (0.0, 1.0):
            for label in labels:

                def why_not(label: str = label, share: float = share) -> Any:
                    scroll(page, share)
                    return page.evaluate(_VISIBLE % (kind, label))

                page.wait_until(lambda: why_not() == "", f"{label} at {width}, {share}: {why_not()}")


def test_what_stops_a_flight_is_in_sight_at_each_size_and_in_each_state(
    page: Page, start_view: StartView, start_daemon: StartDaemon
) -> None:
    flags = ("--auto-arm", "--set", "light.speed_factor=10")
    daemons = [start_daemon(*flags, ns=f"uav_{n}") for n in (1, 2)]
    for daemon in daemons:
        daemon.wait_for("state", new="LANDED_ARMED")
    page.open(start_view("--control"))
    page.wait_for("uav_1\tLANDED_ARMED", "uav_2\tLANDED_ARMED")
    all_visible(page, "Hold all 2", "Land all 2")

    page.choose("uav_2")
    page.wait_for("Take off uav_2")
    all_visible(page, "Abort (stop) uav_2", "Land uav_2")

    page.click(300, 300)  # the ground; it stands, and is refused
    page.wait_for("uav_2: go to ", "REFUSED")
    all_visible(page, "uav_2: go to ", kind="p")

    page.press("Take off uav_2")
    page.wait_for("would be accepted")
    all_visible(page, "Confirm: uav_2: take off", "Cancel", "Abort (stop) uav_2", "Land uav_2")
    page.press_beginning("Confirm: uav_2: take off")
    page.wait_for("uav_2: FLYING_AUTO")
    all_visible(page, "Abort (stop) uav_2", "Land uav_2")

    daemons[1].signal(signal.SIGKILL)
    page.wait_for("uav_2: LOST since")
    all_visible(page, "Abort (stop) uav_2", "Land uav_2")
    page.choose("uav_2")
    page.wait_for("Hold all 2")
    all_visible(page, "Hold all 2", "Land all 2")
