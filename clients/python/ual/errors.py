"""All errors of the interface. The class interface and the client raise the same ones.

Over gRPC an error is a status code with a ``google.rpc.ErrorInfo`` of domain ``ual``, which carries `reason` and
`metadata`.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from typing_extensions import override

DOMAIN = "ual"


class UalError(Exception):
    """Something was refused or has failed. The message says what, why, and what to do."""

    reason: ClassVar[str] = "INTERNAL"

    def __init__(self, message: str, metadata: Mapping[str, str] | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.metadata: Mapping[str, str] = MappingProxyType(dict(metadata or {}))

    @override
    def __reduce__(self) -> tuple[object, ...]:
        """Lets the error pass between processes (pickle) and be copied: a mapping proxy can do neither."""
        return type(self), self._arguments(), {"__notes__": list(getattr(self, "__notes__", ()))}

    def _arguments(self) -> tuple[object, ...]:
        """Returns what `__init__` was called with."""
        return self.message, dict(self.metadata)

    @property
    def state(self) -> str | None:
        """The name of the UAV's state when the error was raised, if the error depends on it."""
        return self.metadata.get("state")


class WrongStateError(UalError):
    """The command is not allowed in the present state."""

    reason = "WRONG_STATE"


class FrameLostError(WrongStateError):
    """The frame is not known to be where it was, as after a reboot of an autopilot that has no satellites.

    Metadata: ``frame_id``, ``since`` (UTC, ISO 8601), and ``remedy``, which says what makes it known again.
    """

    reason = "FRAME_LOST"


class InvalidArgumentError(UalError, ValueError):
    """A value is not valid; metadata ``field`` names it."""

    reason = "INVALID_ARGUMENT"


class UnknownFrameError(InvalidArgumentError):
    """No frame has this name; metadata ``known`` lists the frames that exist."""

    reason = "UNKNOWN_FRAME"


class GeofenceError(UalError):
    """The goal or its path lies outside the geofence, below the floor or above the ceiling (metadata `setting`)."""

    reason = "GEOFENCE"


class TaskAbortedError(UalError):
    """The task was replaced, cancelled, or ended by the safety pilot; metadata ``by`` says which."""

    reason = "TASK_ABORTED"


class RejectedByAutopilotError(UalError):
    """The autopilot refused the command, or accepted it and did not do it; the message quotes the autopilot."""

    reason = "REJECTED_BY_AUTOPILOT"


class LinkLostError(UalError):
    """No data comes from the autopilot."""

    reason = "LINK_LOST"


class UalTimeoutError(UalError, builtins.TimeoutError):
    """It took longer than allowed, or longer than the caller's `timeout_s`."""

    reason = "TIMEOUT"


class NotSupportedError(UalError):
    """The backend cannot do this."""

    reason = "NOT_SUPPORTED"


class ResourceExhaustedError(UalError):
    """A limit on number, size or rate is met; metadata ``limit`` has its value."""

    reason = "RESOURCE_EXHAUSTED"


class LeaseHeldError(UalError):
    """Another program holds the lease of the UAV; metadata ``holder``, ``identity`` and ``since`` (UTC, ISO 8601)."""

    reason = "LEASE_HELD"


class LeaseLostError(UalError):
    """The lease with which this was called has ended; metadata ``by`` says how: expired, released, or the caller that
    took it.
    """

    reason = "LEASE_LOST"


class UnauthenticatedError(UalError):
    """The credentials are missing or wrong."""

    reason = "UNAUTHENTICATED"


class PermissionDeniedError(UalError):
    """The caller, or this daemon, is not permitted to do this."""

    reason = "PERMISSION_DENIED"


class DaemonUnreachableError(UalError, ConnectionError):
    """No daemon answers at the address. Only the client raises it; it is never sent over the wire."""

    reason = "DAEMON_UNREACHABLE"


class ClientUnusableError(UalError):
    """A client or a `UAL` that was closed, or of another event loop or process: make another one.

    It is never sent over the wire.
    """

    reason = "CLIENT_UNUSABLE"


class TeamError(UalError):
    """Some UAVs of a team refused a command, or failed. Only `ual.Team` raises it; it is never sent over the wire.

    `errors` has the error of each of these, `results` what the others returned, both by name.
    """

    reason = "TEAM"

    def __init__(self, errors: Mapping[str, UalError], results: Mapping[str, object]) -> None:
        texts = (f"{name}: {error.reason}: {error.message}" for name, error in errors.items())
        super().__init__("; ".join(texts), {"names": ",".join(errors)})
        self.errors = MappingProxyType(dict(errors))
        self.results = MappingProxyType(dict(results))

    @override
    def _arguments(self) -> tuple[object, ...]:
        return dict(self.errors), dict(self.results)


_BY_REASON: Mapping[str, type[UalError]] = {
    kind.reason: kind
    for kind in (
        WrongStateError,
        FrameLostError,
        InvalidArgumentError,
        UnknownFrameError,
        GeofenceError,
        TaskAbortedError,
        RejectedByAutopilotError,
        LinkLostError,
        UalTimeoutError,
        NotSupportedError,
        ResourceExhaustedError,
        LeaseHeldError,
        LeaseLostError,
        UnauthenticatedError,
        PermissionDeniedError,
        DaemonUnreachableError,
    )
}


def from_reason(reason: str, message: str, metadata: Mapping[str, str] | None = None) -> UalError:
    """Makes the error of a reason; a plain `UalError` if this version does not know the reason."""
    return _BY_REASON.get(reason, UalError)(message, metadata)
