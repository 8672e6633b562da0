"""A recorded flight as a UAV: decoded anew from its packets, or reported as it was."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tests.ual_daemon.backends.mavlink.traces import load
from tests.ual_daemon.replay.recordings import light_flight, raw_recording, recording_of
from tests.waiting import LIMIT_S
from ual.errors import NotSupportedError
from ual.geometry import Pose, Transform, Twist, Vector3
from ual.recording.file import File
from ual.recording.recorder import Entry
from ual.recording.telemetry import TelemetryTopics
from ual.types import Frame, State, Telemetry
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.program.main import main
from ual_daemon.replay import PlayedVehicle
from ual_daemon.replay.player import ENDED
from ual_daemon.settings import ConfigError

FAST = {"speed_factor": 1e6}


class Watched:
    """A replayed UAV, and its samples."""

    def __init__(self, path: Path, ns: str = "uav_1", **settings: Any) -> None:
        self.vehicle = PlayedVehicle(BackendOptions(ns, str(path), {**FAST, **settings}))
        self.samples: list[Telemetry] = []
        self._condition: Callable[[Telemetry], bool] = lambda _: False
        self._is_so = threading.Event()
        self.vehicle.subscribe(self._take)

    def _take(self, sample: Telemetry) -> None:
        if self._is_so.is_set():
            return
        if self._condition(sample):
            self._is_so.set()
        else:
            self.samples.append(sample)

    def until(self, condition: Callable[[Telemetry], bool]) -> list[Telemetry]:
        """Plays until a sample fulfils a condition. The samples before it."""
        self._condition = condition
        self.vehicle.open()
        try:
            assert self._is_so.wait(LIMIT_S)
        finally:
            self.vehicle.close()
        return self.samples

    def to_the_end(self) -> list[Telemetry]:
        return self.until(lambda sample: sample.status_text == ENDED)


def states(samples: list[Telemetry]) -> list[State]:
    found: list[State] = []
    for sample in samples:
        if not found or found[-1] is not sample.state:
            found.append(sample.state)
    return found


@pytest.fixture(scope="module")
def flight() -> list[Telemetry]:
    return light_flight()


@pytest.fixture(scope="module")
def recording_file(flight: list[Telemetry], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recording_of(flight, tmp_path_factory.mktemp("recording_file") / "light.mcap")


AS_FLOWN = {
    "px4_auto_takeoff_loiter_rtl": ("PX4", "TAKING_OFF FLYING_MANUAL LANDING"),
    "ardupilot_guided_manual_recover": ("ArduPilot", "TAKING_OFF FLYING_AUTO FLYING_MANUAL FLYING_AUTO LANDING"),
}


@pytest.mark.parametrize("name", AS_FLOWN)
def test_a_flight_is_decoded_anew_from_its_packets(tmp_path: Path, name: str) -> None:
    autopilot, in_the_air = AS_FLOWN[name]
    watched = Watched(raw_recording(load(name), tmp_path / "flight.mcap"))
    samples = watched.to_the_end()
    expected = f"UNINITIALIZED LANDED_DISARMED LANDED_ARMED {in_the_air} LANDED_ARMED LANDED_DISARMED"
    assert [state.name for state in states(samples)] == expected.split()
    info = watched.vehicle.info()
    assert (info.autopilot, info.backend, info.capabilities) == (autopilot, "replay", frozenset())
    heights = [sample.pose.position.z for sample in samples if sample.pose is not None]
    assert max(heights) > 1.5


def test_a_flight_without_packets_is_reported_as_it_was(flight: list[Telemetry], recording_file: Path) -> None:
    samples = Watched(recording_file).to_the_end()
    assert [sample.state for sample in samples] == [sample.state for sample in flight]
    for name in ("state_reason", "pose", "velocity", "reference_pose", "odometry", "transform", "battery", "armed"):
        assert [getattr(s, name) for s in samples[:-1]] == [getattr(s, name) for s in flight[:-1]], name
    tasks = [None if s.task is None else (s.task.id, s.task.kind, s.task.status) for s in samples]
    assert tasks == [None if s.task is None else (s.task.id, s.task.kind, s.task.status) for s in flight]


def test_the_frames_are_those_of_the_namespace(recording_file: Path) -> None:
    samples = Watched(recording_file, "drone").to_the_end()
    last = samples[-1]
    assert last.odometry is not None
    assert last.transform is not None
    names = (last.frame_id, last.odometry.child_frame_id, last.transform.frame_id, last.transform.child_frame_id)
    assert names == ("drone/odom", "drone/base_link", "map", "drone/base_link")


def test_it_is_played_from_a_time_on(flight: list[Telemetry], recording_file: Path) -> None:
    begin_s = 3.0
    expected = [sample for sample in flight if sample.stamp_s - flight[0].stamp_s >= begin_s - 1e-6]
    samples = Watched(recording_file, begin_s=begin_s).to_the_end()
    assert abs(len(samples) - len(expected)) <= 1
    assert samples[-1].pose == flight[-1].pose


def test_it_is_played_again_and_again(flight: list[Telemetry], recording_file: Path) -> None:
    begun: list[None] = []

    def third_time(sample: Telemetry) -> bool:
        if sample.status_text == "the recording begins again":
            begun.append(None)
        return len(begun) == 3

    samples = Watched(recording_file, loop=True).until(third_time)
    once = states(flight)
    assert states(samples) == [*once, State.UNINITIALIZED, *once, State.UNINITIALIZED, *once]
    assert samples[-1].pose == flight[-1].pose  # the frames have not moved


def test_at_its_end_nothing_is_received_any_more(recording_file: Path) -> None:
    def is_lost(sample: Telemetry) -> bool:
        return sample.status_text == ENDED and sample.state is State.UNINITIALIZED

    watched = Watched(recording_file)
    assert states(watched.until(is_lost))[-1] is not State.UNINITIALIZED
    assert watched.vehicle.state() is State.UNINITIALIZED


def test_nothing_can_be_executed(recording_file: Path) -> None:
    def refused(command: Callable[[], object]) -> None:
        with pytest.raises(NotSupportedError):
            command()

    with ExitStack() as stack:
        settings = {**FAST, "speed_factor": 0.001}
        uav = stack.enter_context(UAL("replay", url=str(recording_file), backend_settings=settings, allow_arming=True))
        uav.vehicle.subscribe(lambda _: None)
        for command in (
            uav.arm,
            lambda: uav.take_off(2.0),
            uav.land,
            lambda: uav.go_to_waypoint(Pose.at(1.0, 1.0, 2.0)),
            lambda: uav.go_to_waypoint_geo(47.0, 8.0, 10.0),
            lambda: uav.follow_path([Pose.at(1.0, 1.0, 2.0)]),
            lambda: uav.set_pose(Pose.at(1.0, 1.0, 2.0)),
            lambda: uav.set_velocity(Twist()),
            uav.return_to_launch,
            uav.recover_from_manual,
            uav.abort,
            uav.set_home,
        ):
            refused(command)


def test_it_has_no_lease(recording_file: Path) -> None:
    with UAL("replay", url=str(recording_file), backend_settings={**FAST, "speed_factor": 0.001}) as uav:
        with pytest.raises(NotSupportedError, match="uav_1 cannot be commanded: this is a recording"):
            uav.lease("a program")
        assert uav.lease_info() is None


def test_a_frame_can_be_added_and_removed(recording_file: Path) -> None:
    with UAL("replay", url=str(recording_file), backend_settings={**FAST, "speed_factor": 0.001}) as uav:
        uav.add_frame(Transform(Vector3(1.0, 2.0, 3.0), child_frame_id="tower"))
        assert uav.transform("map", "tower").translation == Vector3(1.0, 2.0, 3.0)
        uav.remove_frame("tower")
        assert "tower" not in {frame.frame_id for frame in uav.frames()}


def test_frames_move_as_they_were_recorded(flight: list[Telemetry], tmp_path: Path) -> None:
    """Viewers and replays kept the place that a moving frame had when it was added, or had none."""
    path, begin_ns = tmp_path / "moving.mcap", round(flight[0].stamp_s * 1e9)
    topics, file = TelemetryTopics("uav_1"), File(path, {})
    told: list[list[Frame]] = []
    for number, sample in enumerate(flight[:60]):
        place = Transform(Vector3(0.1 * number), frame_id="uav_1/odom", child_frame_id="uav_1/car")
        mast = Transform(Vector3(0.0, 0.0, 2.0), frame_id="uav_1/car", child_frame_id="mast")
        frames = [
            Frame("map", "", None, is_static=True),
            Frame("mast", "uav_1/car", mast, is_static=True),
            Frame("uav_1/car", "uav_1/odom", place, is_static=False),
        ]
        told.append(frames if number < 40 else frames[:1])
        log_ns = begin_ns + number * 20_000_000
        topics.write_frames(file, Entry(topics.write_frames, log_ns, told[-1]))
        topics.write_sample(file, Entry(topics.write_sample, log_ns + 1, sample))
    file.finish()
    watched = Watched(path, "drone")
    found: list[dict[str, Transform]] = []

    def note(_: Telemetry) -> None:
        frames = watched.vehicle.frames()
        found.append({each.frame_id: each.transform for each in frames if each.transform is not None})

    watched.vehicle.subscribe(note)
    watched.to_the_end()
    places = [each["drone/car"].translation.x for each in found[:40]]
    assert places == pytest.approx([0.1 * number for number in range(40)])
    assert all(each["mast"].frame_id == "drone/car" for each in found[:40])
    assert not any(each.keys() & {"drone/car", "mast"} for each in found[40:60])


def test_packets_without_telemetry_are_no_flight_of_ours(tmp_path: Path) -> None:
    watched = Watched(raw_recording(load("ardupilot_guided_manual_recover"), tmp_path / "flight.mcap"))
    flying = [sample for sample in watched.to_the_end() if sample.state is State.FLYING_AUTO]
    assert {sample.task for sample in flying} == {None}
    told = "in the air, the autopilot takes our references (mode GUIDED); this is a recording: nothing can be flown"
    assert {sample.state_reason for sample in flying} == {told}


def test_a_refusal_is_logged(recording_file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with UAL("replay", url=str(recording_file), backend_settings={**FAST, "speed_factor": 0.001}) as uav:
        for _ in range(3):
            with pytest.raises(NotSupportedError):
                uav.set_velocity(Twist())
    assert [vars(record).get("ual_event") for record in caplog.records].count("refused") == 1


def test_it_is_one_uav(recording_file: Path) -> None:
    flags = ["--backend", "replay", "--url", str(recording_file), "--fleet", "2"]
    result = CliRunner().invoke(main, flags)
    assert result.exit_code == 2
    assert "fleet: a recording plays as one UAV: start a daemon for each" in result.stderr


@pytest.mark.parametrize(
    ("url", "settings", "why"),
    [
        (None, {}, "url: the replay backend needs a recording"),
        ("none.mcap", {}, "url: cannot read .*none.mcap: No such file"),
        ("light.mcap", {"uav": "uav_7"}, "replay.uav: .* has no uav_7, but uav_1"),
        ("light.mcap", {"speed_factor": 0}, "replay.speed_factor"),
    ],
)
def test_what_cannot_be_played_is_refused_at_once(
    recording_file: Path, url: str | None, settings: dict[str, Any], why: str
) -> None:
    where = None if url is None else str(recording_file.parent / url)
    with pytest.raises(ConfigError, match=why):
        UAL("replay", url=where, backend_settings=settings)
