"""The use cases of the paper, run as a user runs them, and watched by a client of their own."""

from __future__ import annotations

import itertools
import math
import os
import random
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

import ual
from examples import avoidance, contact, film, perch, survey
from tests.conftest import DaemonProcess, StartDaemon
from tests.waiting import until
from ual import discovery

ROOT = Path(__file__).parents[2]
LIMIT_S = 200.0
SPEED = "light.speed_factor=5"
REAL_TIME = "light.speed_factor=1"
"""For programs that steer by what they see: on a busy computer that is old, and the faster they fly the older."""


class Program:
    """An example that runs."""

    def __init__(self, runtime_dir: Path, name: str, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-W", "error", "-m", f"examples.{name}", *words],
            cwd=ROOT,
            env={**os.environ, discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines: list[str] = []

    def until(self, start: str) -> str:
        """Reads until a line begins so, and returns it."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip())
            if line.startswith(start):
                return line
        raise AssertionError(f"{start!r} never came: {self.lines}")

    def end(self) -> list[str]:
        """Waits for its end, and returns all that it has printed."""
        out, _ = self.process.communicate(timeout=LIMIT_S)
        self.lines += out.splitlines()
        assert self.process.returncode == 0, self.lines
        return self.lines


def is_running(program: Program) -> bool:
    """Returns whether it runs still, a little later."""
    try:
        program.process.wait(0.05)
    except subprocess.TimeoutExpired:
        return True
    return False


class Watch:
    """Positions of UAVs in map, as an observer sees them."""

    def __init__(self, uavs: Sequence[ual.Uav]) -> None:
        self.newest: dict[str, ual.Vector3] = {}
        self.moments: list[dict[str, ual.Vector3]] = []
        self.tracks: dict[str, list[tuple[float, ual.Vector3]]] = {uav.ns: [] for uav in uavs}
        self._lock = threading.Lock()
        self._to_map = {uav.ns: uav.transform("map", f"{uav.ns}/odom") for uav in uavs}

    def see(self, ns: str, sample: ual.Telemetry) -> None:
        """Keeps a sample, beside the newest of the others."""
        if sample.pose is None:
            return
        with self._lock:
            self.newest[ns] = self._to_map[ns].apply(sample.pose.position)
            self.tracks[ns].append((sample.stamp_s, self.newest[ns]))
            self.moments.append(dict(self.newest))


@contextmanager
def watched(*names: str) -> Iterator[Watch]:
    """Watches UAVs during the block."""
    with ExitStack() as stack:
        uavs = [stack.enter_context(ual.Uav(name)) for name in names]
        watch = Watch(uavs)
        for uav in uavs:
            stack.enter_context(uav.subscribe(partial(watch.see, uav.ns), rate_hz=20.0))
        yield watch


def start_fleet(start_daemon: StartDaemon, count: int, speed: str = SPEED, *more: str) -> list[str]:
    names = [f"uav_{i}" for i in range(1, count + 1)]
    start_daemon("--fleet", str(count), "--set", speed, *more).wait_for("state", ns=names[-1], new="LANDED_DISARMED")
    return names


def start_armed(start_daemon: StartDaemon, ns: str = "uav_1") -> DaemonProcess:
    daemon = start_daemon("--auto-arm", "--set", SPEED, ns=ns)
    daemon.wait_for("state", new="LANDED_ARMED")
    return daemon


def nearest_m(watch: Watch) -> float:
    """Returns the least distance between two of them, along the ground."""
    return min(_nearest_m(a, b) for a, b in itertools.combinations(watch.tracks.values(), 2))


def _nearest_m(track: list[tuple[float, ual.Vector3]], other: list[tuple[float, ual.Vector3]]) -> float:
    """Returns the least distance of two at the same time: a busy computer may show the samples of one later than those
    of the other.
    """
    nearest, i = math.inf, 0
    for (begin_s, begin), (end_s, end) in itertools.pairwise(track):
        while i < len(other) and other[i][0] < begin_s:
            i += 1
        while i < len(other) and other[i][0] <= end_s:
            at_s, there = other[i]
            here = begin + (end - begin) * ((at_s - begin_s) / max(end_s - begin_s, 1e-9))
            nearest, i = min(nearest, (here - there).horizontal_norm()), i + 1
    return nearest


@pytest.mark.parametrize("name", ["avoidance", "contact", "film", "perch", "survey", "survivors"])
def test_a_use_case_is_a_short_program(name: str) -> None:
    assert len((ROOT / "examples" / f"{name}.py").read_text().splitlines()) <= 150


# --- Avoidance --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_movers_that_choose_their_velocities_never_meet(seed: int) -> None:
    chance = random.Random(seed)
    angles = [i * math.tau / 5 + chance.uniform(-0.2, 0.2) for i in range(5)]
    places = [ual.Vector3(5.0 * math.cos(a), 5.0 * math.sin(a)) for a in angles]
    goals = [-place for place in places]
    movers = [avoidance.Mover(place, ual.Vector3()) for place in places]
    nearest = math.inf
    for _ in range(1200):
        chosen = [
            avoidance.choose(me, avoidance.towards(goals[i], me.position), [m for j, m in enumerate(movers) if j != i])
            for i, me in enumerate(movers)
        ]
        movers = [avoidance.Mover(m.position + v * 0.05, v) for m, v in zip(movers, chosen, strict=True)]
        pairs = itertools.combinations(movers, 2)
        nearest = min(nearest, *((a.position - b.position).norm() for a, b in pairs))
        if all((m.position - g).norm() < 0.2 for m, g in zip(movers, goals, strict=True)):
            break
    else:
        pytest.fail(f"not all are there: {movers}")
    assert nearest > 0.9 * avoidance.APART_M


def test_uavs_change_positions_and_keep_apart(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    names = start_fleet(start_daemon, 4, REAL_TIME)
    with watched(*names) as watch:
        before = dict(zip(names, _positions(names), strict=True))
        lines = Program(runtime_dir, "avoidance", *names, "--arm").end()
        after = dict(zip(names, _positions(names), strict=True))
    assert lines == ["all there, all landed"]
    for name, opposite in zip(names, reversed(names), strict=True):
        assert (after[name] - before[opposite]).horizontal_norm() < 0.5
    assert nearest_m(watch) > 0.5


def _positions(names: Sequence[str]) -> list[ual.Vector3]:
    with ual.Team(names) as team:
        return [place.translation for place in team.transform().values()]


def test_where_one_falls_silent_the_other_lands(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    daemons = [start_armed(start_daemon, ns) for ns in ("uav_1", "uav_2")]
    program = Program(runtime_dir, "avoidance", "uav_1", "uav_2")
    with ual.Uav("uav_2") as uav:
        uav.wait_for(ual.State.FLYING_AUTO)
        until(lambda: uav.velocity().twist.linear.norm() > 0.1)
        uav.simulation.set_speed_factor(0.0)  # it does not arrive before the other one is silent
        assert program.process.poll() is None
        with daemons[0].frozen():
            uav.simulation.set_speed_factor(5.0)
            out, _ = program.process.communicate(timeout=LIMIT_S)
        assert program.process.returncode == 1
        assert "uav_1: DAEMON_UNREACHABLE: " in out.splitlines()[-1]
        assert uav.state() in (ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED)


# --- A survey with one drop zone --------------------------------------------------------------------------------------


def test_never_two_are_in_the_drop_zone(start_daemon: StartDaemon, runtime_dir: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    names, plot = start_fleet(start_daemon, 3), tmp_path / "survey.svg"
    with watched(*names) as watch:
        lines = Program(runtime_dir, "survey", *names, "--arm", "--things", "3", "--plot", str(plot)).end()
    assert lines[-1] == "all dropped, all landed"
    assert sum(line.endswith("enters the zone") for line in lines) == 3
    inside = [
        {ns for ns, p in moment.items() if (p - survey.ZONE).horizontal_norm() < survey.ZONE_RADIUS_M}
        for moment in watch.moments
    ]
    assert max(map(len, inside)) == 1
    lowest_m = min(moment[ns].z for moment, who in zip(watch.moments, inside, strict=True) for ns in who)
    assert lowest_m == pytest.approx(survey.PICK_M, abs=0.3)
    assert plot.stat().st_size > 1000


def test_where_one_cannot_take_off_the_other_one_lands(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    start_armed(start_daemon)
    start_daemon(ns="uav_2").wait_for("state", new="LANDED_DISARMED")
    program = Program(runtime_dir, "survey", "uav_1", "uav_2")
    out, _ = program.process.communicate(timeout=LIMIT_S)
    assert program.process.returncode == 1
    assert "ual.errors.TeamError: uav_2: " in out.splitlines()[-1]
    with ual.Uav("uav_1") as uav:
        assert uav.state() in (ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED)
        assert uav.pose().pose.position.z < 0.1


# --- A team that loses a member ---------------------------------------------------------------------------------------


def test_a_team_flies_all_lanes_though_one_is_killed_and_one_taken_over(
    start_daemon: StartDaemon, runtime_dir: Path
) -> None:
    names = ["uav_1", "uav_2", "uav_3"]
    daemons = {name: start_armed(start_daemon, name) for name in names}
    program = Program(runtime_dir, "survivors", *names, "--lanes", "6")
    program.until("uav_2 flies lane")
    daemons["uav_2"].signal(signal.SIGKILL)
    program.until("uav_2 is lost in lane")
    with ual.Uav("uav_3") as uav:
        uav.wait_for(ual.State.FLYING_AUTO)
        uav.simulation.pilot_take_over()
        lines = program.end()
        assert uav.state() is ual.State.FLYING_MANUAL  # its pilot flies it; nobody lands it
    assert lines[-1] == "the field is done"
    flown = [int(lane) for line in lines if "has flown" in line for lane in re.findall(r"\d+", line.split("flown")[1])]
    assert sorted(flown) == list(range(6))
    with ual.Uav("uav_1") as uav:
        assert uav.state() in (ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED)


def test_when_all_are_lost_the_lanes_that_are_left_are_reported(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    daemon = start_armed(start_daemon)
    program = Program(runtime_dir, "survivors", "uav_1", "--lanes", "2")
    program.until("uav_1 flies lane")
    daemon.signal(signal.SIGKILL)
    out, _ = program.process.communicate(timeout=LIMIT_S)
    assert program.process.returncode == 1
    assert out.splitlines()[-1] == "RuntimeError: all are lost, and lanes are left: [0, 1]"


# --- Contact ----------------------------------------------------------------------------------------------------------


def test_each_point_is_touched_held_and_tried_again(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    name = start_armed(start_daemon).ns
    face = ual.Transform(ual.Vector3(3.0, 1.0, 0.0), ual.Quaternion.from_yaw(math.pi / 2), "map", "face")
    with watched(name) as watch:
        lines = Program(runtime_dir, "contact", name, "--face", "3", "1", "0", "90", "--deaf", "1", "--pictures").end()
    points = [line for line in lines if line.startswith("point")]
    assert points[0] == "point -1 2, try 1: no contact"
    assert [line.partition(", ")[2] for line in points[1:]] == ["try 2: held", "try 1: held", "try 1: held"]
    assert [line for line in lines if line.startswith("picture")] == [f"picture {number}" for number in range(3)]
    assert lines[-1] == "3 of 3 points held, landed"
    to_face = face.inverse()
    with ual.Uav(name) as uav:
        taken = [each.body for each in uav.cameras[0].photos()]
    for body, (y, z) in zip(taken, contact.POINTS, strict=True):
        assert body is not None
        at = to_face.apply(body.pose.position)
        assert (at.y, at.z) == pytest.approx((y, z), abs=0.2)
        assert at.x + contact.TIP_M > -0.1  # in contact
    tips = [to_face.apply(moment[name]).x + contact.TIP_M for moment in watch.moments]
    assert 0.0 <= max(tips) < contact.REACH_M + 0.3  # a deaf sensor lets it go so far, and not further


# --- Perching ---------------------------------------------------------------------------------------------------------


def test_a_pipe_that_moves_breaks_the_approach_off_and_it_perches_where_the_pipe_is(
    start_daemon: StartDaemon, runtime_dir: Path
) -> None:
    name = start_armed(start_daemon).ns
    with ual.Uav(name) as uav:
        program = Program(runtime_dir, "perch", name, "--pipe", "2", "1", "1")
        until(lambda: any(frame.frame_id == "pipe" for frame in uav.frames()))

        def over_the_pipe_m() -> float:
            return uav.transform("pipe").translation.z - perch.FOOT_M

        until(lambda: uav.state() is ual.State.FLYING_AUTO and over_the_pipe_m() < perch.NEAR_M / 2)
        uav.add_frame(ual.Transform(ual.Vector3(2.6, 1.0, 1.0), frame_id="map", child_frame_id="pipe"))
        assert program.until("broken off")
        program.until("perched")
        lines = program.end()
        assert lines[-1] == "landed beside the pipe"
        assert uav.transform("map").translation.x == pytest.approx(2.6 - 1.5, abs=0.4)


@pytest.mark.parametrize("aside_m", [0.0, 0.1, 0.3, 1.0, 3.0])
def test_it_never_goes_down_outside_the_cone(aside_m: float) -> None:
    for above_m in (0.0, 0.2, 0.6, 1.5):
        v = perch.velocity(ual.Vector3(aside_m, 0.0, perch.FOOT_M + above_m))
        assert v.x <= 0.0
        assert v.z == 0.0 or aside_m < 0.08 + 0.2 * above_m


# --- Film -------------------------------------------------------------------------------------------------------------


def test_the_gimbals_face_the_car_all_the_time(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    names = start_fleet(start_daemon, 2, SPEED, "--set", "light.gimbals=[{speed_rad_s: 100}]")
    program = Program(runtime_dir, "film", *names, "--shot-s", "4", "--arm", "--gimbal", "--pictures")
    program.until("circle")
    off: list[float | None] = []
    with ExitStack() as stack:
        gimbals = [stack.enter_context(ual.Uav(name)).gimbals[0] for name in names]
        for _ in range(40):
            off += [gimbal.status().off_target_rad for gimbal in gimbals]
    lines = program.end()
    assert lines[-1] == "filmed, landed"
    taken = {line.split()[0]: int(line.split()[1]) for line in lines if line.endswith("pictures")}
    assert taken.keys() == {f"{name}:" for name in names}
    assert min(taken.values()) >= 12  # at least as many as seconds have passed
    known = sorted(each for each in off if each is not None)
    assert len(known) > 40
    # A daemon that stood for a while looks where the car was: the middle one tells.
    assert known[len(known) // 2] < math.radians(5.0)


def test_the_car_is_in_the_picture_of_both(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    names = start_fleet(start_daemon, 2, REAL_TIME)
    aside: dict[str, list[float]] = {name: [] for name in names}
    with ExitStack() as stack:
        program = Program(runtime_dir, "film", *names, "--shot-s", "4", "--arm")
        program.until("circle")
        uavs = [stack.enter_context(ual.Uav(name)) for name in names]
        shots = stack.enter_context(watched(*names))
        for _ in iter(partial(is_running, program), False):
            for uav in uavs:
                here = uav.transform(f"{uav.ns}/base_link", "car").translation
                if uav.state() is ual.State.FLYING_AUTO and uav.is_idle():  # a task is the way up, or home
                    aside[uav.ns].append(abs(math.atan2(here.y, here.x)))
        assert program.end()[-1] == "filmed, landed"
    assert list(film.SHOTS) == ["circle", "chase", "fly-by"]
    for name in names:
        in_picture = sum(angle < math.radians(40.0) for angle in aside[name]) / len(aside[name])
        assert in_picture > 0.6, (name, in_picture)
    apart = [(m["uav_1"] - m["uav_2"]).norm() for m in shots.moments if len(m) == 2]
    assert min(apart) > 0.8
