"""Measures everything and prints the table of targets; exit status 1 where one is missed."""

from __future__ import annotations

import argparse
import compileall
import json
import os
import platform
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks import recorded, report, targets
from benchmarks.children import REPOSITORY, Child, ChildError, prefer_this, priority_text
from benchmarks.effort import FULL, QUICK, Effort
from benchmarks.measures import memory, noise, processor, setpoints, start, telemetry
from benchmarks.results import Results
from benchmarks.setups import SERVER_WAYS, SETPOINT_WAYS, TELEMETRY_WAYS, ClientSetup

_README = Path(__file__).parent / "README.md"
_FIGURES = Path(__file__).parent / "figures"
_ALL_FIGURES = Path(__file__).parent / "figures.md"
_PARTS = ("setpoints", "telemetry", "processor", "start", "memory")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few and short rounds: a look, not a measurement")
    parser.add_argument("--only", action="append", choices=_PARTS, help="these parts only; may be given again")
    parser.add_argument("--rounds", type=int, help="how many rounds")
    parser.add_argument("--output", type=Path, default=REPOSITORY / "build" / "bench", help="where results are written")
    parser.add_argument(
        "--keep", action="store_true", help="write README.md, figures.md and recorded.json of benchmarks/, too"
    )
    arguments = parser.parse_args()
    effort = QUICK if arguments.quick else FULL
    rounds = arguments.rounds or effort.rounds
    began_s = time.monotonic()
    prefer_this()
    for package in ("ual_daemon", "clients/python/ual", "clients/python/ual_tools"):
        # pip compiles the packages that it installs, so UAL is compiled, too. Otherwise each start would compile it
        # again if Python may not write compiled files (PYTHONDONTWRITEBYTECODE).
        compileall.compile_dir(str(REPOSITORY / package), quiet=2)

    results = measure(effort, rounds, arguments.only or _PARTS)

    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "results.json").write_text(json.dumps(results.values))
    lines = list(targets.rows(results))
    found = f"{how(rounds, time.monotonic() - began_s)}\n\n{report.target_table(lines)}\n\n{report.failures(results)}"
    figures = report.figures(results)
    tables = f"{found}{figures}\n"
    (arguments.output / "results.md").write_text(tables)
    print(tables)
    plot(results, arguments.output)
    if arguments.keep:
        keep(found, figures, results)
        medians = {line.what: round(line.found.median, 4) for line in lines if line.found is not None}
        recorded.record("bench", medians)
    return int(any(line.verdict == "FAIL" for line in lines))


def measure(effort: Effort, rounds: int, parts: list[str] | tuple[str, ...]) -> Results:
    """Measures all parts, round by round. The order in a round is random, so that no way always comes first."""
    results = Results()
    with Child("benchmarks.vehicle") as vehicle:
        vehicle.prefer()
        for results.round in range(rounds):
            tasks: list[tuple[str, Callable[[], None]]] = [("noise", lambda: noise.measure(results))]
            if "setpoints" in parts:
                tasks += _each("setpoints", SETPOINT_WAYS, partial(setpoints.measure, vehicle, effort, results))
            if "telemetry" in parts:
                tasks += _each("telemetry", TELEMETRY_WAYS, partial(telemetry.measure, vehicle, effort, results))
            if "processor" in parts:
                tasks += _each("processor", SERVER_WAYS, partial(processor.measure, vehicle, results))
            random.shuffle(tasks)
            for name, task in tasks:
                _try(f"round {results.round + 1} of {rounds}: {name}", task, results)
        if "start" in parts:
            for results.round in range(effort.start_rounds):
                what = f"start {results.round + 1} of {effort.start_rounds}"
                _try(what, lambda: start.measure_servers(vehicle, results), results)
                _try(what, lambda: start.measure_imports(results), results)
    if "memory" in parts:
        results.round = 0
        _try("memory", lambda: memory.measure_flight(results), results)
    return results


def _each(
    what: str, ways: tuple[ClientSetup, ...], measure_way: Callable[[ClientSetup], None]
) -> Iterator[tuple[str, Callable[[], None]]]:
    return ((f"{what}, {way.name}", partial(measure_way, way)) for way in ways if not way.is_missing)


def _try(what: str, task: Callable[[], None], results: Results) -> None:
    """Measures once. Reports a failure and goes on: one failed round must not end all others."""
    print(what, file=sys.stderr, flush=True)
    try:
        task()
    except (ChildError, RuntimeError, OSError, subprocess.SubprocessError) as error:
        results.failures.append(f"{what}: {error}")
        print(f"{what}: {error}", file=sys.stderr, flush=True)


def plot(results: Results, directory: Path) -> None:
    """Draws the plots, or prints why it cannot."""
    try:
        from benchmarks import plots

        files = plots.write(results, directory)
    except ModuleNotFoundError as error:
        print(f"no plots: {error}; pip install -r benchmarks/requirements.txt", file=sys.stderr)
        return
    print("plots:", *(file.name for file in files), f"in {directory}")


def keep(found: str, figures: str, results: Results) -> None:
    """Writes the targets into the README, all figures into the page beside it, and the plots."""
    text = _README.read_text()
    begin, end = "<!-- newest figures -->", "<!-- end of the newest figures -->"
    pattern = re.compile(f"{begin}.*{end}", re.DOTALL)
    _README.write_text(pattern.sub(lambda _: f"{begin}\n{found}{end}", text))
    head = "# All figures of the newest `make bench`\n\nWhat they are: [Benchmarks](README.md)."
    _ALL_FIGURES.write_text(f"{head}\n\n{figures}\n")
    plot(results, _FIGURES)


def how(rounds: int, took_s: float) -> str:
    """Returns where, when and with which software the figures were measured."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    ).stdout.strip()
    packages = ", ".join(map(_installed, ("grpcio", "protobuf", "pymavlink", "fastcrc", "mavsdk-grpc", "mavsdk")))
    return (
        f"{time.strftime('%Y-%m-%d')}, commit {commit or 'unknown'}, {rounds} rounds in {took_s / 60:.0f} minutes; "
        f"{_processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the end; "
        f"Linux {platform.release()}, Python {platform.python_version()}; {packages}; "
        f"priority: {priority_text()}."
    )


def _installed(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"no {package}"


def _processor() -> str:
    found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    return found[1] if found else platform.machine()


if __name__ == "__main__":
    sys.exit(main())
