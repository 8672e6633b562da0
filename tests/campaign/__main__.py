"""Flies a campaign: ``python -m tests.campaign --autopilot px4 --url udpin://127.0.0.1:14540 --flights 100 --seed 1``.

Writes a line of JSON for each flight to ``flights.jsonl`` in ``--out``, and its record beside it, which ``--judge``
judges again. Exit status 1 where a rule was broken.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from itertools import islice
from pathlib import Path
from urllib.parse import urlsplit

from tests.campaign.evidence import Breach
from tests.campaign.flight import fly
from tests.campaign.judge import judge
from tests.campaign.mutants import MUTANTS
from tests.campaign.plan import Plan, has, plan
from tests.campaign.positions import Origin
from tests.campaign.processes import ROOT, FlightFailedError
from tests.campaign.record import Place, Record
from tests.campaign.rig import Options, Rig
from tests.campaign.soak import SoakWatch
from tests.campaign.tally import tally
from tests.sitl.simulators import ARDUPILOT, PX4

_FLOWN_M = 0.5
_FARTHEST_M = 10_000.0
_MOST_FLIGHTS = 100_000
"""Of one seed."""
_SIMULATORS = {"px4": PX4, "ardupilot": ARDUPILOT}
_LINKS = {
    "px4": ("udpin://127.0.0.1:14540", "udp://127.0.0.1:18570", "udpin://127.0.0.1:14030"),
    "ardupilot": ("tcp://127.0.0.1:5760", "tcp://127.0.0.1:5762", "tcp://127.0.0.1:5763"),
}


def main() -> int:
    """Returns the exit status."""
    arguments = _parser().parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if arguments.judge:
        return _judge_again(arguments.judge)
    options = _options(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    rig = Rig(options)
    try:
        rig.set_parameters()
        soak = SoakWatch(rig.daemon, options.folder / "soak.csv") if arguments.no_faults else None
        status = _campaign(rig, arguments)
        if soak is not None:
            verdict = soak.close()
            print(verdict.text)
            status = status or int(not verdict.is_flat)
    finally:
        rig.close()
    return status


def _campaign(rig: Rig, arguments: argparse.Namespace) -> int:
    verdicts: Counter[str] = Counter()
    rules: Counter[str] = Counter()
    began_s = time.monotonic()
    for number, seed in enumerate(_seeds(arguments)):
        if arguments.minutes is not None and time.monotonic() - began_s > arguments.minutes * 60.0:
            break
        flight = plan(seed, has_faults=not arguments.no_faults)
        verdict, breaches = _fly_and_judge(rig, flight)
        require_at_origin(rig.truth.place)
        verdicts[verdict] += 1
        if verdict == "breach":
            rules.update({breach.rule for breach in breaches})
        print(
            f"{number + 1}: seed {seed} {verdict} {_reported(flight)}", *map(_row, breaches), sep="\n    ", flush=True
        )
        if verdict == "not flown":
            begin_anew(rig)
    summary = {"autopilot": rig.options.autopilot, "flights": dict(verdicts), "rules": dict(rules)}
    (rig.options.folder / "summary.json").write_text(json.dumps(summary, indent=1))
    print(json.dumps(summary))
    return int(bool(verdicts["breach"]))


def require_at_origin(place: Place | None) -> None:
    """Ends the campaign of a vehicle that stands elsewhere: its fence would refuse each take-off."""
    if place is not None and (away_m := math.hypot(*place[:2])) > _FARTHEST_M:
        raise SystemExit(f"the vehicle is {away_m / 1e3:.0f} km from --origin: start the simulator there")


def _fly_and_judge(rig: Rig, flight: Plan) -> tuple[str, list[Breach]]:
    began_s, why = time.monotonic(), ""
    breaches: list[Breach] = []
    try:
        record = fly(rig, flight)
    except (FlightFailedError, AssertionError) as error:
        verdict, why, record = "not flown", str(error), rig.record
        breaches = judge(record)
    else:
        breaches = judge(record)
        verdict = "breach" if breaches else "clean" if _has_taken_off(record) else "idle"
    _write(rig, flight, record, {"verdict": verdict, "why": why, "began_s": began_s}, breaches)
    return verdict, breaches


def _has_taken_off(record: Record) -> bool:
    heights = [each.place[2] for each in record.truth]
    return bool(heights) and max(heights) - min(heights) > _FLOWN_M


def _write(rig: Rig, flight: Plan, record: Record, values: dict[str, object], breaches: list[Breach]) -> None:
    began_s = float(str(values.pop("began_s")))
    line = {
        **asdict(flight),
        **values,
        "took_s": round(time.monotonic() - began_s, 1),
        "calls": [(call.name, call.outcome, call.by, round(call.ended_s - call.began_s, 2)) for call in record.called],
        "setpoints": sum(sent.what == "setpoint" for sent in record.sent),
        "states": len(record.said),
        "truths": len(record.truth),
        "failed": record.failed,
        "breaches": [asdict(breach) for breach in breaches],
    }
    with (rig.options.folder / "flights.jsonl").open("a") as file:
        file.write(json.dumps(line) + "\n")
    with gzip.open(rig.options.folder / f"{flight.seed}.json.gz", "wt") as file:
        file.write(record.to_json())


def _judge_again(files: list[Path]) -> int:
    count, records = 0, []
    for path in files:
        text = gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text()
        records.append(Record.from_json(text))
        breaches = judge(records[-1])
        count += bool(breaches)
        if breaches:
            print(path, *map(_row, breaches), sep="\n    ")
    print(f"{count} of {len(records)} broke a rule: {tally(records)}")
    return int(bool(count))


def begin_anew(rig: Rig) -> None:
    """After a flight that was not flown the simulator may be the cause. It is started anew, landed or not."""
    for _ in range(3):
        steps = (rig.bring_down,) if rig.simulator is None else (rig.bring_down, rig.reboot)
        if [_is_done(step) for step in steps][-1]:
            return


def _is_done(step: Callable[[], object]) -> bool:
    try:
        step()
    except (FlightFailedError, AssertionError, OSError) as error:
        print(f"    {error}", flush=True)
        return False
    return True


def _reported(flight: Plan) -> str:
    faults = ", ".join(f"{fault.kind}@{fault.step}+{fault.delay_s:.1f}" for fault in flight.faults)
    return f"{flight.mission} {' '.join(step.name for step in flight.steps)} [{faults}]"


def _row(breach: Breach) -> str:
    return f"{breach.rule} at {breach.time_s:.2f}: {breach.text}"


def _seeds(arguments: argparse.Namespace) -> Iterable[int]:
    if arguments.only_seed is not None:
        return list(arguments.only_seed)
    count = _MOST_FLIGHTS if arguments.minutes is not None else arguments.flights
    seeds = range(arguments.seed * _MOST_FLIGHTS, (arguments.seed + 1) * _MOST_FLIGHTS)
    return islice((seed for seed in seeds if has(plan(seed), arguments.having)), count)


def _options(arguments: argparse.Namespace) -> Options:
    url, pilot_url, truth_url = _LINKS[arguments.autopilot]
    pilot = urlsplit(arguments.pilot_url or pilot_url)
    assert pilot.hostname is not None
    assert pilot.port is not None
    return Options(
        arguments.autopilot,
        arguments.url or url,
        partial(_SIMULATORS[arguments.autopilot].make_pilot, pilot.hostname, pilot.port),
        arguments.truth_url or truth_url,
        arguments.start,
        arguments.out.resolve() / arguments.autopilot,
        Origin(*map(float, arguments.origin.split(","))),
        arguments.mutant or "",
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    parser.add_argument("--autopilot", choices=tuple(_LINKS), default="ardupilot")
    parser.add_argument("--url", help="the link for the daemon (default: the simulator's first)")
    parser.add_argument("--pilot-url", help="the link for the safety pilot")
    parser.add_argument("--truth-url", help="a third link: the simulator's truth")
    parser.add_argument("--start", default="", metavar="COMMAND", help="starts the simulator; without: it runs already")
    parser.add_argument("--origin", default="47.397742,8.545594,489.4", help="where it starts: degrees, degrees, m")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--judge", nargs="+", type=Path, metavar="RECORD", help="judges records of flights again")
    parser.add_argument("--only-seed", type=int, nargs="+", help="flies these flights, by the seeds in their lines")
    parser.add_argument(
        "--having",
        nargs="+",
        default=(),
        metavar="WORD",
        help="flies only plans with these steps and faults (pilot, go_to)",
    )
    parser.add_argument("--minutes", type=float, help="flies for so long, however many flights that is")
    parser.add_argument(
        "--no-faults", action="store_true", help="no faults; judges the daemon's memory, threads, descriptors"
    )
    parser.add_argument("--mutant", choices=MUTANTS, help="flies a daemon with this defect, to try the judge")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "campaign", metavar="FOLDER")
    return parser


if __name__ == "__main__":
    sys.exit(main())
