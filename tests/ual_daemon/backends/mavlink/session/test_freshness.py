"""Frequency of stale values although the autopilot is heard: on a link as bad as issue 3 asks for."""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.session.heartbeat_watchdog import HEARTBEAT_LATE_S, HEARTBEAT_REQUEST_S
from ual_daemon.backends.mavlink.session.late_messages import LATE_TIME_SHARE, REQUEST_S

FAILS = 1.0 - (1.0 - 0.3) * (1.0 - 0.1)
"""Share of messages that do not come: 30 % are lost, 10 % of the others damaged."""
JITTER_S = 0.2
PX4_HEARTBEAT_HZ = 1.0  # it cannot be asked for more
PX4_OWN_HZ = {"estimator_s": 1.0, "landed_s": 5.0}
"""Rates of PX4's messages that the state needs before a request for more has arrived."""


def stale_per_hour(rate_hz: float, limit_s: float, *, fails: float = FAILS) -> float:
    """Returns the number of times in an hour that all messages fail that should come within the limit."""
    count = int((limit_s - JITTER_S) * rate_hz)
    return 3600.0 * rate_hz * (1.0 - fails) * fails**count


def rates_hz(dialect: Dialect) -> dict[int, float]:
    return {int(command.request.params[0]): 1e6 / command.request.params[1] for command in dialect.streams(50.0)}


@pytest.mark.parametrize("dialect", [Px4(), ArduCopter()])
def test_nothing_goes_stale_by_chance_on_a_bad_link(dialect: Dialect) -> None:
    rates, limits = rates_hz(dialect), dialect.freshness
    assert stale_per_hour(rates[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED], limits.pose_s) < 1e-3
    assert stale_per_hour(rates[mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE], limits.landed_s) < 1e-3
    assert stale_per_hour(rates[dialect.estimator_message], limits.estimator_s) < 1e-3
    all_hz = sum(rates.values())
    assert stale_per_hour(all_hz, limits.link_s) < 1e-3
    assert limits.link_s < 2.0  # but silence is told soon,
    others_s = (limits.pose_s, limits.mode_s, limits.landed_s, limits.estimator_s)
    assert limits.link_s < min(others_s)  # and as such, before anything that it hides grows old


def test_whether_it_is_armed_does_not_go_stale_by_chance_on_a_bad_link() -> None:
    copter = ArduCopter()
    heartbeats_hz = rates_hz(copter)[mavlink.MAVLINK_MSG_ID_HEARTBEAT]
    assert stale_per_hour(heartbeats_hz, copter.freshness.mode_s) < 1e-3
    # PX4's come once a second, and are asked for, with question and answer at risk, once one is late
    limit_s = Px4().freshness.mode_s
    fails_asked = 1.0 - (1.0 - FAILS) ** 2
    asked_count = int((limit_s - HEARTBEAT_LATE_S - 2 * JITTER_S) / HEARTBEAT_REQUEST_S)
    assert stale_per_hour(PX4_HEARTBEAT_HZ, limit_s) * fails_asked**asked_count < 1e-3


@pytest.mark.parametrize("name", sorted(PX4_OWN_HZ))
def test_what_comes_at_the_own_rate_of_an_autopilot_is_requested_before_it_is_stale(name: str) -> None:
    limit_s = getattr(Px4().freshness, name)
    assert 1.0 / PX4_OWN_HZ[name] < LATE_TIME_SHARE * limit_s  # so that nothing is asked for on a good link
    fails_asked = 1.0 - (1.0 - FAILS) ** 2
    asked_count = int((limit_s * (1.0 - LATE_TIME_SHARE) - 2 * JITTER_S) / REQUEST_S)
    assert stale_per_hour(PX4_OWN_HZ[name], limit_s) * fails_asked**asked_count < 5.0  # and it lasts for seconds
