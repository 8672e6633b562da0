"""Defects of UAL itself do not end the thread that hears the vehicle."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NoReturn, cast
from unittest.mock import Mock

import pytest

from tests.ual_daemon.backends.engine.test_loop import Setup
from tests.ual_daemon.backends.faults.craft import Craft
from tests.ual_daemon.backends.faults.over import over
from ual.errors import UalError
from ual.types import State, Telemetry
from ual_daemon.backends.dji.gimbals import DjiGimbal
from ual_daemon.backends.light.camera import LightCameras
from ual_daemon.backends.mavlink.offers import protocol_access as mavlink_reach
from ual_daemon.backends.mavlink.protocols.cameras import CameraProtocol
from ual_daemon.backends.mavlink.protocols.gimbals import GimbalProtocol
from ual_daemon.backends.mavros.offers.services import Services


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


_BESIDE = (
    (CameraProtocol, "tick"),
    (GimbalProtocol, "tick"),
    (Services, "tick"),
    (DjiGimbal, "tick"),
    (LightCameras, "step"),
)
"""Methods of the backends' threads beside flying."""
_HAVE_MORE = ("px4", "ardupilot", "mavros px4", "mavros ardupilot", "dji psdk", "dji osdk", "light")
"""Backends whose threads do more than fly."""


@pytest.mark.parametrize("craft", _HAVE_MORE, indirect=True)
def test_a_defect_next_to_flying_ends_no_link(
    craft: Craft, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[str] = []

    def fail(self: object, *_: object) -> None:
        called.append(type(self).__name__)
        raise RuntimeError("a defect of the payload")

    for kind, name in _BESIDE:
        monkeypatch.setattr(kind, name, fail)
    monkeypatch.setattr(LightCameras, "is_busy", True)
    craft.fly()
    craft.states.clear()
    craft.run(2.0)
    assert called
    assert {state for _, state in craft.states} <= {State.FLYING_AUTO}
    assert craft.uav.state() is State.FLYING_AUTO
    told = [record for record in caplog.records if record.exc_info and "the payload" in str(record.exc_info)]
    assert len(told) in (1, 2)  # one of each that fails


def test_a_defect_of_what_is_begun_next_to_flying_ends_its_future_only() -> None:
    def fail(*_: object) -> NoReturn:
        raise ZeroDivisionError

    def give(what: str, begin: Callable[[Any, Future[Any]], object]) -> Future[Any]:
        return setup.loop.run_on_loop(what, lambda future, _: begin(Mock(), future))

    setup = Setup()
    mavlink = mavlink_reach.ProtocolAccess(lambda: None, lambda _: cast("Any", ()), Mock(), give)
    failed: list[Future[None]] = [mavlink.run_on_loop("read its logs", fail)]
    mavros = Mock(
        session_in_reach=lambda _: None,
        give_it=lambda what, begin: give(what, lambda _, future: begin(future)),
    )
    services = Services(mavros)
    failed.append(services.give("read its logs", fail))
    setup.round(0.05)
    services.tick(0.0)
    for future in failed:
        with pytest.raises(UalError, match="cannot read its logs: a defect of UAL: ZeroDivisionError"):
            future.result(0)
