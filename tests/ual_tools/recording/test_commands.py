"""``ual record`` and ``ual plot``: of a running daemon, and of a recording that the daemon made."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from click.testing import CliRunner

import ual
from tests.conftest import DaemonProcess, StartDaemon, daemon_environment
from tests.ports import free_port
from tests.ual_tools.recording.autopilot_logs import Sample, write_ulog
from tests.waiting import until
from ual.errors import UalError
from ual.recording.reader import Recording
from ual.types import State
from ual_tools.main import cli

_SEE = "(see docs/reference/errors.md#invalid_argument)"


def run(*words: str | Path) -> str:
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def recording_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight that the daemon recorded, with a refusal."""
    directory = tmp_path_factory.mktemp("recording_file")
    flags = ("--backend", "light", "--listen", "127.0.0.1:0", "--auto-arm", "--set", "light.speed_factor=10")
    daemon = DaemonProcess((*flags, "--record", str(directory)), "uav_1", daemon_environment(directory / "ual"))
    try:
        with ual.Uav("uav_1", address=daemon.address) as uav:
            uav.wait_for(State.LANDED_ARMED)
            uav.take_off(2.0)
            with pytest.raises(UalError, match="ceiling"):
                uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, 5000.0))
            uav.go_to_waypoint(ual.Pose.at(3.0, 4.0, 2.0))
            uav.land()
        daemon.signal(signal.SIGTERM)
        assert daemon.wait() == 0
    finally:
        daemon.close()
    [path] = directory.glob("*.mcap")
    return path


def test_info_says_what_is_in_a_recording(recording_file: Path) -> None:
    text = run("record", "info", recording_file)
    assert "uav_1: LANDED_DISARMED LANDED_ARMED TAKING_OFF FLYING_AUTO LANDING LANDED_ARMED" in text
    assert "GoToWaypoint GEOFENCE 1, GoToWaypoint OK 1, Land OK 1" in text
    found: dict[str, Any] = json.loads(run("--json", "record", "info", recording_file))
    assert found["is_whole"] is True
    assert found["topics"]["/uav_1/telemetry"]["schema"] == "ual.v1.Telemetry"
    assert found["topics"]["/uav_1/telemetry"]["count"] == len(list(telemetry(recording_file)))


def telemetry(path: Path) -> list[ual.Telemetry]:
    return [message.telemetry() for message in Recording(path).messages(lambda topic: topic.endswith("/telemetry"))]


def test_a_table_has_a_row_for_each_sample(recording_file: Path, tmp_path: Path) -> None:
    run("record", "export", recording_file, "--csv", "--directory", tmp_path)
    samples = telemetry(recording_file)
    with (tmp_path / f"{recording_file.stem}_uav_1.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows] == [sample.state.name for sample in samples]
    pose = samples[-1].pose
    assert pose is not None
    assert float(rows[-1]["x_m"]) == pose.position.x
    assert {row["task"] for row in rows} == {"", "TAKE_OFF", "GO_TO_WAYPOINT", "LAND"}


def test_a_table_as_parquet_has_the_same_columns(recording_file: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra 'parquet' is not installed")
    run("record", "export", recording_file, "--parquet", "--directory", tmp_path)
    table = parquet.read_table(tmp_path / f"{recording_file.stem}_uav_1.parquet")
    assert table.column("state").to_pylist() == [sample.state.name for sample in telemetry(recording_file)]


def test_tracks_lead_over_the_positions_of_the_flight(recording_file: Path, tmp_path: Path) -> None:
    run("record", "export", recording_file, "--kml", "--gpx", "--directory", tmp_path)
    kml = ET.parse(tmp_path / f"{recording_file.stem}.kml")
    gpx = ET.parse(tmp_path / f"{recording_file.stem}.gpx")
    line = kml.findtext(".//{*}LineString/{*}coordinates")
    assert line is not None
    places = [tuple(map(float, place.split(","))) for place in line.split()]
    points = [(float(each.attrib["lon"]), float(each.attrib["lat"])) for each in gpx.iterfind(".//{*}trkpt")]
    assert points == [place[:2] for place in places]
    last = [sample.position_geo for sample in telemetry(recording_file) if sample.position_geo is not None][-1]
    assert points[-1] == pytest.approx((last.longitude_deg, last.latitude_deg), abs=2e-8)


def test_a_flight_is_drawn_on_one_page(recording_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "flight.pdf"
    run("plot", recording_file, "--output", target)
    assert target.read_bytes().startswith(b"%PDF")


def test_the_autopilots_log_is_drawn_next_to_it(recording_file: Path, tmp_path: Path) -> None:
    from ual_tools.recording import page

    [flight] = page.flights(Recording(recording_file).messages())
    begin_s = next(iter(Recording(recording_file).messages())).log_ns * 1e-9
    samples = [
        Sample(time_s + 50.0, y, x, -z, speed)
        for time_s, x, y, z, speed in zip(
            flight.times_s, flight.xs, flight.ys, flight.heights, flight.speeds, strict=True
        )
    ]
    write_ulog(tmp_path / "a.ulg", samples, begin_s - 50.0)
    run("plot", recording_file, "--log", tmp_path / "a.ulg", "--output", tmp_path / "both.svg")
    run("plot", recording_file, "--output", tmp_path / "one.svg")
    assert "the autopilot" in (tmp_path / "both.svg").read_text()
    assert "the autopilot" not in (tmp_path / "one.svg").read_text()
    write_ulog(tmp_path / "a.ulg", samples, begin_s + 3600.0)
    refused = CliRunner().invoke(cli, ["plot", str(recording_file), "--log", str(tmp_path / "a.ulg")])
    assert (refused.exit_code, "of another time" in refused.output) == (1, True)
    refused = CliRunner().invoke(cli, ["plot", str(recording_file), "--log", str(Path(__file__))])
    assert (refused.exit_code, "ends in none of .ulg, .bin" in refused.output) == (2, True)


def test_the_drawing_has_states_tasks_and_refusals(recording_file: Path) -> None:
    from ual_tools.recording import page

    [flight] = page.flights(Recording(recording_file).messages())
    states = [band.label for band in flight.states]
    assert states[:5] == ["LANDED_DISARMED", "LANDED_ARMED", "TAKING_OFF", "FLYING_AUTO", "LANDING"]
    assert [band.label for band in flight.tasks] == ["TAKE_OFF", "GO_TO_WAYPOINT", "LAND"]
    assert [text for _, text in flight.refusals] == ["GoToWaypoint: GEOFENCE"]
    assert max(flight.heights) == pytest.approx(2.0, abs=0.2)


def test_several_uavs_are_drawn_where_they_are_in_map(start_daemon: StartDaemon, tmp_path: Path) -> None:
    from ual_tools.recording import page

    for number, home in ((1, "[0, 0, 0]"), (2, "[30, -40, 2]")):
        start_daemon("--set", f"home_pose={home}", ns=f"uav_{number}").wait_for("state", new="LANDED_DISARMED")
    run("--all", "record", "--directory", tmp_path, "--duration", "0.5")
    [path] = tmp_path.glob("*.mcap")
    one, two = page.flights(Recording(path).messages(), is_in_map=True)
    assert (one.frame_id, two.frame_id) == ("map", "map")
    assert (one.xs[-1], one.ys[-1]) == pytest.approx((0.0, 0.0), abs=0.5)
    assert (two.xs[-1], two.ys[-1], two.heights[-1]) == pytest.approx((30.0, -40.0, 2.0), abs=0.5)
    run("plot", path, "--output", tmp_path / "flight.svg")
    assert "x (m), in map" in (tmp_path / "flight.svg").read_text()


def test_a_client_records_the_telemetry_of_each_uav(start_daemon: StartDaemon, tmp_path: Path) -> None:
    for number in (1, 2):
        start_daemon(ns=f"uav_{number}").wait_for("listening")
    text = run("--all", "record", "--directory", tmp_path, "--duration", "0.5")
    assert "samples of uav_1, uav_2" in text
    [path] = tmp_path.glob("*.mcap")
    recording = Recording(path)
    assert recording.uavs() == ["uav_1", "uav_2"]
    assert recording.is_whole
    assert {m.schema for m in recording.messages()} >= {"ual.v1.GetInfoResponse", "foxglove.PoseInFrame"}


def test_a_client_records_what_a_uav_carries(start_daemon: StartDaemon, tmp_path: Path) -> None:
    daemon = start_daemon("--set", 'payload.grippers=[{"name": "claw"}]', backend="light")
    words = ["--address", daemon.address, "record", "--directory", str(tmp_path)]
    command = [sys.executable, "-c", "from ual_tools.main import main; main()", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith("recording uav_1 into ")
        [path] = tmp_path.glob("*.mcap")
        wanted = {"/uav_1/gimbal_0/tf", "/uav_1/equipment"}
        until(lambda: wanted <= {each.topic for each in Recording(path).messages()}, "both are in the file")
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60.0)
    assert (process.returncode, "samples of uav_1" in output, errors) == (0, True, "")


@pytest.mark.usefixtures("runtime_dir")
def test_a_wrong_use_is_refused(recording_file: Path, tmp_path: Path) -> None:
    for words, status, why in (
        (("record", "export", recording_file), 2, "say as what"),
        (("plot", recording_file, "--output", tmp_path / "flight.gif"), 2, "ends in none of"),
        (("plot", Path(__file__)), 1, "it is no MCAP file"),
        (("record", "--directory", tmp_path, "--address", f"127.0.0.1:{free_port()}"), 1, "no UAL daemon"),
    ):
        result = CliRunner().invoke(cli, [str(word) for word in words])
        assert (result.exit_code, why in result.output) == (status, True), result.output


@pytest.mark.parametrize(
    ("words", "missing", "extra"),
    [
        (("record",), "mcap", "ual-tools[record]"),
        (("record", "info", "FILE"), "mcap", "ual-client[record]"),
        (("record", "export", "--csv", "FILE"), "mcap", "ual-client[record]"),
        (("plot", "FILE"), "mcap", "ual-tools[plot]"),
        (("plot", "FILE"), "matplotlib", "ual-tools[plot]"),
        (("record", "info", "FILE"), "lz4", "ual-client[record]"),
        (("plot", "FILE"), "lz4", "ual-tools[plot]"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], missing: str, extra: str
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == missing]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    file = empty_recording(tmp_path)
    result = CliRunner().invoke(cli, [str(file) if word == "FILE" else word for word in words])
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.startswith("ual: NOT_SUPPORTED: ")
    assert f"needs {missing}" in result.stderr
    assert f"pip install '{extra}'" in result.stderr


def empty_recording(directory: Path) -> Path:
    """A file that has the marks of an MCAP file and nothing else."""
    file = directory / "empty.mcap"
    mark = b"\x89MCAP0\r\n"
    header, data_end, footer = (code + len(body).to_bytes(8, "little") + body for code, body in RECORDS)
    file.write_bytes(mark + header + data_end + footer + mark)
    return file


RECORDS = ((b"\x01", bytes(8)), (b"\x0f", bytes(4)), (b"\x02", bytes(20)))


def test_a_recording_without_messages_is_reported_to_have_none(tmp_path: Path) -> None:
    file = empty_recording(tmp_path)
    assert run("record", "info", file).startswith(f"{file}: no messages, 0.0 MB\n")
    found = json.loads(run("--json", "record", "info", file))
    assert (found["began_s"], found["ended_s"], found["is_whole"]) == (None, None, True)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:8])
    assert run("record", "info", cut).startswith(f"{cut}: no messages, 0.0 MB, without its end")


@pytest.mark.parametrize("words", [("record", "info"), ("record", "export", "--csv", "--kml"), ("plot",)])
@pytest.mark.parametrize(
    ("content", "why"), [(b"", "it is empty"), (b"my-pc\n", "it is no MCAP file"), (b"\x89MCAP", "it is no MCAP file")]
)
def test_what_is_no_recording_is_refused(tmp_path: Path, words: tuple[str, ...], content: bytes, why: str) -> None:
    file = tmp_path / "flight.mcap"
    file.write_bytes(content)
    result = CliRunner().invoke(cli, [*words, str(file)])
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == f"ual: INVALID_ARGUMENT: cannot read {file}: {why} {_SEE}\n"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("words", [("record", "export", "--csv", "--kml"), ("plot",)])
def test_a_recording_without_telemetry_makes_no_files(tmp_path: Path, words: tuple[str, ...]) -> None:
    file = empty_recording(tmp_path)
    result = CliRunner().invoke(cli, [*words, str(file)])
    assert (result.exit_code, result.stderr) == (1, f"ual: INVALID_ARGUMENT: {file} has no telemetry {_SEE}\n")
    assert list(tmp_path.iterdir()) == [file]
