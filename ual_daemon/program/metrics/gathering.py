"""Gathers the metrics of the UAVs of one process: nearly all are read when they are requested, not counted before."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ual.recording.recorder import QueueFigures
from ual.types import Battery, GpsFix, GpsInfo, State
from ual_daemon._version import __version__
from ual_daemon.program.metrics.catalogue import MetricSample
from ual_daemon.program.metrics.setpoint_meter import BOUNDS_S, SetpointMeter
from ual_daemon.program.metrics.threads import audit_samples, guard_samples
from ual_daemon.server.server import ServerFigures
from ual_daemon.vehicle.figures import VehicleFigures

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle
    from ual_daemon.program.recording.audit_writer import AuditFigures

_SETPOINTS_DUE = (State.FLYING_AUTO, State.TAKING_OFF, State.UNINITIALIZED)
"""In UNINITIALIZED it is not known where the UAV is: setpoints are due as before."""
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class MeasuredServer(Protocol):
    """The server of a UAV."""

    def figures(self) -> ServerFigures:
        """Returns what is measured of it, as it is now."""
        ...


class Recorded(Protocol):
    """The recording of all UAVs of the process."""

    @property
    def figures(self) -> QueueFigures:
        """Figures of the queue of lines that wait to be written."""
        ...


class Audited(Protocol):
    """The audit of all UAVs of the process."""

    @property
    def figures(self) -> AuditFigures:
        """Figures of the audit."""
        ...


class UavMetrics:
    """The metrics of one UAV."""

    def __init__(self, vehicle: ServedVehicle, server: MeasuredServer) -> None:
        self._vehicle = vehicle
        self._server = server
        self._labels = {"ns": vehicle.ns}
        self._meter = SetpointMeter(vehicle.clock.now_s, self._period_s())
        vehicle.observe_setpoints(self._meter.on_sent)
        vehicle.listen_to_state(self._on_state)

    def _period_s(self) -> float:
        return 1.0 / self._vehicle.figures().setpoint_rate_hz

    def _on_state(self, state: State) -> None:
        if state not in _SETPOINTS_DUE:
            self._meter.on_pause(self._period_s())

    def samples(self) -> Iterator[MetricSample]:
        """Yields the values, as they are now."""
        now, served = self._vehicle.figures(), self._server.figures()
        yield from self._of_uav(now)
        yield from self._of_battery(now.snapshot.condition.battery)
        yield from self._of_gps(now.snapshot.condition.gps)
        yield from self._of_link(now)
        yield from self._of_setpoints()
        yield from self._of_tasks(now)
        yield from self._of_calls(now, served)
        yield self._of("ual_plans_running", served.plans.running_count)
        yield self._of("ual_plan_seconds", served.plans.ended_count, suffix="_count")
        yield self._of("ual_plan_seconds", served.plans.ended_s, suffix="_sum")

    def _of(self, metric: str, value: float, suffix: str = "", **labels: str) -> MetricSample:
        return MetricSample(metric, suffix, {**self._labels, **labels}, float(value))

    def _known(self, values: Mapping[str, float | None], suffix: str = "") -> Iterator[MetricSample]:
        """Yields those that are known: a value that is not measured has no sample."""
        yield from (self._of(name, value, suffix) for name, value in values.items() if value is not None)

    def _of_uav(self, now: VehicleFigures) -> Iterator[MetricSample]:
        info = self._vehicle.info()
        yield self._of("ual_up", 1)
        yield self._of(
            "ual_uav", 1, "_info", backend=info.backend, autopilot=info.autopilot, version=info.autopilot_version
        )
        yield from (self._of("ual_state", each is now.state, state=each.name) for each in State)
        yield self._of("ual_armed", now.is_armed)
        yield self._of("ual_airborne", now.is_airborne)
        yield self._of("ual_flown_by_ual", now.is_ours)
        if now.snapshot.control.failsafe is not None:
            yield self._of("ual_failsafe", 1, cause=now.snapshot.control.failsafe.value)

    def _of_battery(self, battery: Battery | None) -> Iterator[MetricSample]:
        found = battery or Battery()
        left = None if found.remaining_percent is None else found.remaining_percent / 100.0
        yield from self._known(
            {
                "ual_battery_remaining_ratio": left,
                "ual_battery_voltage_volts": found.voltage_v,
                "ual_battery_current_amperes": found.current_a,
            }
        )

    def _of_gps(self, gps: GpsInfo | None) -> Iterator[MetricSample]:
        if gps is None:
            return
        yield from (self._of("ual_gps_fix", each is gps.fix, fix=each.name) for each in GpsFix)
        yield from self._known(
            {"ual_gps_corrections_age_seconds": gps.corrections_age_s, "ual_gps_baseline_meters": gps.baseline_m}
        )

    def _of_link(self, now: VehicleFigures) -> Iterator[MetricSample]:
        heard_s, link = now.snapshot.heard_s, now.link
        yield self._of("ual_link_up", now.is_link_up)
        yield from self._known(
            {
                "ual_link_silence_seconds": None if heard_s is None else max(0.0, now.snapshot.time_s - heard_s),
                "ual_link_rate_hertz": link.rate_hz,
                "ual_link_loss_ratio": link.loss,
                "ual_link_round_trip_seconds": link.round_trip_s,
            }
        )
        counts: dict[str, float | None] = {
            "ual_link_losses": link.lost_count,
            "ual_autopilot_reboots": link.reboots_count,
        }
        yield from self._known(counts, "_total")

    def _of_setpoints(self) -> Iterator[MetricSample]:
        counts, sum_s = self._meter.lateness
        yield self._of("ual_setpoints_sent", self._meter.sent_count, "_total")
        for bound_s, count in zip(BOUNDS_S, counts, strict=True):
            le = "+Inf" if bound_s == BOUNDS_S[-1] else str(bound_s)
            yield self._of("ual_setpoint_lateness_seconds", count, "_bucket", le=le)
        yield self._of("ual_setpoint_lateness_seconds", counts[-1], "_count")
        yield self._of("ual_setpoint_lateness_seconds", sum_s, "_sum")

    def _of_tasks(self, now: VehicleFigures) -> Iterator[MetricSample]:
        if now.task is not None:
            yield self._of("ual_tasks_running", 1, kind=now.task.name.lower())
        for (kind, status), count in now.tasks_ended.items():
            labels = {"kind": kind.name.lower(), "outcome": status.name.lower()}
            yield self._of("ual_tasks_ended", count, "_total", **labels)

    def _of_calls(self, now: VehicleFigures, served: ServerFigures) -> Iterator[MetricSample]:
        yield self._of("ual_callers", served.calls.callers_count)
        yield self._of("ual_lease_held", now.is_leased)
        yield self._of("ual_stream_samples_missed", served.missed_count, "_total")
        for method, count in served.calls.streams.items():
            yield self._of("ual_streams", count, method=method)
        for reason, count in served.calls.failures.items():
            yield self._of("ual_failed_calls", count, "_total", reason=reason)


class ProcessMetrics:
    """The metrics of one process and of all its UAVs. `process` is its name: that of its first UAV."""

    def __init__(self, process: str, recording: Recorded | None = None, audit: Audited | None = None) -> None:
        self._labels = {"process": process}
        self._audit = audit
        self._recording = recording
        self._uavs: tuple[UavMetrics, ...] = ()

    def add(self, vehicle: ServedVehicle, server: MeasuredServer) -> None:
        """Adds a UAV, before its vehicle is opened."""
        self._uavs = (*self._uavs, UavMetrics(vehicle, server))

    def samples(self) -> list[MetricSample]:
        """Returns all values, as they are now. From any thread."""
        of_uavs = (each for uav in self._uavs for each in uav.samples())
        audit = [] if self._audit is None else audit_samples(self._labels, self._audit.figures)
        return [*self._of_process(), *self._of_recorder(), *guard_samples(self._labels), *audit, *of_uavs]

    def _of_process(self) -> Iterator[MetricSample]:
        used = resource.getrusage(resource.RUSAGE_SELF)
        yield MetricSample("ual_build", "_info", {**self._labels, "version": __version__}, 1.0)
        yield MetricSample("ual_process_cpu_seconds", "_total", self._labels, used.ru_utime + used.ru_stime)
        resident_bytes = _resident_bytes()
        if resident_bytes is not None:
            yield MetricSample("ual_process_resident_memory_bytes", "", self._labels, resident_bytes)

    def _of_recorder(self) -> Iterator[MetricSample]:
        if self._recording is None:
            return
        queue = self._recording.figures
        yield MetricSample("ual_recorder_running", "", self._labels, float(queue.is_running))
        yield MetricSample("ual_recorder_queue_entries", "", self._labels, queue.entries_count)
        yield MetricSample("ual_recorder_queue_bytes", "", self._labels, queue.size_bytes)
        yield MetricSample("ual_recorder_lost_entries", "_total", self._labels, queue.lost_count)


def _resident_bytes() -> int | None:
    """Returns the memory of this process, where the system shows it (Linux)."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE_BYTES
    except OSError:
        return None
