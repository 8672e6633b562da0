"""`ual home` says whether home is saved: it is what the next daemon begins with."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import StartDaemon
from tests.simulators import flying
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import vehicle_of
from tests.waiting import until_state
from ual.types import State
from ual_tools.main import cli


def home(address: str) -> Result:
    result = CliRunner().invoke(cli, ["--address", address, "--json", "home"])
    assert result.exit_code == 0, result.output
    return result


def test_home_is_reported_as_saved_only_where_it_is(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    vehicle = vehicle_of("px4")
    with flying(vehicle.autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        with ual.Uav(address=daemon.address) as uav:
            until_state(uav, State.LANDED_DISARMED)
        saved = home(daemon.address)
        assert (json.loads(saved.stdout)["is_saved"], saved.stderr) == (True, "")
        [file] = runtime_dir.glob("*.home")
        file.unlink()
        file.mkdir()  # no file can take its place
        refused = home(daemon.address)
        assert json.loads(refused.stdout)["is_saved"] is False
        assert "until the daemon ends: daemon: home " in refused.stderr
        file.rmdir()


@pytest.mark.parametrize("flag", [(), ("--set-z",)])
def test_home_of_a_uav_that_is_not_there_is_no_home(flag: tuple[str, ...]) -> None:
    result = CliRunner().invoke(cli, ["--address", "127.0.0.1:1", "home", *flag])
    assert (result.exit_code, result.stdout) == (1, "")
