"""``ual-daemon --metrics``, as a real process."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.ual_daemon.program.metrics.scraped import scraped
from tests.ual_daemon.program.test_imports import loaded, start
from tests.waiting import until
from ual import discovery
from ual.errors import GeofenceError
from ual.geometry import Pose


def where(daemon: DaemonProcess) -> str:
    return str(daemon.wait_for("metrics")["address"])


def test_a_flight_is_observed_from_outside(start_daemon: StartDaemon, tmp_path: Path) -> None:
    flags = ("--auto-arm", "--set", "light.speed_factor=10", "--record", str(tmp_path))
    daemon = start_daemon("--metrics", "127.0.0.1:0", *flags)
    address = where(daemon)
    daemon.wait_for("state", new="LANDED_ARMED")
    with ual.Uav(address=daemon.address) as uav:
        uav.take_off(3.0)
        with pytest.raises(GeofenceError):
            uav.go_to_waypoint(Pose.at(0.0, 0.0, 500.0))
        with uav.subscribe(lambda _: None):
            until(lambda: scraped(address).all("ual_streams"), "the stream")
            until(lambda: scraped(address).labels("ual_state", "state") == ["FLYING_AUTO"], "the flight")
            values = scraped(address)
    assert values("ual_setpoints_sent_total", ns="uav_1") > 0
    assert values("ual_failed_calls_total", reason="GEOFENCE") == 1
    assert values("ual_callers") >= 1
    assert values("ual_recorder_running", process="uav_1") == 1
    assert values("ual_build_info") == 1
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0


def test_one_exporter_for_a_fleet_of_several_processes(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "4", "--workers", "2", "--metrics", "127.0.0.1:0")
    daemon.wait_for("serving")
    address = where(daemon)
    names = [f"uav_{number}" for number in range(1, 5)]
    until(lambda: sorted(scraped(address).labels("ual_up", "ns")) == names, "all UAVs")
    values = scraped(address)
    assert len(values.all("ual_process_cpu_seconds_total")) == 2
    assert [len(values.labels("ual_state", "ns")), len(values.all("ual_link_up"))] == [4, 4]
    pid = next(each.pid for each in discovery.list_daemons() if each.ns == "uav_4")
    os.kill(pid, signal.SIGKILL)
    daemon.wait_for("worker_ended")
    until(lambda: scraped(address).labels("ual_up", "ns") == names[:2], "two UAVs that are down")
    assert scraped(address).all("ual_up") == [1.0, 1.0, 0.0, 0.0]


def test_what_is_wrong_with_the_address_is_reported_at_the_start(start_daemon: StartDaemon) -> None:
    exposed = start_daemon("--metrics", "0.0.0.0:9110")
    assert exposed.wait() == 2
    assert exposed.stderr.startswith("ual-daemon: --metrics: 0.0.0.0:9110 can be read from other computers")
    first = start_daemon("--metrics", "127.0.0.1:0")
    second = start_daemon("--metrics", where(first), ns="uav_2")
    assert second.wait() == 1
    assert second.stderr == f"ual-daemon: cannot serve metrics on {where(first)}: Address already in use\n"
    spread = start_daemon("--metrics", where(first), "--fleet", "2", "--workers", "2", ns="uav_3")
    assert spread.wait() == 1
    assert spread.stderr == second.stderr


def test_without_the_flag_nothing_of_it_is_loaded(runtime_dir: Path) -> None:
    daemon = start(runtime_dir)
    daemon.wait_for("listening")
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    daemon.close()
    assert not [
        name for name in loaded(daemon) if re.match(r"prometheus_client|opentelemetry|wsgiref|http\.server", name)
    ]
