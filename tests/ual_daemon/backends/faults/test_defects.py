"""Defects of UAL itself do not end the thread that hears the vehicle."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.faults.craft import Craft
from tests.ual_daemon.backends.faults.over import over
from ual.types import State, Telemetry


@over()
def test_an_update_that_fails_above_ends_no_flight(craft: Craft, caplog: pytest.LogCaptureFixture) -> None:
    craft.fly()
    failures: list[Telemetry] = []

    def fail_once(telemetry: Telemetry) -> None:
        if not failures:
            failures.append(telemetry)
            raise RuntimeError("a defect of the layers above")

    craft.uav.vehicle.subscribe(fail_once)
    begin_s = craft.run(3.0)
    assert failures
    assert craft.uav.state() is State.FLYING_AUTO
    assert craft.commands_since(begin_s) == []
    told = [record for record in caplog.records if record.exc_info and "a defect of the layers" in str(record.exc_info)]
    assert len(told) == 1
