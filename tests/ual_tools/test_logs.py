"""`ual logs`, the clients and the service, with a real daemon and a simulated autopilot."""

from __future__ import annotations

import asyncio
import hashlib
import json
import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.simulators import flying
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.errors import InvalidArgumentError, NotSupportedError, ResourceExhaustedError
from ual.logs import Log, LogChunk
from ual.types import State
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_tools.logs import doubt_of_last
from ual_tools.main import cli

CONTENT = random.Random(7).randbytes(300_000)


@pytest.fixture(params=["px4", "ardupilot"])
def vehicle(request: pytest.FixtureRequest) -> Iterator[Vehicle]:
    vehicle = vehicle_of(request.param)
    files = vehicle.autopilot.files
    files.per_step = 20
    if request.param == "px4":
        files.files = {
            f"{files.directory}/2026-11-25/13_22_11.ulg": CONTENT,
            f"{files.directory}/sess001/log001.ulg": b"old",
        }
    else:
        files.files = {
            f"{files.directory}/00000001.BIN": CONTENT,  # after the number 500 it began again
            f"{files.directory}/00000500.BIN": b"old",
            f"{files.directory}/LASTLOG.TXT": b"1\n",
        }
    with flying(vehicle.autopilot):
        yield vehicle


@pytest.fixture
def daemon(vehicle: Vehicle, start_daemon: StartDaemon) -> DaemonProcess:
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_DISARMED)
        until(lambda: uav.info().autopilot_version != "", "its version")
    return daemon


def test_a_directory_that_is_not_listed_does_not_hide_the_other_logs(start_daemon: StartDaemon) -> None:
    vehicle = vehicle_of("px4")
    files = vehicle.autopilot.files
    files.files = {f"{files.directory}/2026-11-2{day}/13_22_11.ulg": CONTENT[: 100 * day] for day in range(3, 6)}
    files.unlisted.add(f"{files.directory}/2026-11-24")
    with flying(vehicle.autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        with ual.Uav(address=daemon.address) as uav:
            until(lambda: uav.info().autopilot_version != "", "its version")
            found = uav.logs.get_all()
            assert [each.id for each in found if not each.is_missing] == [
                "2026-11-23/13_22_11.ulg",
                "2026-11-25/13_22_11.ulg",
            ]
            assert [each.id for each in found if each.is_missing] == ["2026-11-24/"]
        assert run(daemon, "logs", "fetch", "--last").exit_code == 1
        assert "2026-11-24/" in run(daemon, "logs", "list").stdout


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_log_that_is_never_described_does_not_hide_the_others(
    start_daemon: StartDaemon, tmp_path: Path, kind: str
) -> None:
    vehicle = vehicle_of(kind)
    autopilot, files = vehicle.autopilot, vehicle.autopilot.files
    version = autopilot._autopilot_version

    def without_files() -> Message:
        message = version()
        message.capabilities &= ~mavlink.MAV_PROTOCOL_CAPABILITY_FTP
        return message

    autopilot.builders[mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION] = without_files
    files.files = {f"{files.directory}/0000000{number}.BIN": CONTENT[: 100 * number] for number in range(1, 5)}
    first = 0 if kind == "px4" else 1
    files.undescribed.add(first + 2)
    with flying(autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        with ual.Uav(address=daemon.address) as uav:
            until(lambda: uav.info().autopilot_version != "", "its version")
            found = uav.logs.get_all()
        assert [(each.id, each.size_bytes) for each in found if not each.is_missing] == [
            (str(first), 100),
            (str(first + 1), 200),
            (str(first + 3), 400),
        ]
        assert [each.id for each in found if each.is_missing] == [str(first + 2)]
        file = tmp_path / "flight.bin"
        assert run(daemon, "logs", "fetch", str(first + 3), "-o", file).exit_code == 0
        assert file.read_bytes() == CONTENT[:400]
        refused = run(daemon, "logs", "fetch", "--last", "-o", tmp_path / "last.bin")
        assert (refused.exit_code, "which is the newest" in refused.output) == (1, True)


NOT_SAID = "the autopilot does not say when its logs were written: 2 is taken for the newest"


@pytest.mark.parametrize(
    ("logs", "doubt"),
    [
        ([Log("1", 9, 10.0), Log("2", 9, 20.0)], ""),
        ([Log("1", 9)], ""),
        (
            [Log("1", 9), Log("2", 9)],
            "the autopilot does not say when its logs were written: 2 is taken for the newest",
        ),
        ([Log("1", 9), Log("2", 9, 20.0)], "2 is the newest that has a time; when these were written is not known: 1"),
    ],
)
def test_the_last_log_is_doubted_where_times_are_missing(logs: list[Log], doubt: str) -> None:
    assert doubt_of_last(logs[-1], logs) == doubt


def run(daemon: DaemonProcess, *words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *map(str, words)])


def test_the_newest_log_is_listed_and_fetched(daemon: DaemonProcess, tmp_path: Path) -> None:
    listed = [json.loads(line) for line in run(daemon, "--json", "logs", "list").stdout.splitlines()]
    assert [each["size_bytes"] for each in listed] == [3, len(CONTENT)]
    file = tmp_path / "flight.log"
    fetched = run(daemon, "--json", "logs", "fetch", "--last", "-o", file)
    assert fetched.exit_code == 0, fetched.output
    assert json.loads(fetched.stdout)["sha256"] == hashlib.sha256(CONTENT).hexdigest()
    assert file.read_bytes() == CONTENT
    assert list(tmp_path.glob("flight*")) == [file]
    assert "0.30" in run(daemon, "logs", "list").stdout


def test_a_download_that_was_cut_off_goes_on(daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path) -> None:
    file = tmp_path / "flight.log"
    with ual.Uav(address=daemon.address) as uav:
        log = uav.logs.get_all()[-1]
        with ual.logs.PartialFile(file, log) as part:
            for chunk in uav.logs.download(log.id):
                part.add(chunk)
                if part.size > 100_000:
                    break
    assert 100_000 < (tmp_path / "flight.log.part").stat().st_size < len(CONTENT)
    requests_count = len(vehicle.autopilot.files.requests)
    until(lambda: _fetched(daemon, log.id, file), "the end of the first download")
    assert file.read_bytes() == CONTENT
    again = [each.offset for each in vehicle.autopilot.files.requests[requests_count:] if each.opcode in (5, 15)]
    assert min(filter(None, again)) > 90_000  # at 0 is the number of the newest log


def _fetched(daemon: DaemonProcess, log_id: str, file: Path) -> bool:
    return run(daemon, "logs", "fetch", log_id, "-o", file).exit_code == 0


def test_both_clients_have_the_same_pieces_and_errors(daemon: DaemonProcess) -> None:
    async def ask() -> tuple[list[Log], list[LogChunk]]:
        async with ual.aio.Uav(address=daemon.address) as uav:
            listed = await uav.logs.get_all()
            return listed, [each async for each in uav.logs.download(listed[-1].id, 250_000)]

    listed, chunks = asyncio.run(ask())
    assert b"".join(each.data for each in chunks) == CONTENT[250_000:]
    assert [each.sha256 for each in chunks if each.sha256] == [hashlib.sha256(CONTENT[250_000:]).hexdigest()]
    with ual.Uav(address=daemon.address) as uav:
        assert uav.logs.get_all() == listed
        for log_id, offset in (("nothing", 0), (listed[-1].id, len(CONTENT) + 1), ("", 0)):
            with pytest.raises(InvalidArgumentError):
                list(uav.logs.download(log_id, offset))
        with pytest.raises(InvalidArgumentError, match="offset"):
            list(uav.logs.download(listed[-1].id, -1))
        [last] = uav.logs.download(listed[-1].id, len(CONTENT))
        assert (last.data, last.sha256) == (b"", hashlib.sha256(b"").hexdigest())


def test_one_download_at_a_time_and_the_next_once_it_was_abandoned(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as uav:
        log = uav.logs.get_all()[-1]
        first = uav.logs.download(log.id)
        next(first)
        with pytest.raises(ResourceExhaustedError, match="one at a time"):
            next(uav.logs.download(log.id))
        first.close()  # type: ignore[attr-defined]  # a generator

        def whole() -> bool:
            try:
                return b"".join(each.data for each in uav.logs.download(log.id)) == CONTENT
            except ResourceExhaustedError:
                return False

        until(whole, "a whole download")


def test_a_backend_without_logs_says_so(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    with ual.Uav(address=daemon.address) as uav:
        with pytest.raises(NotSupportedError, match="logs"):
            uav.logs.get_all()
        with pytest.raises(NotSupportedError):
            list(uav.logs.download("1"))
    assert run(daemon, "logs", "fetch").exit_code == 2
