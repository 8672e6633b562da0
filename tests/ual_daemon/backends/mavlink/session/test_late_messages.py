"""Messages that the state needs, and that a bad link keeps away."""

from __future__ import annotations

from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.mavlink.session.late_messages import LATE_TIME_SHARE, REQUEST_S, LateMessages
from ual_daemon.backends.values import NEVER_S, Sample

LIMIT_S = 3.0
LATE_S = LATE_TIME_SHARE * LIMIT_S


def test_a_message_is_requested_once_it_is_late_and_until_it_comes() -> None:
    estimator: Reading[bool] = Readings().add(Valid.WHILE_HEARD)
    late = LateMessages({230: (estimator, LIMIT_S)})
    estimator.set(True, 10.0)
    assert late.due(10.0 + LATE_S - 0.01, 11.0) == []
    now_s = 10.0 + LATE_S + 0.01
    assert late.due(now_s, now_s) == [230]
    assert late.due(now_s + 0.5 * REQUEST_S, now_s) == []
    assert late.due(now_s + REQUEST_S, now_s) == [230]
    estimator.set(True, now_s + REQUEST_S)
    assert late.due(now_s + 2.0 * REQUEST_S, now_s) == []


def test_nothing_is_requested_that_never_came_nor_while_nothing_comes() -> None:
    never: Reading[bool] = Readings().add(Valid.WHILE_HEARD)
    landed = Readings().add(Valid.WHILE_HEARD, unknown=Sample(0, NEVER_S))
    late = LateMessages({230: (never, LIMIT_S), 245: (landed, LIMIT_S)})
    assert late.due(10.0, 10.0) == []
    never.set(True, 10.0)
    assert late.due(10.0 + LIMIT_S, None) == []
    assert late.due(10.0 + LIMIT_S, 11.0) == []
