"""A real browser for the tests: Debian's Chromium, headless, with software WebGL, driven by its DevTools protocol."""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from tests.conftest import LIMIT_S
from tests.waiting import until

_FLAGS = (
    "--headless=new",
    "--no-sandbox",  # tests run as root in containers
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-certificate-errors",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--remote-debugging-port=0",
)
SIZE = (1280, 800)


class Page:
    """The browser's one page."""

    def __init__(self, connection: ClientConnection, pid: int) -> None:
        self.pid = pid
        self._connection = connection
        self._numbers = itertools.count(1)
        self.problems: list[str] = []
        """Errors on the page's own console."""
        self.call("Runtime.enable")
        self.call("Log.enable")
        self.call("Page.enable")

    def call(self, method: str, **params: object) -> dict[str, Any]:
        """Calls a method of the protocol, and returns its result."""
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": params}))
        deadline_s = time.monotonic() + LIMIT_S
        while True:
            message = json.loads(self._connection.recv(deadline_s - time.monotonic()))
            if message.get("id") == number:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)

    def evaluate(self, script: str) -> Any:
        """The value of a script in the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def text(self) -> str:
        """All that can be read on the page."""
        return str(self.evaluate("document.body ? document.body.innerText : ''"))

    def wait_for(self, *words: str) -> str:
        """Waits until all words can be read."""
        return str(self.wait_until(lambda: self._text_with(words), f"{words}"))

    def _text_with(self, words: Sequence[str]) -> str:
        text = self.text()
        return text if all(word in text for word in words) else ""

    def wait_until(self, get: Callable[[], Any], what: str) -> Any:
        return until(get, what, seen=lambda: f"{self.text()}\n{self.problems}")

    def click(self, x: float, y: float) -> None:
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            button = "none" if kind == "mouseMoved" else "left"
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)

    def press(self, label: str) -> None:
        """Clicks the button of this label once it is there."""
        self._press(f"text === {json.dumps(label)}", label)

    def press_beginning(self, label: str) -> None:
        """Clicks the button whose label begins so, once it is there."""
        self._press(f"text.startsWith({json.dumps(label)})", label)

    def buttons(self) -> list[str]:
        """The labels of all buttons."""
        found: list[str] = self.evaluate("[...document.querySelectorAll('button')].map(b => b.innerText.trim())")
        return [label for label in found if label]

    def choose(self, option: str) -> None:
        """Chooses a UAV by its line of the table."""
        line = f"document.querySelector('[data-ual-ns={json.dumps(option)}]')"
        self.wait_until(lambda: self.evaluate(f"!!{line}"), f"the line of {option}")
        self.evaluate(f"{line}.click()")

    def choose_too(self, option: str) -> None:
        """Chooses a UAV beside those that are chosen already."""
        self.evaluate(f"document.querySelector('[data-ual-ns={json.dumps(option)}] [data-ual-mark]').click()")

    def chosen(self) -> list[str]:
        """The UAVs whose lines say that they are chosen."""
        found: list[str] = self.evaluate("[...document.querySelectorAll('.ual-chosen')].map(e => e.dataset.ualNs)")
        return sorted(found)

    def _press(self, condition: str, label: str) -> None:
        script = f"""(() => {{
            const found = [...document.querySelectorAll('button')].find(button => {{
                const text = button.innerText.trim()
                return {condition}
            }})
            if (found) found.click()
            return !!found
        }})()"""
        self.wait_until(lambda: self.evaluate(script), f"a button {label!r} among {self.buttons()}")

    def picture(self, file: Path) -> None:
        """Takes a picture of the page."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        file.write_bytes(base64.b64decode(data))

    def _note(self, message: dict[str, Any]) -> None:
        params = message.get("params", {})
        if message.get("method") == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.problems.append(str(params["entry"]["text"]))
        elif message.get("method") == "Runtime.exceptionThrown":
            self.problems.append(str(params["exceptionDetails"]))


def chromium() -> str:
    """Returns the path of Chromium. Skips the test loudly where there is none."""
    found = os.environ.get("UAL_TEST_CHROMIUM") or shutil.which("chromium")
    if found is None:
        pytest.skip("NO CHROMIUM, the page of `ual view` is NOT TESTED in a browser: apt-get install chromium")
    return found


@contextmanager
def browser(profile: Path) -> Iterator[Page]:
    """A browser with an empty page."""
    width, height = SIZE
    process = subprocess.Popen(
        [chromium(), *_FLAGS, f"--window-size={width},{height}", f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        address = _page_address(profile, process)
        with closing(connect(address, max_size=None, compression=None, open_timeout=LIMIT_S)) as connection:
            yield Page(connection, process.pid)
    finally:
        process.terminate()
        process.wait(LIMIT_S)


def _page_address(profile: Path, process: subprocess.Popen[bytes]) -> str:
    file = profile / "DevToolsActivePort"

    def is_written() -> bool:
        assert process.poll() is None, "the browser has ended"
        return file.exists() and "\n" in file.read_text()

    until(is_written, "the browser's start")
    port = int(file.read_text().split()[0])
    return until(lambda: _first_page(port), "its first page")


def _first_page(port: int) -> str:
    """The address of its first page; empty while there is none."""
    import urllib.request

    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=LIMIT_S) as answer:
        pages = [each for each in json.load(answer) if each["type"] == "page"]
    return str(pages[0]["webSocketDebuggerUrl"]) if pages else ""
