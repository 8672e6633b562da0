"""The audit (``--audit``): a line for each call that changes something. The caller, its address, the call, and its
result.

Lines are only appended, by a thread of their own: a slow or full disk delays no call. `ual.access.audit` says how they
are chained.
"""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from typing_extensions import override

from ual.access import audit
from ual.access.roles import Role
from ual.contract.methods import METHODS
from ual.shared.guard import WorkGuard
from ual_daemon.program.recording.audit_file import time_text
from ual_daemon.program.recording.audit_writer import AuditWriter
from ual_daemon.program.recording.call_json import to_json
from ual_daemon.server.access.needed import needed_role
from ual_daemon.server.call_log import CallObserver, CallRecord

if TYPE_CHECKING:
    from ual_daemon.choice import ServedVehicle

_IS_AUDITED = {each.path: each.is_audited for each in METHODS.values()}


class _QueuedEntry(NamedTuple):
    vehicle: ServedVehicle
    record: CallRecord
    before: object
    after: str
    utc: datetime


def changes(method: str) -> bool:
    """Returns whether a method changes something: of what is not ours, whatever needs more than an observer."""
    return _IS_AUDITED.get(method, needed_role(method) > Role.OBSERVER)


class Audit(AuditWriter):
    """The audit of the UAVs of this process."""

    def observer(self, vehicle: ServedVehicle) -> CallObserver:
        """Returns what observes the calls for a UAV."""
        return _UavAudit(vehicle, self)

    def put_call(self, vehicle: ServedVehicle, record: CallRecord, before: object) -> None:
        """Writes the line of a call, soon. From any thread."""
        size_bytes = (len(record.request) if record.request else 0) + (len(record.response) if record.response else 0)
        waiting = _QueuedEntry(vehicle, record, before, vehicle.state().name, self._now())
        self.put(partial(_entry, waiting, self.guard), size_bytes)


class _UavAudit(CallObserver):
    def __init__(self, vehicle: ServedVehicle, to: Audit) -> None:
        self._vehicle = vehicle
        self._audit = to

    @override
    def on_request(self, method: str) -> object:
        return self._vehicle.state().name if changes(method) else None

    @override
    def on_call(self, record: CallRecord, before: object) -> None:
        if changes(record.method):
            self._audit.put_call(self._vehicle, record, before)


def _entry(waiting: _QueuedEntry, guard: WorkGuard) -> dict[str, Any]:
    """Returns the line of a call; one without its content where that cannot be reported."""
    record = waiting.record
    call = {
        "time": time_text(waiting.utc),
        "ns": waiting.vehicle.ns,
        "event": "ended" if record.has_ended else "began",
        "id": record.number,
        "identity": record.identity,
        "caller": record.caller,
        "agent": record.agent,
        "method": record.method,
    }
    content = guard.run(lambda: to_json(record), lambda why: {audit.UNTOLD: why})
    return {**call, **content, "state_before": waiting.before, "state_after": waiting.after}
