"""Reported position on Earth: one that somebody vouches for."""

from __future__ import annotations

from typing import Any

import pytest

from tests.snapshots import changed
from tests.ual_daemon.stepped import Stepped
from ual.types import GeoPoint, GpsFix, GpsInfo
from ual_daemon.backends.values import Estimator, Sample

PLACE = GeoPoint(47.4, 8.5, 488.0)
GOOD, BAD = Sample(Estimator(True, ""), 0.0), Sample(Estimator(False, "no position"), 0.0)


@pytest.mark.parametrize(
    ("estimator", "gps", "told"),
    [
        (GOOD, None, PLACE),
        (BAD, GpsInfo(GpsFix.RTK_FIXED), None),  # ArduPilot goes on reporting the last one
        (None, GpsInfo(GpsFix.FIX_3D), PLACE),  # iNav and Betaflight say nothing of their estimators
        (None, GpsInfo(GpsFix.RTK_FIXED), PLACE),
        (None, GpsInfo(GpsFix.FIX_2D), None),
        (None, None, None),
    ],
)
def test_a_position_is_reported_where_the_estimator_or_else_the_satellites_are_good(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch, estimator: Any, gps: GpsInfo | None, told: GeoPoint | None
) -> None:
    backend = flying.vehicle.backend
    snapshot = changed(backend.snapshot(), estimator=estimator, gps=gps, position_geo=PLACE)
    monkeypatch.setattr(backend, "snapshot", lambda: snapshot)
    assert flying.vehicle.telemetry().position_geo == told


def test_without_an_estimator_no_position_is_computed(flying: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    backend = flying.vehicle.backend
    snapshot = changed(backend.snapshot(), estimator=None, gps=GpsInfo(GpsFix.FIX_3D), position_geo=None)
    monkeypatch.setattr(backend, "snapshot", lambda: snapshot)
    assert flying.vehicle.telemetry().position_geo is None
