"""Orders whose answer does not come, or is a refusal: no caller waits longer than the engine, and each is told why."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from time import monotonic

import pytest

from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual.errors import UalError
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(120)]

ENGINE_S = 7.0


@pytest.fixture
def uav_with_trigger(wiretap: Wiretap) -> Iterator[UAL]:
    """A UAV with a camera that the autopilot triggers, though its autopilot has none (TRIG_MODE 0, CAM1_TYPE 0)."""
    with UAL("mavlink", "uav_1", url=wiretap.url, backend_settings={"has_camera_trigger": True}) as uav:
        yield uav


@pytest.mark.parametrize("what", ["stop", "start"])
def test_an_order_to_a_camera_that_is_not_there_ends_with_the_engines_reason(
    uav_with_trigger: UAL, pilot: Transmitter, simulator: Simulator, what: str
) -> None:
    """PX4 does not answer without a trigger. ArduCopter accepts all the same."""
    uav = uav_with_trigger
    Flight(uav, pilot).wait_for(uav.is_ready, "a state")
    camera, began_s = uav.cameras[0], monotonic()
    order = camera.stop_photos if what == "stop" else partial(camera.start_photos, distance_m=5.0)
    answer: AbstractContextManager[pytest.ExceptionInfo[UalError] | None]
    answer = nullcontext() if simulator.autopilot == "ArduPilot" else pytest.raises(UalError, match="has not answered")
    with answer as caught:
        order()
    took_s = monotonic() - began_s
    print(f"{simulator.autopilot} {what}: {took_s:.1f} s: {'' if caught is None else caught.value}")
    assert took_s < ENGINE_S
