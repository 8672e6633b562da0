"""The metrics of what works besides the flight: the guards of worker threads, and the audit. Imports no gRPC."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ual.shared import guard
from ual_daemon.program.metrics.catalogue import MetricSample

if TYPE_CHECKING:
    from ual_daemon.program.recording.audit_writer import AuditFigures


def guard_samples(labels: Mapping[str, str]) -> list[MetricSample]:
    """Returns what the guards of this process have counted."""
    found = guard.figures()
    failed = [
        MetricSample("ual_worker_failures", "_total", {**labels, "worker": name}, float(count))
        for name, count in found.failed.items()
    ]
    return [*failed, MetricSample("ual_threads_ended", "_total", labels, float(len(found.ended_threads)))]


def audit_samples(labels: Mapping[str, str], audit: AuditFigures) -> list[MetricSample]:
    """Returns how an audit stands."""
    return [
        MetricSample("ual_audit_writable", "", labels, float(audit.is_writable)),
        MetricSample("ual_audit_queue_entries", "", labels, float(audit.entries_count)),
        MetricSample("ual_audit_queue_bytes", "", labels, float(audit.size_bytes)),
        MetricSample("ual_audit_lost_lines", "_total", labels, float(audit.lost_count)),
        MetricSample("ual_audit_file_losses", "_total", labels, float(audit.file_losses_count)),
    ]
