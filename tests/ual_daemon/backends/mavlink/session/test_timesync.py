import pytest

from ual_daemon.backends.mavlink.session.timesync import Timesync


def test_the_round_trip_is_measured_once_a_second_by_answers_to_our_requests_only() -> None:
    timesync = Timesync()
    requested_ns = timesync.request_ns(5.0)
    assert requested_ns == 5_000_000_000
    assert timesync.request_ns(5.9) is None
    timesync.on_answer(requested_ns + 1, 5.1)
    assert timesync.round_trip_s is None
    timesync.on_answer(requested_ns, 5.25)
    assert timesync.round_trip_s == pytest.approx(0.25)
    timesync.on_answer(requested_ns, 5.9)  # a copy that took another way
    assert timesync.round_trip_s == pytest.approx(0.25)
    requested_ns = timesync.request_ns(6.0)
    assert requested_ns is not None
    assert timesync.request_ns(20.0) is not None
    timesync.on_answer(requested_ns, 20.1)  # nobody waits for it any more
    assert timesync.round_trip_s == pytest.approx(0.25)
