"""A flight that a daemon records from the wire, and that comes out of the recording as it was, to the update."""

from __future__ import annotations

import signal
from pathlib import Path

from tests.conftest import StartDaemon
from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.traces import load, replay
from tests.ual_daemon.replay.test_replay import Watched
from ual.recording.reader import Recording
from ual.types import State, Telemetry

FLOWN = {State.FLYING_AUTO, State.FLYING_MANUAL, State.LANDING}
ATTEMPTS = 5


def test_the_states_of_a_replayed_flight_are_those_of_the_flight_to_the_update(
    start_daemon: StartDaemon, tmp_path: Path
) -> None:
    for attempt in range(ATTEMPTS):  # a busy computer may not hear all of the flight
        recording = record(start_daemon, tmp_path / f"recorded_{attempt}")
        recorded = [m.telemetry() for m in Recording(recording).messages(lambda topic: topic.endswith("/telemetry"))]
        replayed = Watched(recording).to_the_end()
        assert [reported(sample) for sample in replayed] == [reported(sample) for sample in recorded]
        assert [sample.pose for sample in replayed] == [sample.pose for sample in recorded]
        if {sample.state for sample in recorded} >= FLOWN:
            return
    raise AssertionError("it has not heard all of the flight")


def reported(sample: Telemetry) -> tuple[object, ...]:
    return sample.state, sample.flight_mode, sample.armed


def record(start_daemon: StartDaemon, directory: Path) -> Path:
    """Records a flight that is sent again, faster than it was, until it is not heard any more."""
    port = free_port()
    url = f"udpin://127.0.0.1:{port}"
    daemon = start_daemon("--url", url, "--record", str(directory), "--record-raw", backend="mavlink")
    daemon.wait_for("state", new="UNINITIALIZED")
    replay(load("px4_offboard_manual_recover"), port, speed_factor=12.0)
    daemon.wait_for("link_changed", new="lost")
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    [path] = directory.glob("*.mcap")
    return path
