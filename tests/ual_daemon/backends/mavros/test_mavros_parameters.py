"""Requests to MAVROS' copy of the parameters, by the names of each version."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from tests.simulators.ardupilot import RENAMED, RENAMED_IN_4_7_0
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.gimbal_codec import ArduPilotGimbal
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter as Copter
from ual_daemon.backends.mavros.parameters import LONGEST_ROUND_S, REQUEST_PERIOD_S, ParameterReader
from ual_daemon.backends.rosbridge import Message, RosGeneration

OLD = {"WPNAV_SPEED": 1000.0, "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0, "WPNAV_ACCEL": 250.0,
       "WPNAV_ACCEL_Z": 100.0, "ATC_SLEW_YAW": 6000.0, "PSC_JERK_XY": 5.0, "PSC_JERK_Z": 5.0}  # fmt: skip
OTHERS = dict.fromkeys((name for name in ArduCopter.parameters if name.startswith("FENCE_")), 0.0)


class Bench:
    """A MAVROS of ROS 1 with these parameters."""

    def __init__(self, known: Mapping[str, float]) -> None:
        self.known = known
        self.read: dict[str, float] = {}
        self.asked: list[str] = []
        self.unanswered: set[str] = set()
        self.reader = ParameterReader(Copter(), self.read, Plausibility(), lambda: None)

    def _call(self, _: str, arguments: Message, take: Callable[[Message], None], __: float) -> None:
        name = str(arguments["param_id"])
        self.asked.append(name)
        if name in self.unanswered:
            return
        value = {"integer": 0, "real": self.known.get(name, 0.0)}
        take({"success": name in self.known, "value": value})

    def tick(self, now_s: float) -> None:
        for _ in range(100):
            self.reader.tick(now_s, RosGeneration.ROS1, self._call)


@pytest.mark.parametrize(
    "known",
    [
        OLD,
        {new: OLD[old] / per_unit for old, (new, per_unit) in RENAMED.items()},
        {new: OLD[old] / per_unit for old, (new, per_unit) in RENAMED_IN_4_7_0.items()},
    ],
)
def test_the_limits_of_each_version_are_read(known: dict[str, float]) -> None:
    bench = Bench({**known, **OTHERS})
    bench.tick(0.0)
    assert bench.read.items() >= known.items()
    assert bench.reader.missing == ()
    assert Copter().limits(bench.read).horizontal_speed_m_s == 10.0


def test_a_mavros_that_has_fetched_none_is_not_requested_each() -> None:
    """It logs an error for each."""
    bench = Bench({})
    bench.tick(0.0)
    assert bench.asked == ["WP_SPD", "WPNAV_SPEED"]
    bench.known = {**OLD, **OTHERS}
    bench.tick(LONGEST_ROUND_S)
    assert bench.reader.missing == ()


def test_what_is_next_to_flying_is_requested_once_and_again_after_a_boot() -> None:
    """MAVROS logs an error for each that the autopilot does not have."""
    bench = Bench({**OLD, **OTHERS, "MNT1_TYPE": 1.0})
    bench.reader = ParameterReader(
        Copter(), bench.read, Plausibility(), lambda: None, lambda: ArduPilotGimbal().parameters(bench.read)
    )
    bench.tick(0.0)
    wanted = ArduPilotGimbal().parameters({"MNT1_TYPE": 1.0})
    assert [name for name in bench.asked if name.startswith("MNT")] == list(wanted)
    bench.tick(LONGEST_ROUND_S)
    assert [name for name in bench.asked if name in wanted[1:]] == list(wanted[1:])
    bench.read.clear()
    bench.asked.clear()
    bench.tick(2.0 * LONGEST_ROUND_S)
    assert [name for name in bench.asked if name.startswith("MNT")] == list(wanted)


def test_what_is_next_to_flying_is_requested_again_where_the_answer_was_lost() -> None:
    bench = Bench({**OLD, **OTHERS, "MNT1_TYPE": 1.0})
    bench.reader = ParameterReader(Copter(), bench.read, Plausibility(), lambda: None, lambda: ("MNT1_TYPE",))
    bench.unanswered = {"MNT1_TYPE"}
    bench.tick(0.0)
    bench.tick(REQUEST_PERIOD_S / 2.0)
    assert bench.asked.count("MNT1_TYPE") == 1
    bench.unanswered.clear()
    bench.tick(REQUEST_PERIOD_S + 1.0)
    assert bench.read["MNT1_TYPE"] == 1.0
