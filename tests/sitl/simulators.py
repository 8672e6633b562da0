"""Real autopilots that can be flown, and their expected behaviour in their simulators."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from tests.sitl.copter_pilot import GUIDED, CopterPilot
from tests.sitl.pilot import OFFBOARD, SafetyPilot
from tests.sitl.transmitter import Transmitter

Address = tuple[str, int]


@dataclass(frozen=True)
class Simulator:
    """An autopilot in its simulator.

    `wanders_m` is how far off its own estimate it may hover, `estimate_m_s` how wrong its velocity may be. `own_hold`
    is the mode in which it holds its position by itself, `pilots_mode` the one in which its safety pilot flies.
    `references_mode` is the (custom) mode in which it takes our references, and `references_name` its name.
    `disarm_refusal` is how it refuses to be disarmed in the air.
    """

    autopilot: str
    url_variable: str
    url_example: str
    pilot_variable: str
    pilot_example: str
    make_pilot: Callable[[str, int], Transmitter]
    pilots_mode: str
    own_hold: str
    references_mode: int
    references_name: str
    disarm_refusal: str
    wanders_m: float
    estimate_m_s: float

    def url(self) -> str:
        """Returns the address of its link for the companion computer; skips the test if there is none."""
        return _variable(self.url_variable, f"no {self.autopilot}", self.url_example)

    def pilot_url(self) -> str:
        """Returns the address of its safety pilot's link; skips the test if there is none."""
        return _variable(self.pilot_variable, f"no safety pilot of a {self.autopilot}", self.pilot_example)


def _variable(name: str, missing: str, example: str) -> str:
    value = os.environ.get(name)
    if not value:
        pytest.skip(f"{missing}: set {name}={example}")
    return value


# PX4's sensors wander in its simulator, and its velocity is wrong after an acceleration, by the simulator's truth.
PX4 = Simulator(
    autopilot="PX4",
    url_variable="UAL_TEST_PX4_URL",
    url_example="udpin://127.0.0.1:14540",
    pilot_variable="UAL_TEST_PX4_PILOT",
    pilot_example="udp://127.0.0.1:18570",
    make_pilot=SafetyPilot,
    pilots_mode="POSCTL",
    own_hold="AUTO.LOITER",
    references_mode=OFFBOARD,
    references_name="OFFBOARD",
    disarm_refusal="TEMPORARILY_REJECTED",
    wanders_m=1.0,
    estimate_m_s=0.4,
)
ARDUPILOT = Simulator(
    autopilot="ArduPilot",
    url_variable="UAL_TEST_ARDUPILOT_URL",
    url_example="tcp://127.0.0.1:5760",
    pilot_variable="UAL_TEST_ARDUPILOT_PILOT",
    pilot_example="tcp://127.0.0.1:5762",
    make_pilot=CopterPilot,
    pilots_mode="LOITER",
    own_hold="BRAKE",
    references_mode=GUIDED,
    references_name="GUIDED",
    disarm_refusal="FAILED",
    wanders_m=0.4,
    estimate_m_s=0.1,
)
