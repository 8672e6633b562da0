"""All metrics: their names, kinds, units and what they mean. Names follow Prometheus' conventions.

The names are a contract with dashboards and alert rules: docs/reference/metrics.md has the same table, and a test
compares them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

Kind = Literal["counter", "gauge", "histogram", "info", "summary"]


class Metric(NamedTuple):
    """Kind, unit and help text of a metric. `unit` is empty for a number; else the name ends in it."""

    kind: Kind
    unit: str
    text: str


class MetricSample(NamedTuple):
    """A value of a metric. `suffix` follows the metric's name: ``_total`` of a counter, ``_bucket``, ``_sum``, ..."""

    metric: str
    suffix: str
    labels: Mapping[str, str]
    value: float


_UAV = {
    "ual_up": Metric("gauge", "", "Whether the process that flies the UAV has answered (1) or not (0)."),
    "ual_uav": Metric("info", "", "The UAV: its backend and its autopilot."),
    "ual_state": Metric("gauge", "", "1 for the state in which the UAV is, 0 for the others."),
    "ual_armed": Metric("gauge", "", "Whether the autopilot last said that it is armed."),
    "ual_airborne": Metric("gauge", "", "Whether it was last said to be armed and not on the ground."),
    "ual_flown_by_ual": Metric("gauge", "", "Whether UAL flies the present flight."),
    "ual_failsafe": Metric("gauge", "", "1 while a failsafe of the autopilot is active, by its cause."),
    "ual_battery_remaining_ratio": Metric("gauge", "ratio", "What is left of the battery, 0 to 1."),
    "ual_battery_voltage_volts": Metric("gauge", "volts", "The voltage of the battery."),
    "ual_battery_current_amperes": Metric("gauge", "amperes", "The current of the battery; positive: it is used."),
    "ual_gps_fix": Metric("gauge", "", "1 for the kind of the fix that the satellite receiver has, 0 for the others."),
    "ual_gps_corrections_age_seconds": Metric("gauge", "seconds", "How old the last corrections of satellites are."),
    "ual_gps_baseline_meters": Metric("gauge", "meters", "The distance from the base station of the corrections."),
}
_LINK = {
    "ual_link_up": Metric("gauge", "", "Whether the autopilot is heard."),
    "ual_link_silence_seconds": Metric("gauge", "seconds", "How long nothing was heard of the autopilot."),
    "ual_link_rate_hertz": Metric("gauge", "hertz", "Messages of the autopilot in a second."),
    "ual_link_loss_ratio": Metric("gauge", "ratio", "The part of the autopilot's messages that was lost, 0 to 1."),
    "ual_link_round_trip_seconds": Metric("gauge", "seconds", "The newest time from a request to its answer."),
    "ual_link_losses": Metric("counter", "", "How often the link was lost."),
    "ual_autopilot_reboots": Metric("counter", "", "How often the autopilot has rebooted."),
}
_FLIGHT = {
    "ual_setpoints_sent": Metric("counter", "", "Setpoints that were sent to the autopilot."),
    "ual_setpoint_lateness_seconds": Metric(
        "histogram", "seconds", "How long after it was due a setpoint was sent, while UAL flies."
    ),
    "ual_tasks_running": Metric("gauge", "", "Tasks that run, by kind."),
    "ual_tasks_ended": Metric("counter", "", "Tasks that have ended, by kind and outcome."),
    "ual_plans_running": Metric("gauge", "", "Paths that are being planned."),
    "ual_plan_seconds": Metric("summary", "seconds", "How long the planning of paths took."),
}
_CALLS = {
    "ual_callers": Metric("gauge", "", "Programs with a call under way that waits or is a stream."),
    "ual_streams": Metric("gauge", "", "Open streams, by method."),
    "ual_stream_samples_missed": Metric("counter", "", "Samples of telemetry that slow readers have missed."),
    "ual_lease_held": Metric("gauge", "", "Whether a program holds the lease."),
    "ual_failed_calls": Metric("counter", "", "Calls that were refused or have failed, by reason."),
}
_PROCESS = {
    "ual_build": Metric("info", "", "The version of the daemon."),
    "ual_process_cpu_seconds": Metric("counter", "seconds", "Processor time of a process of the daemon."),
    "ual_process_resident_memory_bytes": Metric("gauge", "bytes", "Memory of a process of the daemon."),
    "ual_recorder_running": Metric("gauge", "", "Whether the recording goes on (0: the log says why not)."),
    "ual_recorder_queue_entries": Metric("gauge", "", "Entries that wait for the disk."),
    "ual_recorder_queue_bytes": Metric("gauge", "bytes", "About how many bytes wait for the disk."),
    "ual_recorder_lost_entries": Metric("counter", "", "Entries that were dropped because the disk is too slow."),
    "ual_worker_failures": Metric("counter", "", "Entries that a worker thread could not process, by its name."),
    "ual_threads_ended": Metric("counter", "", "Threads of a process that have ended by a defect."),
    "ual_audit_writable": Metric("gauge", "", "Whether lines of the audit can be written."),
    "ual_audit_queue_entries": Metric("gauge", "", "Lines of the audit that wait for the disk."),
    "ual_audit_queue_bytes": Metric("gauge", "bytes", "Bytes of requests and answers that wait for the audit's disk."),
    "ual_audit_lost_lines": Metric("counter", "", "Lines of the audit that were dropped because too much waited."),
    "ual_audit_file_losses": Metric("counter", "", "How often the audit's file was removed, moved or replaced."),
}
CATALOGUE: Mapping[str, Metric] = {**_UAV, **_LINK, **_FLIGHT, **_CALLS, **_PROCESS}
"""All metrics, by name, in the order in which they are served."""
