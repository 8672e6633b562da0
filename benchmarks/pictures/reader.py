"""A program that gets pictures at a rate, as a process. Tasks (see `benchmarks.children`): ``begin`` and ``end``."""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

import ual
from benchmarks.children import serve


class PicturesReader:
    """Gets pictures until `end`."""

    def __init__(self, address: str) -> None:
        self._uav = ual.Uav(address=address)
        self._ending = threading.Event()
        self._took_ms: list[float] = []
        self._sizes: list[int] = []
        self._thread = threading.Thread()

    def begin(self, rate_hz: float, max_age_s: float) -> dict[str, Any]:
        self._ending.clear()
        self._took_ms, self._sizes = [], []
        self._thread = threading.Thread(target=self._run, args=(rate_hz, max_age_s))
        self._thread.start()
        return {}

    def end(self) -> dict[str, Any]:
        self._ending.set()
        self._thread.join()
        return {"took_ms": self._took_ms, "sizes": self._sizes}

    def _run(self, rate_hz: float, max_age_s: float) -> None:
        due_s = time.monotonic()
        while not self._ending.wait(max(0.0, due_s - time.monotonic())):
            due_s = max(due_s + 1.0 / rate_hz, time.monotonic())
            began_s = time.monotonic()
            image = self._uav.cameras[0].image(max_age_s=max_age_s)
            self._took_ms.append(1000.0 * (time.monotonic() - began_s))
            self._sizes.append(len(image.data))


def main() -> None:
    reader = PicturesReader(sys.argv[1])

    def handle(task: dict[str, Any]) -> dict[str, Any]:
        return reader.begin(**task) if task.pop("do") == "begin" else reader.end()

    serve(handle)


main()
