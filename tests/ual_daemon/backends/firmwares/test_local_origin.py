"""Trust in the origin of the local frame on Earth, and its end when the positions contradict it."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness, ack, heartbeat
from ual.geometry import Vector3
from ual.types import GeoPoint
from ual_daemon.backends.firmwares.local_origin import LocalOrigin
from ual_daemon.geodesy import FlatProjection

ORIGIN = FlatProjection(47.0, 8.0, 400.0)
SPEED = Vector3(10.0, 0.0, 0.0)


def elsewhere(x: float) -> FlatProjection:
    point = ORIGIN.to_geo(Vector3(x, 0.0, 0.0))
    return FlatProjection(point.latitude_deg, point.longitude_deg, 400.0)


def known() -> LocalOrigin:
    origin = LocalOrigin()
    origin.on_origin(ORIGIN)
    return origin


def observe(origin: LocalOrigin, boot_ms: int, local: Vector3, geo: GeoPoint, later_ms: int = 0) -> None:
    origin.on_position(boot_ms, local, SPEED)
    origin.on_geo(boot_ms + later_ms, geo)


def test_positions_that_agree_confirm_it() -> None:
    origin = known()
    for step in range(100):
        local = Vector3(step * 10.0, 5.0, 0.0)
        observe(origin, step * 20, local, ORIGIN.to_geo(local + SPEED * 0.2), later_ms=200)
    assert origin.projection == ORIGIN
    assert not origin.is_wanted


def test_two_contradictions_in_a_row_make_it_doubtful_until_the_new_one_comes() -> None:
    origin, new = known(), elsewhere(20.0)
    local = Vector3(3.0, 0.0, 0.0)
    observe(origin, 0, local, new.to_geo(local))
    assert origin.projection == ORIGIN
    observe(origin, 20, local, new.to_geo(local))
    assert origin.projection is None
    assert origin.is_wanted
    origin.on_origin(FlatProjection(47.0, 8.0, 400.0))  # the old one, repeated
    assert origin.projection is None
    origin.on_origin(new)
    assert origin.projection == new
    observe(origin, 40, local, new.to_geo(local))
    assert origin.projection == new


def test_an_agreement_ends_the_doubt() -> None:
    origin = known()
    for boot_ms in (0, 20, 40):
        observe(origin, boot_ms, Vector3(3.0, 0.0, 0.0), ORIGIN.to_geo(Vector3()))
    assert origin.projection is None
    observe(origin, 60, Vector3(), ORIGIN.to_geo(Vector3()))
    assert origin.projection == ORIGIN


def test_positions_far_apart_in_time_are_not_compared() -> None:
    origin = known()
    for boot_ms in (0, 20, 40):
        observe(origin, boot_ms, Vector3(30.0, 0.0, 0.0), ORIGIN.to_geo(Vector3()), later_ms=400)
    assert origin.projection == ORIGIN


def test_far_away_the_projections_may_differ_a_little() -> None:
    origin, far = known(), Vector3(3000.0, 4000.0, 0.0)
    for boot_ms in (0, 20, 40):
        observe(origin, boot_ms, far, ORIGIN.to_geo(far + Vector3(0.8, 0.0, 0.0)))
    assert origin.projection == ORIGIN


def test_a_doubted_origin_is_requested_at_once_and_not_with_every_message() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(3.0)
    request = mavlink.MAV_CMD_REQUEST_MESSAGE

    def requests() -> int:
        wanted = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        return sum(each.param1 == wanted for each in harness.commands(request))

    for _ in range(20):
        harness.receive(ack(request, mavlink.MAV_RESULT_ACCEPTED))
        harness.run(0.05)
    requests()
    sent_count = 0
    for _ in range(10):
        harness.session.telemetry.origin.is_wanted = True
        harness.receive(heartbeat(), ack(request, mavlink.MAV_RESULT_ACCEPTED))
        harness.run(0.02, 0.02)
        sent_count += requests()
    assert 1 <= sent_count <= 2  # the setup requests it once a second, too
