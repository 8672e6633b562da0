"""Texts of Python for a UAV, a task and a subscription: their names, without a question to the daemon."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess
from ual.errors import UalError
from ual.types import State
from ual_daemon import UAL


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS"):
        monkeypatch.delenv(name, raising=False)


def test_a_client_that_has_not_connected_asks_nobody() -> None:
    with ual.Uav("uav_1") as uav:
        assert repr(uav) == "<ual.Uav uav_1, not connected>"
    assert repr(uav) == "<ual.Uav uav_1, closed>"
    with ual.Uav(address="127.0.0.1:1") as uav:
        assert repr(uav) == "<ual.Uav at 127.0.0.1:1, not connected>"


def test_a_client_says_where_its_uav_is(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as uav:
        assert uav.ns == "uav_1"
        assert repr(uav) == f"<ual.Uav uav_1 at {daemon.address}, connected>"
        assert repr(uav.simulation) == f"<Simulation of uav_1 at {daemon.address}, connected>"
        with uav.subscribe(lambda _: None, rate_hz=10.0) as subscription:
            assert repr(subscription) == "<Subscription to uav_1, 10 Hz>"
        assert repr(subscription) == "<Subscription to uav_1, 10 Hz, closed>"
    assert repr(uav) == f"<ual.Uav uav_1 at {daemon.address}, closed>"


def test_telemetry_counts_as_connected(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav, uav.subscribe(lambda _: None) as subscription:
        assert repr(uav) == f"<ual.Uav uav_1 at {daemon.address}, connected>"
        assert repr(subscription) == "<Subscription to uav_1, every update>"


def test_the_asyncio_client_says_the_same(daemon: DaemonProcess) -> None:
    async def main() -> None:
        async with ual.aio.Uav(address=daemon.address) as uav:
            assert repr(uav) == f"<ual.aio.Uav at {daemon.address}, not connected>"
            with pytest.raises(UalError, match=r"await uav.info\(\)"):
                _ = uav.ns
            await uav.info()
            assert uav.ns == "uav_1"
            assert repr(uav) == f"<ual.aio.Uav uav_1 at {daemon.address}, connected>"
            assert repr(uav.simulation) == f"<Simulation of uav_1 at {daemon.address}, connected>"
            async with uav.subscribe(5.0) as subscription:
                assert repr(subscription) == "<Subscription to uav_1, 5 Hz>"
            assert repr(subscription) == "<Subscription to uav_1, 5 Hz, closed>"
            await uav.wait_for(State.LANDED_ARMED)
            task = await uav.take_off(1.0)
            assert repr(task) == f"<Task {task.id} TAKE_OFF SUCCEEDED>"
        assert repr(uav) == f"<ual.aio.Uav uav_1 at {daemon.address}, closed>"
        async with ual.aio.Uav() as uav:  # the only one of this computer: its name is in the registry
            assert uav.ns == "uav_1"

    asyncio.run(main())


def test_the_class_says_what_it_is() -> None:
    with UAL(backend="light", ns="uav_1") as uav:
        assert repr(uav) == "<ual_daemon.UAL uav_1, open>"
        subscription = uav.subscribe(lambda _: None, 2.0)
        assert repr(subscription) == "<Subscription to uav_1, 2 Hz>"
        uav.simulation.pilot_arm()
        task = uav.take_off(1.0, blocking=False)
        assert repr(task) == f"<Task {task.id} TAKE_OFF RUNNING>"
        task.wait()
    assert repr(uav) == "<ual_daemon.UAL uav_1, closed>"
    assert repr(subscription) == "<Subscription to uav_1, 2 Hz, closed>"


def test_values_say_what_they_are() -> None:
    assert repr(ual.Vector3(1.0, 2.0, 3.0)) == "Vector3(x=1.0, y=2.0, z=3.0)"
    assert repr(ual.Pose.at(1.0, 2.0, 3.0)).startswith("Pose(position=Vector3(x=1.0, y=2.0, z=3.0), orientation=")
    assert repr(ual.Pose.at(1.0, 2.0, 3.0)).endswith("; yaw_rad: kept)")
    assert repr(ual.Pose.at(1.0, 2.0, 3.0, math.pi / 2)).endswith("; yaw_rad: 1.571)")
    assert repr(ual.WrongStateError("land needs FLYING_AUTO")) == "WrongStateError('land needs FLYING_AUTO')"


def test_telemetry_prints_a_row_for_each_thing_that_is_known() -> None:
    sample = ual.Telemetry(State.LANDED_ARMED, armed=True, battery=ual.Battery(50.0))
    lines = repr(sample).splitlines()
    assert lines[0] == "Telemetry("
    assert "  state=<State.LANDED_ARMED: 3>," in lines
    assert "  battery=Battery(remaining_percent=50.0, voltage_v=None, current_a=None, id=0, function='')," in lines
    assert not any("gps" in line or line[-5:] == "None," for line in lines)
