"""Content of deploy/monitoring, as the real Prometheus judges it: its configuration, its rules, its dashboard."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

import ual
from tests.conftest import LIMIT_S, StartDaemon
from tests.ports import free_port
from tests.waiting import until
from ual.simulation import LinkLost
from ual.types import State
from ual_daemon.program.metrics.catalogue import CATALOGUE, MetricSample
from ual_daemon.program.metrics.exporter import Exporter
from ual_daemon.server.addresses import Address

MONITORING = Path(__file__).parents[2] / "deploy" / "monitoring"
RULES = MONITORING / "alerts.yml"
DASHBOARD = MONITORING / "dashboard.json"

needs_prometheus = pytest.mark.skipif(
    shutil.which("promtool") is None or shutil.which("prometheus") is None,
    reason="PROMETHEUS IS MISSING, alerts and dashboard are NOT TESTED: apt-get install prometheus",
)


def alerts() -> list[str]:
    (group,) = yaml.safe_load(RULES.read_text())["groups"]
    return [rule["alert"] for rule in group["rules"]]


def queries() -> list[str]:
    """The queries of the dashboard, for all UAVs."""
    dashboard = json.loads(DASHBOARD.read_text())
    found = [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", ())]
    return [text.replace("$ns", ".*").replace("$__rate_interval", "10s") for text in found]


# --- The files --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", [RULES, DASHBOARD], ids=lambda path: path.name)
def test_only_metrics_that_there_are_stand_in_it(path: Path) -> None:
    used = set(re.findall(r"\bual_\w+", path.read_text()))
    assert used
    bases = {re.sub("_(total|bucket|count|sum|info)$", "", name) for name in used}
    assert bases <= set(CATALOGUE)


def test_the_dashboard_shows_all_metrics_but_those_of_the_alerts_alone() -> None:
    text = DASHBOARD.read_text()
    assert {name for name in CATALOGUE if name not in text} == {
        "ual_airborne",
        "ual_armed",
        "ual_battery_current_amperes",
        "ual_flown_by_ual",
    }


def test_the_page_has_all_alerts() -> None:
    assert re.findall(r"^\| `(Ual\w+)`", (MONITORING / "README.md").read_text(), re.MULTILINE) == alerts()


# --- The rules --------------------------------------------------------------------------------------------------------

UAV, PROCESS = 'instance="a", job="ual", ns="uav_1"', 'instance="a", job="ual", process="uav_1"'
LATE = "ual_setpoint_lateness_seconds"
CALM = {
    'up{instance="a", job="ual"}': "1x180",
    f"ual_up{{{UAV}}}": "1x180",
    f"ual_link_up{{{UAV}}}": "1x180",
    f"ual_airborne{{{UAV}}}": "1x180",
    f"ual_autopilot_reboots_total{{{UAV}}}": "1x180",
    f"{LATE}_count{{{UAV}}}": "0+50x180",
    f'{LATE}_bucket{{{UAV}, le="0.05"}}': "0+50x180",
    f'{LATE}_bucket{{{UAV}, le="0.5"}}': "0+50x180",
    f"ual_battery_remaining_ratio{{{UAV}}}": "0.8x180",
    f"ual_link_loss_ratio{{{UAV}}}": "0.01x180",
    f"ual_link_round_trip_seconds{{{UAV}}}": "0.02x180",
    f'ual_state{{{UAV}, state="UNINITIALIZED"}}': "0x180",
    f'ual_failed_calls_total{{{UAV}, reason="PERMISSION_DENIED"}}': "1x180",
    f'ual_failed_calls_total{{{UAV}, reason="GEOFENCE"}}': "0+1x180",
    f"ual_recorder_running{{{PROCESS}}}": "1x180",
    f"ual_recorder_lost_entries_total{{{PROCESS}}}": "3x180",
}
"""Three minutes in which all is well, a value each second."""
CAUSES: dict[str, tuple[dict[str, str], Sequence[str]]] = {
    "UalDaemonGone": ({'up{instance="a", job="ual"}': "1x100 0x80"}, ()),
    "UalUavGone": ({f"ual_up{{{UAV}}}": "1x100 0x80"}, ()),
    "UalLinkLostInFlight": ({f"ual_link_up{{{UAV}}}": "1x118 0x62"}, ()),
    "UalRebootInFlight": ({f"ual_autopilot_reboots_total{{{UAV}}}": "1x100 2x80"}, ()),
    "UalFailsafe": ({f'ual_failsafe{{{UAV}, cause="battery failsafe"}}': "_x118 1x62"}, ()),
    "UalSetpointsVeryLate": ({f'{LATE}_bucket{{{UAV}, le="0.5"}}': "0+50x100 5049+50x80"}, ()),
    "UalSetpointsLate": ({f'{LATE}_bucket{{{UAV}, le="0.05"}}': "0+48x180"}, ()),
    "UalBatteryEmpty": ({f"ual_battery_remaining_ratio{{{UAV}}}": "0.8x100 0.1x80"}, ("UalBatteryLow",)),
    "UalBatteryLow": ({f"ual_battery_remaining_ratio{{{UAV}}}": "0.8x100 0.25x80"}, ()),
    "UalLinkPoor": ({f"ual_link_round_trip_seconds{{{UAV}}}": "0.02x60 0.9x120"}, ()),
    "UalStateUnknown": ({f'ual_state{{{UAV}, state="UNINITIALIZED"}}': "0x50 1x130"}, ()),
    "UalCallersRefused": ({f'ual_failed_calls_total{{{UAV}, reason="PERMISSION_DENIED"}}': "1x100 2x80"}, ()),
    "UalAuditNotWritten": ({f"ual_audit_writable{{{PROCESS}}}": "1x118 0x62"}, ()),
    "UalAuditFileLost": ({f"ual_audit_file_losses_total{{{PROCESS}}}": "0x100 1x80"}, ()),
    "UalThreadEnded": ({f"ual_threads_ended_total{{{PROCESS}}}": "0x100 1x80"}, ()),
    "UalRecordingEnded": ({f"ual_recorder_running{{{PROCESS}}}": "1x118 0x62"}, ()),
    "UalRecordingLoses": ({f"ual_recorder_lost_entries_total{{{PROCESS}}}": "3x100 4x80"}, ()),
}
"""Cause of each alert, and the others that fire at the same time, after two minutes."""


GONE = {
    "a job of another name": {
        'up{instance="10.1.2.3:9110", job="kubernetes-pods"}': "1x100 0x80",
        'ual_up{instance="10.1.2.3:9110", job="kubernetes-pods", ns="uav_7"}': "1x100 _x80",
    },
    "one that never answered": {'up{instance="b", job="any", ual="daemon"}': "0x180"},
}
"""Daemons that are gone, as other Prometheus servers name them."""
OTHERS = {'up{instance="c", job="node"}': "0x180"}
"""A target that is no daemon."""


def promtool(*words: str) -> None:
    done = subprocess.run(["promtool", *words], capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stdout + done.stderr


def case(name: str, series: dict[str, str], firing: Sequence[str]) -> dict[str, Any]:
    """Three minutes, and the alerts that fire after two of them."""
    return {
        "name": name,
        "interval": "1s",
        "input_series": [{"series": each, "values": values} for each, values in {**CALM, **series}.items()],
        "promql_expr_test": [
            {
                "expr": 'count by (alertname) (ALERTS{alertstate="firing"})',
                "eval_time": "2m",
                "exp_samples": [{"labels": f'{{alertname="{each}"}}', "value": 1} for each in firing],
            }
        ],
    }


@needs_prometheus
def test_each_alert_fires_for_its_cause_and_none_while_all_is_well(tmp_path: Path) -> None:
    assert list(CAUSES) == alerts()
    tests = [case("all is well", {}, ())]
    tests += [case(name, series, (name, *others)) for name, (series, others) in CAUSES.items()]
    tests += [case(name, series, ("UalDaemonGone",)) for name, series in GONE.items()]
    tests += [case("what is no daemon", OTHERS, ())]
    path = tmp_path / "cases.yml"
    path.write_text(json.dumps({"rule_files": [str(RULES)], "evaluation_interval": "1s", "tests": tests}))
    promtool("test", "rules", str(path))


@needs_prometheus
def test_prometheus_takes_the_configuration() -> None:
    promtool("check", "config", str(MONITORING / "prometheus.yml"))


# --- The real Prometheus ----------------------------------------------------------------------------------------------


class Prometheus:
    """A Prometheus that reads one address each second."""

    def __init__(self, port: int, process: subprocess.Popen[bytes]) -> None:
        self._process = process
        self._url = f"http://127.0.0.1:{port}/api/v1/query"

    def ask(self, query: str) -> list[dict[str, Any]]:
        """Returns the result of a query."""
        url = f"{self._url}?{urllib.parse.urlencode({'query': query})}"
        with urllib.request.urlopen(url, timeout=LIMIT_S) as answer:
            found = json.load(answer)
        assert found["status"] == "success"
        result: list[dict[str, Any]] = found["data"]["result"]
        return result

    def wait_for(self, query: str) -> list[dict[str, Any]]:
        """Returns the result of a query, once there is any."""
        return until(lambda: self._tried(query), query)

    def _tried(self, query: str) -> list[dict[str, Any]]:
        assert self._process.poll() is None, "prometheus has ended"
        try:
            return self.ask(query)
        except OSError:  # it starts
            return []


@contextmanager
def prometheus(target: str, directory: Path) -> Iterator[Prometheus]:
    """Runs it with our configuration, on a target and in a rhythm of the test."""
    configuration = yaml.safe_load((MONITORING / "prometheus.yml").read_text())
    configuration["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
    configuration["rule_files"] = [str(RULES)]
    configuration["scrape_configs"][0]["static_configs"] = [{"targets": [target]}]
    path, port = directory / "prometheus.yml", free_port()
    path.write_text(yaml.safe_dump(configuration))
    flags = [f"--config.file={path}", f"--storage.tsdb.path={directory / 'data'}", "--log.level=warn"]
    with (directory / "prometheus.log").open("w") as log:
        process = subprocess.Popen(
            ["prometheus", *flags, f"--web.listen-address=127.0.0.1:{port}"], stdout=log, stderr=log
        )
    try:
        yield Prometheus(port, process)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(LIMIT_S)


def everything() -> Iterator[MetricSample]:
    """A value of each metric, as of one flying UAV."""
    labels = {"ual_tasks_running": {"kind": "land"}, "ual_streams": {"method": "StreamTelemetry"}}
    for name, metric in CATALOGUE.items():
        of = {"process": "uav_1"} if re.match("ual_(build|process|recorder)", name) else {"ns": "uav_1"}
        of |= labels.get(name, {})
        if metric.kind in ("histogram", "summary"):
            yield MetricSample(name, "_count", of, 5.0)
            yield MetricSample(name, "_sum", of, 0.5)
        else:
            suffix = {"counter": "_total", "info": "_info"}.get(metric.kind, "")
            if name != "ual_state":
                yield MetricSample(name, suffix, of, 1.0)
    for le in ("0.05", "0.5", "+Inf"):
        yield MetricSample("ual_setpoint_lateness_seconds", "_bucket", {"ns": "uav_1", "le": le}, 5.0)
    for state in State:
        yield MetricSample("ual_state", "", {"ns": "uav_1", "state": state.name}, float(state is State.FLYING_AUTO))


@pytest.mark.slow
@needs_prometheus
def test_every_query_of_the_dashboard_answers(tmp_path: Path) -> None:
    exporter = Exporter(Address("127.0.0.1", 0))
    exporter.start(lambda: list(everything()))
    try:
        with prometheus(str(exporter.address), tmp_path) as asked:
            asked.wait_for("rate(ual_plan_seconds_count[10s])")  # two reads
            assert len(queries()) > 30
            for query in queries():
                assert asked.ask(query), query
    finally:
        exporter.close()


@pytest.mark.slow
@needs_prometheus
def test_a_link_that_is_lost_in_flight_and_a_daemon_that_is_killed_alert(
    start_daemon: StartDaemon, tmp_path: Path
) -> None:
    daemon = start_daemon("--metrics", "127.0.0.1:0", "--auto-arm")
    address = str(daemon.wait_for("metrics")["address"])
    daemon.wait_for("state", new="LANDED_ARMED")
    firing: Callable[[str], str] = 'ALERTS{{alertname="{}", alertstate="firing"}}'.format
    with prometheus(address, tmp_path) as asked:
        asked.wait_for('up{job="ual"} == 1')
        with ual.Uav(address=daemon.address) as uav:
            uav.take_off(2.0)
            assert asked.wait_for('ual_state{state="FLYING_AUTO"} == 1')[0]["metric"]["ns"] == "uav_1"
            assert not asked.ask('ALERTS{alertstate="firing"}')
            uav.simulation.begin_fault(LinkLost())
            assert asked.wait_for(firing("UalLinkLostInFlight"))[0]["metric"]["ns"] == "uav_1"
        daemon.signal(signal.SIGKILL)
        assert asked.wait_for(firing("UalDaemonGone"))[0]["metric"]["instance"] == address
