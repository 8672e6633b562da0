"""Cost of pictures for a flight: ``python -m benchmarks.pictures``.

A light UAV is flown by setpoints at 50 Hz, without pictures and with ten of 1 MB a second to each of two programs, in
turns. How late setpoints come is printed with PASS or FAIL (exit status 1 where a target is missed).
"""

from __future__ import annotations

import argparse
import json
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from benchmarks.children import Child, processor_s
from benchmarks.effort import RATE_HZ
from benchmarks.results import p50, p99
from benchmarks.servers import UalDaemon

_CAMERA = {"width_px": 840, "height_px": 600, "noise": 6.0}
"""A picture of at least 1 MB."""
_PICTURES_HZ, _READERS = 10.0, 2
_MOST_LATE_MS = 20.0
_LEAST_RATE = 0.95
_MEGA = 1e-6


class RoundPart(NamedTuple):
    """Measurements of one part of a round."""

    late_ms: Sequence[float]
    lost: int
    daemon_percent: float


class Pictures(NamedTuple):
    """Pictures that the programs received."""

    rate_hz: Sequence[float]
    took_ms: Sequence[float]
    mb: float


class PicturesFlight:
    """A daemon with its UAV in the air, the program that flies it, and those that get pictures."""

    def __init__(self, stack: ExitStack) -> None:
        self._noted = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="ual-bench-"))) / "noted.json"
        self._daemon = stack.enter_context(
            UalDaemon(
                None,
                *("--auto-arm", "--set", f"light.cameras={json.dumps([_CAMERA])}"),
                run=("benchmarks.pictures.daemon", str(self._noted)),
            )
        )
        self._daemon.wait()
        address = self._daemon.addresses["tcp"]
        self._pilot = stack.enter_context(Child("benchmarks.pictures.pilot", address))
        self.readers = [stack.enter_context(Child("benchmarks.pictures.reader", address)) for _ in range(_READERS)]
        self._pilot.ask("connect")

    def prefer(self) -> None:
        """Gives the daemon and the program that flies priority over all others."""
        for process in (self._daemon, self._pilot):
            process.prefer()

    def fly(self, count: int) -> RoundPart:
        """Sends setpoints at 50 Hz. Returns how late each came."""
        self._came()
        began_s, before_s = time.monotonic(), processor_s(self._daemon.pid)
        given = self._pilot.ask("pace", count=count, rate_hz=RATE_HZ)
        percent = 100.0 * (processor_s(self._daemon.pid) - before_s) / (time.monotonic() - began_s)
        came = self._came()
        sent = list(zip(given["number"], given["at_ns"], strict=True))
        late_ms = [(came[number] - at_ns) * _MEGA for number, at_ns in sent if number in came]
        return RoundPart(late_ms, count - len(late_ms), percent)

    def _came(self) -> dict[int, int]:
        self._noted.unlink(missing_ok=True)
        self._daemon.popen.send_signal(signal.SIGUSR1)
        while not self._noted.exists():
            time.sleep(0.01)
        return dict(json.loads(self._noted.read_text()))


def measure(flight: PicturesFlight, count: int, max_age_s: float) -> tuple[RoundPart, RoundPart, Pictures]:
    """Returns one round: without pictures, with them, and what came of them."""
    without = flight.fly(count)
    for reader in flight.readers:
        reader.ask("begin", rate_hz=_PICTURES_HZ, max_age_s=max_age_s)
    began_s = time.monotonic()
    with_them = flight.fly(count)
    ends = [reader.ask("end") for reader in flight.readers]
    took_s = time.monotonic() - began_s
    sizes = [size for each in ends for size in each["sizes"]]
    rates = [len(each["sizes"]) / took_s for each in ends]
    return without, with_them, Pictures(rates, [ms for each in ends for ms in each["took_ms"]], min(sizes) / 1e6)


def _row(name: str, parts: Sequence[RoundPart]) -> str:
    late_ms = [ms for each in parts for ms in each.late_ms]
    return (
        f"{name:18}{len(late_ms):6d} setpoints: {p50(late_ms):.2f} ms late p50, {p99(late_ms):.2f} p99, "
        f"{max(late_ms):.2f} at most; daemon {statistics.median(each.daemon_percent for each in parts):.1f} % of a core"
    )


def _verdicts(
    without: Sequence[RoundPart], with_them: Sequence[RoundPart], pictures: Sequence[Pictures]
) -> Iterator[str]:
    late_ms = p99([ms for each in with_them for ms in each.late_ms])
    rate_hz = min(rate for each in pictures for rate in each.rate_hz)
    lost = sum(each.lost for each in with_them) - sum(each.lost for each in without)
    for name, figure, limit, passes in (
        ("setpoints late with pictures, p99, ms", late_ms, f"< {_MOST_LATE_MS:g}", late_ms < _MOST_LATE_MS),
        ("lost setpoints, more than without", lost, "<= 0", lost <= 0),
        (
            "pictures a second, least",
            rate_hz,
            f">= {_LEAST_RATE * _PICTURES_HZ:g}",
            rate_hz >= _LEAST_RATE * _PICTURES_HZ,
        ),
        ("size of a picture, least, MB", (mb := min(each.mb for each in pictures)), ">= 1", mb >= 1.0),
    ):
        yield f"{name:42}{figure:8.2f}  {limit:8}  {'PASS' if passes else 'FAIL'}"


def main() -> None:
    """Measures, prints, and ends with 1 where a target is missed."""
    parser = argparse.ArgumentParser(description="What pictures cost a flight.")
    parser.add_argument("--rounds", type=int, default=5, help="[5]")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each part of a round [10]")
    parser.add_argument(
        "--max-age", type=float, default=0.08, help="of a picture that programs share; 0: none is [0.08]"
    )
    parser.add_argument("--prefer", action="store_true", help="give the daemon and the pilot real-time priority")
    options = parser.parse_args()
    with ExitStack() as stack:
        flight = PicturesFlight(stack)
        if options.prefer:
            flight.prefer()
        flight.fly(int(RATE_HZ))  # warm
        count = int(options.seconds * RATE_HZ)
        rounds = [measure(flight, count, options.max_age) for _ in range(options.rounds)]
    without, with_them, pictures = (list(each) for each in zip(*rounds, strict=True))
    print(_row("without pictures", without))
    print(_row("with pictures", with_them))
    took_ms = [ms for each in pictures for ms in each.took_ms]
    print(f"{len(took_ms)} pictures: {p50(took_ms):.0f} ms from the request p50, {p99(took_ms):.0f} p99\n")
    verdicts = list(_verdicts(without, with_them, pictures))
    print("\n".join(verdicts))
    sys.exit(any(each.endswith("FAIL") for each in verdicts))


if __name__ == "__main__":
    main()
