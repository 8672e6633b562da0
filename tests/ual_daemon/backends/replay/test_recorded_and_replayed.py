"""A flight that a daemon records from the wire, and that comes out of the recording as it was, to the update."""

from __future__ import annotations

import signal
import socket
from pathlib import Path

from tests.conftest import StartDaemon
from tests.ual_daemon.backends.mavlink.traces import load, replay
from tests.ual_daemon.backends.replay.test_replay import Watched
from ual._recording.reader import Recording
from ual.types import State


def test_the_states_of_a_replayed_flight_are_those_of_the_flight_to_the_update(
    start_daemon: StartDaemon, tmp_path: Path
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    directory = tmp_path / "recorded"
    url = f"udpin://127.0.0.1:{port}"
    daemon = start_daemon("--url", url, "--record", str(directory), "--record-raw", backend="mavlink")
    daemon.wait_for("state", new="UNINITIALIZED")
    replay(load("px4_offboard_manual_recover"), port, speed_factor=12.0)
    daemon.wait_for("state", old="LANDED_ARMED", new="LANDED_DISARMED")
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    [path] = directory.glob("*.mcap")
    recorded = [m.telemetry() for m in Recording(path).messages(lambda topic: topic.endswith("/telemetry"))]
    replayed = Watched(path).to_the_end()
    states = [(sample.state, sample.flight_mode, sample.armed) for sample in recorded]
    assert [(sample.state, sample.flight_mode, sample.armed) for sample in replayed] == states
    assert {state for state, _, _ in states} >= {State.FLYING_AUTO, State.FLYING_MANUAL, State.LANDING}
    poses = [sample.pose for sample in recorded]
    assert [sample.pose for sample in replayed] == poses
