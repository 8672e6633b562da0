"""The checks of the daemon that its UAVs tell."""

from __future__ import annotations

from tests.ual_daemon.stepped import STEP_S, stepped
from ual.wire import samples
from ual_daemon.program.checks import DaemonChecks


def test_a_file_whose_name_is_no_text_does_not_hide_the_telemetry() -> None:
    """A program that flew saw nothing any more, as soon as the audit of such a name failed."""
    with stepped() as uav:
        DaemonChecks([uav.vehicle], [lambda: ["the audit caf\udce9 cannot be written"]]).refresh()
        uav.run(STEP_S)
        health = samples.telemetry_to_proto(uav.vehicle.telemetry()).health
        assert "daemon: the audit caf? cannot be written" in health.failing_checks
