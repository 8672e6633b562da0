"""Whatever bytes come: no exception, no traceback, no data that cannot be true, and no container that grows.

`python -m benchmarks.fuzz` does the same with more bytes.
"""

import logging
import math
import os

import pytest

from tests.ual_daemon.backends.mavlink.fuzz import KINDS, Fuzz, sizes
from ual_daemon.backends.engine.plausibility import MAX_ALTITUDE_M
from ual_daemon.validation import MAX_DISTANCE_M, MAX_SPEED_M_S

BYTES_COUNT = 90_000 if os.environ.get("UAL_TEST_HYPOTHESIS") == "thorough" else 30_000
"""For each kind, on datagrams and on a stream: some 10^6 in all in `make test-all`."""


@pytest.mark.parametrize("is_stream", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_no_bytes_break_the_session(kind: str, is_stream: bool, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    fuzz = Fuzz(kind, is_stream=is_stream)
    impossible_count = 0
    while fuzz.bytes_count < BYTES_COUNT:
        fuzz.step()
        snapshot = fuzz.harness.snapshot()
        if snapshot.motion.pose is not None:
            assert snapshot.motion.pose.value.position.norm() <= MAX_DISTANCE_M
            assert abs(snapshot.motion.pose.value.orientation.norm() - 1.0) < 1e-6
            assert snapshot.motion.velocity.value.linear.norm() <= MAX_SPEED_M_S
        if snapshot.motion.position_geo is not None:
            assert abs(snapshot.motion.position_geo.latitude_deg) <= 90.0
            assert abs(snapshot.motion.position_geo.altitude_amsl_m) <= MAX_ALTITUDE_M
        telemetry = fuzz.harness.session.telemetry
        assert all(math.isfinite(value) for value in telemetry.parameters.values())
        # A vehicle that turns out to be another one begins a new session, which counts anew.
        impossible_count = max(impossible_count, telemetry.plausibility.counts.total())
    assert not [record for record in caplog.records if record.exc_info or record.levelno >= logging.ERROR]
    found = sizes(fuzz.harness.discovery)
    assert len(found) > 10
    assert {name: size for name, size in found.items() if size > 600} == {}
    assert (impossible_count > 0) is (kind in ("mutated", "invented"))
    if kind in ("random", "magics"):
        snapshot = fuzz.harness.snapshot()
        assert (snapshot.control.armed.value, snapshot.control.mode.value.name, snapshot.motion.pose) == (
            False,
            "AUTO.LOITER",
            None,
        )
        assert fuzz.harness.supervision.watch.reboots_count == 0
    elif kind != "damaged":
        assert fuzz.harness.discovery.link_statistics(fuzz.harness.now_s).rate_hz > 50.0
    assert len([record for record in caplog.records if "autopilot_rebooted" not in record.message]) < 40
