"""Cost of ``ual view``, and the frames a second that its page draws: ``python -m benchmarks.viewing``.

A fleet of light UAVs flies circles, ``ual view`` serves its page, and Chromium (headless, with software WebGL: the
worst case) shows it. Needs Chromium.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from benchmarks.children import Process, priority_text
from tests.ual_tools.view.browser import Page, browser
from ual import Pose, State, Uav
from ual.discovery import RUNTIME_DIR_VARIABLE

_RADIUS_M = 8.0
_CORNERS = 60
_ROUNDS = 20
_FRAMES = """new Promise(done => {
    let count = 0
    const end = performance.now() + %d
    const tick = now => { count += 1; now < end ? requestAnimationFrame(tick) : done(count) }
    requestAnimationFrame(tick)
})"""
_TICKS_S = os.sysconf("SC_CLK_TCK")


def processor_s(pid: int) -> float:
    """Returns the processor time of a process and all its descendants."""
    stats = [_stat(int(each.name)) for each in Path("/proc").iterdir() if each.name.isdecimal()]
    parents = {number: parent for number, parent, _ in stats}
    times = {number: time_s for number, _, time_s in stats}
    return sum(time_s for number, time_s in times.items() if _descends(number, pid, parents))


def _stat(pid: int) -> tuple[int, int, float]:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has ended
        return pid, 0, 0.0
    return pid, int(fields[1]), (int(fields[11]) + int(fields[12])) / _TICKS_S


def _descends(pid: int, ancestor: int, parents: Mapping[int, int]) -> bool:
    while pid and pid != ancestor:
        pid = parents.get(pid, 0)
    return pid == ancestor


def fly(names: Sequence[str], stack: ExitStack) -> None:
    """Lets each UAV fly circles until long after the measurement."""
    uavs = [stack.enter_context(Uav(ns)) for ns in names]
    for uav in uavs:
        uav.wait_for(State.LANDED_ARMED, timeout_s=30.0)
        uav.take_off(3.0, blocking=False)
    for number, uav in enumerate(uavs):
        uav.wait_for(State.FLYING_AUTO, timeout_s=30.0)
        height_m = 3.0 + 0.2 * number
        circle = [
            Pose.at(_RADIUS_M * math.cos(angle) - _RADIUS_M, _RADIUS_M * math.sin(angle), height_m)
            for angle in (math.tau * i / _CORNERS for i in range(_CORNERS * _ROUNDS))
        ]
        uav.follow_path(circle, corner_radius_m=0.5, blocking=False)


def measure(page: Page, processes: Mapping[str, int], duration_s: float) -> None:
    """Prints the frames a second, and what each process took."""
    before = {name: processor_s(pid) for name, pid in processes.items()}
    start_s = time.monotonic()
    frames = page.evaluate(_FRAMES % (1000 * duration_s))
    took_s = time.monotonic() - start_s
    print(f"{frames / took_s:.1f} frames a second drawn")
    for name, pid in processes.items():
        print(f"{name:10}{100.0 * (processor_s(pid) - before[name]) / took_s:6.0f} % of a core")


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="What the page of ual view costs.")
    parser.add_argument("--uavs", type=int, default=20, help="[20]")
    parser.add_argument("--duration", type=float, default=20.0, help="seconds [20]")
    parser.add_argument("--after", type=float, default=5.0, help="seconds that trails grow before [5]")
    parser.add_argument("--picture", type=Path, help="take a picture of the page, too (PNG)")
    options = parser.parse_args()
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="ual-bench-")))
        os.environ[RUNTIME_DIR_VARIABLE] = str(directory)
        fleet = ["--fleet", str(options.uavs), "--auto-arm"] if options.uavs > 1 else ["--auto-arm"]
        daemon = stack.enter_context(Process([sys.executable, "-m", "ual_daemon", *fleet]))
        names = [f"uav_{number + 1}" for number in range(options.uavs)]
        while not all((directory / f"{ns}.json").exists() for ns in names):
            time.sleep(0.1)
        fly(names, stack)
        command = [sys.executable, "-c", "from ual_tools.main import main; main()", "--json", "view", "--port", "0"]
        view = stack.enter_context(Process(command, stdout=-1))
        assert view.popen.stdout is not None
        url = json.loads(view.popen.stdout.readline())["url"]
        page = stack.enter_context(browser(directory / "profile"))
        page.open(url)
        page.wait_for(f"{names[-1]}\tFLYING_AUTO")
        time.sleep(options.after)  # long trails are what costs: how long they are is part of what is measured
        print(f"{options.uavs} UAVs; {priority_text()}")
        measure(page, {"daemon": daemon.pid, "ual view": view.pid, "browser": page.pid}, options.duration)
        if options.picture is not None:
            page.picture(options.picture)


if __name__ == "__main__":
    main()
