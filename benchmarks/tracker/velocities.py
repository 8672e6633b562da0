"""Accuracy with which a real autopilot, in its running simulator, follows commanded velocities.

python -m benchmarks.tracker.velocities [--only px4|ardupilot] [--runs N] [--case NAME] [--raw FILE]

Each case begins in another way. All figures count from the first moment of the velocity on.
"""

from __future__ import annotations

import argparse
import itertools
import json
import logging
import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from benchmarks.tracker.autopilots import ARDUPILOT, PX4, RealUav, TrackedAutopilot
from benchmarks.tracker.truth import Truth
from tests.backend_of import backend_of
from tests.ual_daemon.tracker.craft import at_most
from ual.errors import UalError
from ual.geometry import Pose, Twist, Vector3
from ual.types import Telemetry
from ual_daemon.backends.values import PositionSetpoint, Setpoint, VelocityResponses
from ual_daemon.settings import Tracker
from ual_daemon.tracker.velocity_end_point import MOST_LAG_M, ExpectedMotion

_AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
_PERIOD_S = 0.05
_FLOWN_S = 15.0
_BEFORE_S = 6.0
_HEIGHT_M = 10.0
_HELD_S = 4.0
_EAST, _NORTH, _STILL = Vector3(1.0, 0.0, 0.0), Vector3(0.0, 1.0, 0.0), Vector3()
_SLOWEST = 0.85
"""A run counts only if the simulator's time passed at this part of real time at least."""
_PATIENCE_S = 60.0
_ROUND = (_EAST, _NORTH, _EAST * -1.0, _NORTH * -1.0)
_FAST_M_S = 4.0
_GO_TO_M_S = 5.0


@dataclass(frozen=True)
class VelocityCase:
    """A velocity over time, and what is flown before. Its figures count from `since_s` on. `is_held`: a held position
    instead, for comparison.
    """

    begin: Callable[[RealUav, Pose], None]
    velocity: Callable[[float], Vector3]
    since_s: float = 0.0
    is_held: bool = False


def _hold(uav: RealUav, at: Pose) -> None:
    uav.ual.set_pose(at)
    time.sleep(_HELD_S)


def _go_to(uav: RealUav, at: Pose) -> None:
    uav.ual.go_to_waypoint(_from(at, Vector3(60.0)), blocking=False, max_speed_m_s=_GO_TO_M_S)
    time.sleep(5.0)


def _path(uav: RealUav, at: Pose) -> None:
    corners = (Vector3(8.0), Vector3(8.0, 8.0), Vector3(0.0, 8.0))
    uav.ual.follow_path([_from(at, corner) for corner in corners], blocking=False, corner_radius_m=2.0)
    time.sleep(4.0)


def _first(first: Vector3, then: Vector3) -> Callable[[float], Vector3]:
    return lambda passed_s: first if passed_s < _BEFORE_S else then


def _from(at: Pose, offset: Vector3) -> Pose:
    here = at.position + offset
    return Pose.at(here.x, here.y, here.z, at.yaw_rad)


CASES: Mapping[str, VelocityCase] = {
    "a held position": VelocityCase(_hold, lambda _: _STILL, is_held=True),
    "velocity 0 after a hold": VelocityCase(_hold, lambda _: _STILL),
    "1 m/s after a hold": VelocityCase(_hold, lambda _: _NORTH),
    "3 m/s after a hold": VelocityCase(_hold, lambda _: _NORTH * 3.0),
    "1 m/s across a go-to at 5 m/s": VelocityCase(_go_to, lambda _: _NORTH),
    "1 m/s out of a path's corner": VelocityCase(_path, lambda _: _NORTH),
    "1 m/s, a turn by 90 degrees": VelocityCase(_hold, _first(_EAST, _NORTH), _BEFORE_S),
    "1 m/s, another direction each second": VelocityCase(_hold, lambda passed_s: _ROUND[int(passed_s) % 4]),
    "a stop from 4 m/s": VelocityCase(_hold, _first(_EAST * _FAST_M_S, _STILL), _BEFORE_S),
}


class VelocityMoment(NamedTuple):
    """Positions `time_s` after the velocity began: estimated, true, and the one to which that velocity leads."""

    time_s: float
    commanded: Vector3
    estimated: Vector3
    true: Vector3
    expected: Vector3
    velocity: Vector3
    """As the autopilot estimates it."""


@dataclass(frozen=True)
class VelocityFigures:
    """Errors of one run, in metres; `made` is the distance along the velocity as a part of the expected distance."""

    beside_m: float
    height_m: float
    off_m: float
    made: float


def _figures(seen: Sequence[VelocityMoment], place: Callable[[VelocityMoment], Vector3]) -> VelocityFigures:
    """Returns the figures of the places that `place` picks, relative to where the first one should have been."""
    off = [place(each) - each.expected for each in seen]
    beside = [_across(seen_then.commanded, each) for seen_then, each in zip(seen, off, strict=True)]
    way, expected = place(seen[-1]) - place(seen[0]), seen[-1].expected - seen[0].expected
    ahead = seen[-1].commanded
    made = way.dot(ahead) / expected.dot(ahead) if ahead.norm() and abs(expected.dot(ahead)) > 1.0 else 1.0
    return VelocityFigures(
        max(beside), max(abs(each.z) for each in off), max(each.horizontal_norm() for each in off), made
    )


def _across(velocity: Vector3, off: Vector3) -> float:
    """Returns the horizontal part of `off` across a velocity; all of it where that is 0."""
    speed_m_s = velocity.horizontal_norm()
    return abs(off.y * velocity.x - off.x * velocity.y) / speed_m_s if speed_m_s else off.horizontal_norm()


class VelocityRecorder:
    """Notes where the UAV is at each update while a velocity is flown."""

    def __init__(self, uav: RealUav, truth: Truth) -> None:
        self._truth = truth
        self._responses: VelocityResponses = backend_of(uav.ual).info().velocity_responses
        self._sent: Setpoint | None = None
        """The last setpoint before the velocity began."""
        self._expected: tuple[ExpectedMotion, ExpectedMotion] | None = None
        self._offset, self._begun_s, self._last_s = Vector3(), 0.0, 0.0
        self.commanded: Vector3 | None = None
        """Commanded velocity now; None while something else is flown."""
        self.seen: list[VelocityMoment] = []
        uav.ual.vehicle.observe_setpoints(self._hear)
        uav.ual.subscribe(self._note)

    def restart(self) -> None:
        """Forgets the run before."""
        self.commanded, self._expected, self.seen = None, None, []

    def _hear(self, setpoint: Setpoint) -> None:
        if self.commanded is None:
            self._sent = setpoint

    def _note(self, telemetry: Telemetry) -> None:
        pose, velocity, true, commanded = telemetry.pose, telemetry.velocity, self._truth.position, self.commanded
        if commanded is None or pose is None or velocity is None or true is None:
            self._last_s = telemetry.stamp_s
            return
        here, now_s = pose.position, telemetry.stamp_s
        if self._expected is None:
            self._begun_s, self._offset = now_s, true - here
            self._expected = self._begin(here)
        expected = self._advance(commanded, now_s)
        self.seen.append(
            VelocityMoment(now_s - self._begun_s, commanded, here, true - self._offset, expected, velocity.linear)
        )

    def _begin(self, here: Vector3) -> tuple[ExpectedMotion, ExpectedMotion]:
        """The place begins with the motion of the reference before; the truth where the estimate is then."""
        sent = self._sent
        assert sent is not None
        place = here + at_most(sent.position - here, MOST_LAG_M) if isinstance(sent, PositionSetpoint) else here
        acceleration = sent.acceleration or Vector3()
        return (
            ExpectedMotion(_level(place), _level(sent.velocity), _level(acceleration), self._responses.horizontal),
            ExpectedMotion(_upright(place), _upright(sent.velocity), _upright(acceleration), self._responses.vertical),
        )

    def _advance(self, commanded: Vector3, now_s: float) -> Vector3:
        assert self._expected is not None
        passed_s, self._last_s = now_s - self._last_s, now_s
        level, upright = self._expected
        level.advance(_level(commanded), passed_s, self._responses.horizontal)
        upright.advance(_upright(commanded), passed_s, self._responses.vertical)
        return level.position + upright.position


def _level(vector: Vector3) -> Vector3:
    return Vector3(vector.x, vector.y)


def _upright(vector: Vector3) -> Vector3:
    return Vector3(0.0, 0.0, vector.z)


Found = Mapping[str, list[tuple[VelocityFigures, VelocityFigures]]]
"""By the case: the figures of each run by its estimate, and by the truth."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tracker.velocities", description=__doc__)
    parser.add_argument("--only", action="append", choices=tuple(_AUTOPILOTS))
    parser.add_argument("--runs", type=int, default=10, help="of each case  [10]")
    parser.add_argument("--case", action="append", choices=tuple(CASES))
    parser.add_argument("--raw", type=Path, help="a file for all that was seen, a JSON object a line for each run")
    arguments = parser.parse_args()
    logging.getLogger("ual_daemon").setLevel(logging.ERROR)
    for name in arguments.only or _AUTOPILOTS:
        autopilot = _AUTOPILOTS[name]
        if autopilot.missing:
            print(
                f"*** {autopilot.name} IS NOT FLOWN: set {autopilot.missing} (docs/reference/backends/mavlink.md) ***\n"
            )
            continue
        print(_table(autopilot.name, _fly(autopilot, arguments.case or tuple(CASES), arguments.runs, arguments.raw)))
    return 0


def _fly(autopilot: TrackedAutopilot, cases: Sequence[str], runs: int, raw: Path | None) -> Found:
    found: dict[str, list[tuple[VelocityFigures, VelocityFigures]]] = defaultdict(list)
    truth = Truth()
    with autopilot.pilot() as pilot, RealUav(autopilot, Tracker.REFERENCE, truth) as uav:
        truth.listen(pilot)
        ground = uav.take_off(pilot)
        recorder = VelocityRecorder(uav, truth)
        home = Pose.at(ground.position.x, ground.position.y, _HEIGHT_M, ground.yaw_rad)
        for number, name in itertools.product(range(1, runs + 1), cases):
            seen = _run(uav, recorder, CASES[name], home)
            both = _figures(seen, lambda each: each.estimated), _figures(seen, lambda each: each.true)
            found[name].append(both)
            print(
                f"{autopilot.name} {number}, {name}: {_short(both[0])}; truly {_short(both[1])}",
                file=sys.stderr,
                flush=True,
            )
            if raw is not None:
                line = json.dumps({"autopilot": autopilot.name, "case": name, "seen": [_plain(each) for each in seen]})
                with raw.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
        uav.ual.go_to_waypoint(home)
        uav.land()
    return found


def _run(uav: RealUav, recorder: VelocityRecorder, case: VelocityCase, home: Pose) -> list[VelocityMoment]:
    """Flies one run; flies it again where a busy computer has slowed the simulator or let the autopilot take over."""
    while True:
        try:
            uav.ual.go_to_waypoint(home)
            recorder.restart()
            case.begin(uav, home)
            pace = _stream(uav, case.velocity, case.since_s + _FLOWN_S, recorder, home if case.is_held else None)
        except UalError as error:
            print(f"again, because {error}", file=sys.stderr, flush=True)
            _take_control(uav, home)
        else:
            seen = [each for each in recorder.seen if each.time_s >= case.since_s]
            recorder.commanded = None
            if pace >= _SLOWEST:
                return seen
            print(f"again, because the simulator ran at {pace:.2f} of real time", file=sys.stderr, flush=True)


def _take_control(uav: RealUav, home: Pose) -> None:
    """Takes control once the UAV is there again."""
    until_s = time.monotonic() + _PATIENCE_S
    while True:
        try:
            uav.take_control(home)
        except UalError:
            if time.monotonic() > until_s:
                raise
            time.sleep(1.0)
        else:
            return


def _stream(
    uav: RealUav,
    velocity: Callable[[float], Vector3],
    duration_s: float,
    recorder: VelocityRecorder | None = None,
    held: Pose | None = None,
) -> float:
    """Commands velocities, or a held pose. Returns the part of real time at which the simulator's passed."""
    begun_s, boot_s = time.monotonic(), uav.truth.boot_s
    while (passed_s := time.monotonic() - begun_s) < duration_s:
        commanded = velocity(passed_s)
        if recorder is not None:
            recorder.commanded = commanded
        if held is None:
            uav.ual.set_velocity(Twist(commanded))
        else:
            uav.ual.set_pose(held)
        time.sleep(_PERIOD_S)
    return (uav.truth.boot_s - boot_s) / (time.monotonic() - begun_s)


def _plain(seen: VelocityMoment) -> list[float]:
    vectors = seen[1:]
    return [round(value, 3) for value in (seen.time_s, *(v for each in vectors for v in (each.x, each.y, each.z)))]


def _short(figures: VelocityFigures) -> str:
    return ", ".join(f"{name} {value:.2f}" for name, value in asdict(figures).items())


def _table(title: str, found: Found) -> str:
    """Returns the median and the largest value of all runs; of the way made the smallest and the largest."""
    head = ("beside, m", "height, m", "made", "beside by truth, m", "height by truth, m", "made by truth")
    rows = [f"| {title} | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for name, runs in found.items():
        cells = []
        for each in ([kept for kept, _ in runs], [true for _, true in runs]):
            cells += [_spread([f.beside_m for f in each]), _spread([f.height_m for f in each])]
            made = [f.made for f in each]
            cells.append(f"{min(made):.2f} to {max(made):.2f}" if set(made) != {1.0} else "")
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _spread(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.2f} ({max(values):.2f})"


if __name__ == "__main__":
    sys.exit(main())
