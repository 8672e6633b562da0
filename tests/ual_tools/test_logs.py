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

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.simulators import flying
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.errors import InvalidArgumentError, NotSupportedError, ResourceExhaustedError
from ual.logs import Log, LogChunk
from ual.types import State
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


def test_one_download_at_a_time_and_the_next_once_it_was_given_up(daemon: DaemonProcess) -> None:
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
