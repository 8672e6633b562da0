"""Every error of the interface, the same in the class interface and in the client.

Over gRPC an error is a status code with a ``google.rpc.ErrorInfo`` of domain ``ual``; `reason` and `metadata` are its.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

DOMAIN = "ual"


class UalError(Exception):
    """Something was refused or failed: the message says what, why, and what to do."""

    reason: ClassVar[str] = "INTERNAL"

    def __init__(self, message: str, metadata: Mapping[str, str] | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.metadata: Mapping[str, str] = MappingProxyType(dict(metadata or {}))

    @property
    def state(self) -> str | None:
        """Name of the UAV's state when it was raised, where that matters."""
        return self.metadata.get("state")


class WrongStateError(UalError):
    """The command is not allowed in the present state."""

    reason = "WRONG_STATE"


class InvalidArgumentError(UalError, ValueError):
    """A value cannot be meant; metadata ``field`` names it."""

    reason = "INVALID_ARGUMENT"


class UnknownFrameError(InvalidArgumentError):
    """No frame has that name; metadata ``known`` lists those that are."""

    reason = "UNKNOWN_FRAME"


class GeofenceError(UalError):
    """The goal or its path lies outside the geofence."""

    reason = "GEOFENCE"


class TaskAbortedError(UalError):
    """The task was replaced, cancelled, or taken by the safety pilot; metadata ``by`` says which."""

    reason = "TASK_ABORTED"


class RejectedByAutopilotError(UalError):
    """The autopilot refused, or did not do as told; the message carries its own words."""

    reason = "REJECTED_BY_AUTOPILOT"


class LinkLostError(UalError):
    """No data comes from the autopilot."""

    reason = "LINK_LOST"


class UalTimeoutError(UalError, builtins.TimeoutError):
    """It took longer than it can take, or than the caller would wait."""

    reason = "TIMEOUT"


class NotSupportedError(UalError):
    """The backend cannot do that."""

    reason = "NOT_SUPPORTED"


class UnauthenticatedError(UalError):
    """No or wrong credentials."""

    reason = "UNAUTHENTICATED"


class PermissionDeniedError(UalError):
    """The caller, or this daemon, may not do that."""

    reason = "PERMISSION_DENIED"


class DaemonUnreachableError(UalError, ConnectionError):
    """No daemon answers there. Raised by the client only; never sent over the wire."""

    reason = "DAEMON_UNREACHABLE"


_BY_REASON: Mapping[str, type[UalError]] = {
    kind.reason: kind
    for kind in (
        WrongStateError,
        InvalidArgumentError,
        UnknownFrameError,
        GeofenceError,
        TaskAbortedError,
        RejectedByAutopilotError,
        LinkLostError,
        UalTimeoutError,
        NotSupportedError,
        UnauthenticatedError,
        PermissionDeniedError,
        DaemonUnreachableError,
    )
}


def from_reason(reason: str, message: str, metadata: Mapping[str, str] | None = None) -> UalError:
    """The error of a reason; a plain `UalError` for a reason of a newer daemon."""
    return _BY_REASON.get(reason, UalError)(message, metadata)
