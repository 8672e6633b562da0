"""`ual param`, the clients and the service, with a real daemon and a simulated PX4: the roles, and the results."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.simulators import Faults, flying
from tests.simulators.mission_store import Sender
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.errors import (
    InvalidArgumentError,
    LeaseHeldError,
    NotSupportedError,
    PermissionDeniedError,
    RejectedByAutopilotError,
    UalError,
    WrongStateError,
)
from ual.parameters import Parameter, ParameterType
from ual.types import State
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_tools.main import cli

NAME = "MPC_LAND_SPEED"


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    vehicle = vehicle_of("px4")
    with flying(vehicle.autopilot):
        yield vehicle


@pytest.fixture
def daemon(vehicle: Vehicle, start_daemon: StartDaemon) -> DaemonProcess:
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_DISARMED)
    return daemon


def run(daemon: DaemonProcess, *words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *map(str, words)])


def done(daemon: DaemonProcess, *words: str | Path) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_reads_writes_saves_and_compares(daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path) -> None:
    assert done(daemon, "param", "get", NAME.lower()) == "0.7\n"
    file = tmp_path / "before.params"
    count = len(vehicle.autopilot.parameters)
    assert done(daemon, "param", "save", file) == f"{count} parameters saved in {file}\n"
    assert f"all {count} parameters" in done(daemon, "param", "compare", file)
    assert done(daemon, "param", "set", NAME, "0.9") == f"{NAME} is 0.9\n"
    compared = run(daemon, "param", "compare", file)
    assert (compared.exit_code, compared.stdout) == (1, f"{NAME}\t0.7\t0.9\n")
    listed = [json.loads(line) for line in done(daemon, "--json", "param", "list", "mpc_land*").splitlines()]
    assert [(each["name"], each["type"], each["is_relied_on"]) for each in listed] == [(NAME, "REAL32", False)]
    refused = run(daemon, "param", "list", "NOTHING*")
    assert (refused.exit_code, "matches NOTHING*" in refused.output) == (1, True)


def test_both_clients_have_the_same_values_and_errors(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    async def ask() -> tuple[Parameter, list[Parameter]]:
        async with ual.aio.Uav(address=daemon.address) as uav:
            with pytest.raises(InvalidArgumentError, match="is out of range"):
                await uav.parameters.set("EKF2_EV_CTRL", 1e10)
            return await uav.parameters.set("EKF2_EV_CTRL", 5), await uav.parameters.get_all()

    written, listed = asyncio.run(ask())
    assert (written.value, written.type, written.maximum) == (5, ParameterType.INT32, 15.0)
    assert written.needs_reboot
    with ual.Uav(address=daemon.address) as uav:
        assert uav.parameters.get_all() == listed
        assert written in listed
        vehicle.autopilot.kept_parameters.add(NAME)
        with pytest.raises(RejectedByAutopilotError) as refused:
            uav.parameters.set(NAME, 1.5)
        assert refused.value.metadata["kept"] == "0.7"


def test_a_lease_and_a_flight_keep_others_from_writing(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    with ual.Uav(address=daemon.address) as holder, ual.Uav(address=daemon.address) as other:
        with holder.lease("holder"):
            with pytest.raises(LeaseHeldError):
                other.parameters.set(NAME, 0.8)
            assert other.parameters.get(NAME).text == "0.7"
            assert holder.parameters.set(NAME, 0.8).text == "0.8"
        assert vehicle.autopilot.pilot_arm()
        until_state(other, State.LANDED_ARMED)
        with pytest.raises(WrongStateError, match="the UAV is armed"):
            other.parameters.set(NAME, 0.9)
        with pytest.raises(WrongStateError, match="a flight relies on MPC_XY_CRUISE"):
            other.parameters.set("MPC_XY_CRUISE", 1.0, force=True)
        assert other.parameters.set(NAME, 0.9, force=True).text == "0.9"


def test_a_daemon_that_only_watches_reads_and_does_not_write(vehicle: Vehicle, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", vehicle.url, "--watch-only", backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_DISARMED)
        assert uav.parameters.get(NAME).text == "0.7"
        with pytest.raises(PermissionDeniedError):
            uav.parameters.set(NAME, 0.8)


def test_a_backend_without_them_says_so(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    with ual.Uav(address=daemon.address) as uav, pytest.raises(NotSupportedError, match="does not offer them"):
        uav.parameters.get_all()
    assert run(daemon, "param", "list").exit_code == 1


def test_a_file_is_loaded_as_far_as_it_differs_and_what_needs_a_boot_comes_last(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    before = vehicle.autopilot.parameters
    file = tmp_path / "mine.param"
    wanted = {"EKF2_EV_CTRL": 5.0, NAME: 0.9, "MPC_XY_CRUISE": 4.0, "COM_OF_LOSS_T": before["COM_OF_LOSS_T"]}
    file.write_text("".join(f"{name},{value:g}\n" for name, value in wanted.items()))
    boot = "; these take effect at the next boot of the autopilot: EKF2_EV_CTRL"
    lines = done(daemon, "param", "load", file).splitlines()
    assert lines == [
        f"{NAME}: 0.7 -> 0.9",
        "MPC_XY_CRUISE: 5 -> 4",  # a flight relies on it
        "EKF2_EV_CTRL: 0 -> 5",
        f"3 of 3 parameters that differed were written{boot}",
    ]
    assert {name: before[name] for name in wanted} == pytest.approx(wanted)
    assert done(daemon, "param", "load", file) == "0 of 0 parameters that differed were written\n"


def test_what_other_components_have_is_not_written_and_is_counted_and_named(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = tmp_path / "two.params"
    file.write_text(f"1\t1\t{NAME}\t0.9\t9\n1\t154\tCAL_ID\t7\t6\n1\t154\tMPC_XY_CRUISE\t3\t9\n")
    compared = run(daemon, "param", "compare", file)
    assert (compared.exit_code, compared.stdout) == (1, f"{NAME}\t0.9\t0.7\n")
    left_out = "left out: 2 lines of component 154 (CAL_ID, MPC_XY_CRUISE)"
    assert compared.stderr.startswith(f"{left_out}\n")
    loaded = json.loads(done(daemon, "--json", "param", "load", file).splitlines()[-1])
    assert loaded["written"] == loaded["differed"] == 1
    assert loaded["left_out"] == [{"component": 154, "count": 2, "names": ["CAL_ID", "MPC_XY_CRUISE"]}]
    assert vehicle.autopilot.parameters["MPC_XY_CRUISE"] == 5.0
    assert done(daemon, "param", "load", file) == f"0 of 0 parameters that differed were written; {left_out}\n"


def test_a_row_of_which_a_part_would_be_ignored_is_refused_and_nothing_is_written(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = tmp_path / "comma.param"
    file.write_text(f"MPC_XY_CRUISE,4\n{NAME},0,95\n")
    loaded = run(daemon, "param", "load", file)
    assert loaded.exit_code == 1
    assert f"{file}, line 2: " in loaded.output
    assert f"'{NAME},0,95'" in loaded.output
    assert vehicle.autopilot.parameters["MPC_XY_CRUISE"] == 5.0


def is_read(uav: ual.Uav, name: str) -> bool:
    try:
        return bool(uav.parameters.get(name).value)
    except UalError:
        return False


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_the_system_id_is_written_last_and_the_autopilot_is_followed(
    start_daemon: StartDaemon, tmp_path: Path, kind: str
) -> None:
    vehicle, file = vehicle_of(kind), tmp_path / "mine.param"
    autopilot = vehicle.autopilot
    id_name, other = ("SYSID_THISMAV", "WPNAV_SPEED") if kind == "ardupilot" else ("MAV_SYS_ID", "MPC_XY_CRUISE")
    autopilot.parameters[id_name] = 1
    file.write_text(f"{id_name},7\n{other},{4 if kind == 'px4' else 400}\n")
    with flying(autopilot):
        daemon = start_daemon("--url", vehicle.url, backend="mavlink")
        with ual.Uav(address=daemon.address) as uav:
            until_state(uav, State.LANDED_DISARMED)
            lines = done(daemon, "param", "load", file).splitlines()
            assert [each.split(":")[0] for each in lines[:2]] == [other, id_name]
            assert lines[2].startswith("2 of 2 parameters that differed were written")
            if kind == "px4":  # it becomes another system at its next boot
                autopilot.reboot()
            until(lambda: autopilot.system_id == 7, "its new id")
            until(lambda: is_read(uav, id_name), "it is followed", seen=uav.telemetry)
            until_state(uav, State.LANDED_DISARMED)
            assert uav.parameters.set(other, 3).value == 3


def test_one_that_never_comes_does_not_keep_a_file_from_being_loaded(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = tmp_path / "mine.param"
    file.write_text(f"{NAME},0.9\nMPC_XY_CRUISE,4\n")
    vehicle.autopilot.withheld_parameters.add("EKF2_EV_CTRL")
    loaded = run(daemon, "param", "load", file)
    assert loaded.exit_code == 0, loaded.output
    assert "1 of its" in loaded.output
    assert "2 of 2 parameters that differed were written" in loaded.output
    assert run(daemon, "param", "compare", file).exit_code == 0


def test_where_the_link_is_lost_all_that_was_not_written_is_named(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = tmp_path / "mine.param"
    file.write_text(f"{NAME},0.9\nMPC_XY_CRUISE,4\nEKF2_EV_CTRL,5\n")
    autopilot, written = vehicle.autopilot, vehicle.autopilot._on_param_set

    def write_one(message: Message, sender: Sender) -> None:
        if message.param_id == NAME:
            written(message, sender)
        else:
            vehicle.link.up = vehicle.link.down = Faults(is_silent=True)

    autopilot._handlers[mavlink.MAVLINK_MSG_ID_PARAM_SET] = write_one
    loaded = run(daemon, "param", "load", file)
    assert loaded.exit_code == 1
    assert "these were not written: " in loaded.output
    assert "MPC_XY_CRUISE, EKF2_EV_CTRL" in loaded.output


def test_what_cannot_be_loaded_is_reported_and_the_rest_is_written(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = tmp_path / "mine.param"
    file.write_text(f"EKF2_EV_CTRL,1e10\nNOT_THERE,1\nMPC_XY_CRUISE,4\n{NAME},0.9\n")
    vehicle.autopilot.kept_parameters.add("MPC_XY_CRUISE")
    loaded = run(daemon, "param", "load", file)
    assert loaded.exit_code == 1
    assert f"{NAME}: 0.7 -> 0.9" in loaded.output
    assert "NOT_THERE: the UAV has no parameter of this name" in loaded.output
    assert "MPC_XY_CRUISE: MPC_XY_CRUISE was not written: the autopilot keeps 5, not 4" in loaded.output
    assert "EKF2_EV_CTRL: value: " in loaded.output
    assert "1 of 4 parameters that differed were written" in loaded.output
