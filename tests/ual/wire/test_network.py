"""Reports as bytes: they come back as they were, and whatever is none is refused."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual.network.samples import report, telemetry, uav
from ual.network.values import UavReport
from ual.shared.text import printable
from ual.types import Health, Telemetry
from ual.v1 import network_pb2 as pb
from ual.wire import network as wire
from ual.wire.network import report_from_bytes, report_to_bytes


def test_a_report_comes_back_as_it_was() -> None:
    sent = report(uav("uav_1"), uav("uav_2", "unix:/run/uav_2.sock"), host="field-1", started_s=1.5, count=4)
    came = report_from_bytes(report_to_bytes(sent))
    assert came.teller == sent.teller
    for one, other in zip(sent.uavs, came.uavs, strict=True):
        assert (one.ns, one.addresses, one.backend, one.needed_role) == (
            other.ns,
            other.addresses,
            other.backend,
            other.needed_role,
        )
        assert repr(one.telemetry) == repr(other.telemetry)


def test_a_uav_takes_about_300_bytes() -> None:
    both = len(report_to_bytes(report(uav("uav_1"), uav("uav_2")))) - len(report_to_bytes(report(uav("uav_1"))))
    assert 100 < both < 300


def test_what_is_reported_is_the_small_part() -> None:
    whole = Telemetry(
        **{**{name: getattr(telemetry(), name) for name in ("state", "transform", "battery")}, "gps": None}
    )
    assert wire.small(whole).transform == whole.transform
    assert wire.small(whole).pose is None


@pytest.mark.parametrize("ns", ["", "a/b", "uav 1", "x" * 65, "uav_1\n"])
def test_a_name_that_is_none_is_refused(ns: str) -> None:
    with pytest.raises(ValueError, match="it tells of a UAV of the name"):
        report_from_bytes(report_to_bytes(report(uav(ns))))


@pytest.mark.parametrize("address", ["", "evil", "10.0.0.1:1 more", "10.0.0.1", "-oProxy:1x", "a:123456"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="an address that is none"):
        report_from_bytes(report_to_bytes(report(uav(address=address))))


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf, 1e9])
def test_a_rate_that_is_none_is_refused(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="it tells of a rate of"):
        report_from_bytes(report_to_bytes(report(rate_hz=rate_hz)))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_no_number_is_refused(value: float) -> None:
    message = pb.NetworkReport.FromString(report_to_bytes(report()))
    message.uavs[0].telemetry.transform.translation.y = value
    with pytest.raises(ValueError, match="it tells of numbers that are none"):
        report_from_bytes(message.SerializeToString())


def test_texts_cannot_act_on_a_terminal() -> None:
    evil = "\x1b]0;owned\x07\x1b[31mred"
    told = Telemetry(
        state=telemetry().state,
        state_reason=evil,
        flight_mode=evil,
        health=Health(failing_checks=(evil,), failsafe=evil),
    )
    [came] = report_from_bytes(report_to_bytes(report(UavReport("uav_1", told, evil), host=evil))).uavs
    health = came.telemetry.health
    assert health is not None
    for text in (
        came.telemetry.state_reason,
        came.telemetry.flight_mode,
        came.backend,
        *health.failing_checks,
        health.failsafe,
    ):
        assert text == "?]0;owned??[31mred"


def test_a_text_is_cut_to_what_fits_a_table() -> None:
    assert printable("x" * 501) == "x" * 500


@given(st.binary(max_size=400))
def test_any_bytes_are_a_report_or_are_refused(data: bytes) -> None:
    try:
        came = report_from_bytes(data)
    except ValueError:
        return
    assert all(wire._NAMESPACE.fullmatch(each.ns) for each in came.uavs)


@given(st.data())
def test_a_report_with_changed_bytes_is_a_report_or_is_refused(data: st.DataObject) -> None:
    sent = bytearray(report_to_bytes(report(uav("uav_1"), uav("uav_2"))))
    for _ in range(data.draw(st.integers(1, 5))):
        sent[data.draw(st.integers(0, len(sent) - 1))] = data.draw(st.integers(0, 255))
    try:
        came = report_from_bytes(bytes(sent))
    except ValueError:
        return
    for each in came.uavs:
        repr(each.telemetry)  # all of it can be read
