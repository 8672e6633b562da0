"""Converts the errors of the interface to gRPC's and back: a status code with a ``google.rpc.ErrorInfo`` of domain
``ual``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import cast

import grpc
from google.protobuf.any_pb2 import Any
from google.protobuf.message import DecodeError
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status

from ual import discovery, errors
from ual.errors import (
    DOMAIN,
    DaemonUnreachableError,
    FrameLostError,
    GeofenceError,
    InvalidArgumentError,
    LeaseHeldError,
    LeaseLostError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    TaskAbortedError,
    UalError,
    UalTimeoutError,
    UnauthenticatedError,
    UnknownFrameError,
    WrongStateError,
)

DETAILS_KEY = "grpc-status-details-bin"

_LONGEST_TEXT_BYTES = 1500
"""In bytes. All trailing metadata of a call must fit into 8 KiB, and it contains each message twice."""

_NOT_CONNECTED = (
    "failed to connect to all addresses",
    "connections to all backends failing",
    "errors resolving ",
    "DNS resolution failed",
)

_SIMULATION = "/ual.v1.SimulationService/"
_NOT_SIMULATED = "flies no simulation of UAL, so UAL has neither its safety pilot nor its time and faults"
_GATEWAY = "the gateway "
"""Prefix of each message of the gateway (deploy/gateway)."""
_MOST_NAMES = 6
_RESET = "RST_STREAM"

# What gRPC's messages mean if only one side uses TLS or the certificates do not match. The first one found counts.
_TLS_CAUSES: Mapping[str, str] = {
    "WRONG_VERSION_NUMBER": "it does not use TLS (leave out --tls-ca)",
    "Hostname Verification": "its certificate is for another host name (ual certificates daemon --host)",
    "security handshaker": "a file of --tls-ca, --tls-certificate or --tls-key has no certificate or key of PEM",
    "CERTIFICATE_VERIFY_FAILED": "its certificate is not one that --tls-ca trusts, or is for another host name",
    "handshake failed": "the TLS handshake failed",
    "Socket closed": "it closed the connection; it may use TLS, which needs --tls-ca",
}

_CODES: Mapping[str, grpc.StatusCode] = {
    WrongStateError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    FrameLostError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    InvalidArgumentError.reason: grpc.StatusCode.INVALID_ARGUMENT,
    UnknownFrameError.reason: grpc.StatusCode.INVALID_ARGUMENT,
    GeofenceError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    TaskAbortedError.reason: grpc.StatusCode.ABORTED,
    RejectedByAutopilotError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    LinkLostError.reason: grpc.StatusCode.UNAVAILABLE,
    UalTimeoutError.reason: grpc.StatusCode.DEADLINE_EXCEEDED,
    NotSupportedError.reason: grpc.StatusCode.UNIMPLEMENTED,
    ResourceExhaustedError.reason: grpc.StatusCode.RESOURCE_EXHAUSTED,
    LeaseHeldError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    LeaseLostError.reason: grpc.StatusCode.FAILED_PRECONDITION,
    UnauthenticatedError.reason: grpc.StatusCode.UNAUTHENTICATED,
    PermissionDeniedError.reason: grpc.StatusCode.PERMISSION_DENIED,
}


def status_code(error: UalError) -> grpc.StatusCode:
    """Returns the gRPC status code of an error; INTERNAL if the contract has no such error."""
    return _CODES.get(error.reason, grpc.StatusCode.INTERNAL)


def to_status(error: UalError) -> Status:
    """Converts an error to ``google.rpc.Status``."""
    info = ErrorInfo(reason=error.reason, domain=DOMAIN)
    for key, value in error.metadata.items():
        info.metadata[key] = _clip(value)
    detail = Any()
    detail.Pack(info)
    code: int = status_code(error).value[0]
    return Status(code=code, message=_clip(error.message), details=[detail])


def to_grpc_status(error: UalError) -> grpc.Status:
    """Converts an error to what `ServicerContext.abort_with_status` takes."""
    return cast("grpc.Status", rpc_status.to_status(to_status(error)))


def from_rpc_error(error: grpc.RpcError, *, address: str = "", ns: str = "") -> UalError:
    """Converts the error of a call to the error that the daemon raised or, if the error is gRPC's own, to the error
    that fits its code.

    `address` and `ns` are those of the daemon that was called, for the message.
    """
    info = error_info(cast("Iterable[tuple[str, str | bytes]]", error.trailing_metadata() or ()))
    details = error.details() or ""
    if info is not None:
        return errors.from_reason(info.reason, details, dict(info.metadata))
    code = error.code()
    metadata = {"grpc_code": code.name, "address": address}
    match code:
        case grpc.StatusCode.UNAVAILABLE:
            return unreachable(address, ns, details)
        case grpc.StatusCode.NOT_FOUND if details.startswith(_GATEWAY):
            return unreachable(address, ns, details)
        case grpc.StatusCode.INTERNAL if _RESET in details:  # a proxy whose connection to the daemon was lost
            return unreachable(address, ns, details)
        case grpc.StatusCode.DEADLINE_EXCEEDED:
            return UalTimeoutError("no answer within the time given (timeout_s)", metadata)
        case grpc.StatusCode.UNIMPLEMENTED:
            what = _NOT_SIMULATED if _SIMULATION in details else "does not offer this"
            return NotSupportedError(f"the daemon at {address} {what} ({details})", metadata)
        case grpc.StatusCode.CANCELLED:
            return UalError("the call was cancelled before it ended", metadata)
        case grpc.StatusCode.RESOURCE_EXHAUSTED:
            return ResourceExhaustedError(f"{code.name}: {details}", metadata)
        case grpc.StatusCode.UNAUTHENTICATED:
            return UnauthenticatedError(details, metadata)
        case grpc.StatusCode.PERMISSION_DENIED:
            return PermissionDeniedError(details, metadata)
        case _:
            return UalError(f"{code.name}: {details}", metadata)


def unreachable(address: str, ns: str = "", details: str = "") -> DaemonUnreachableError:
    """Makes the error for a daemon that does not answer: where it was called, why it failed (from gRPC's `details`),
    and what to do.
    """
    metadata = {"address": address, "ns": ns, "details": details}
    if details.startswith(_GATEWAY):
        return DaemonUnreachableError(f"{details} (at {address})", metadata)
    if details and not details.startswith(_NOT_CONNECTED):
        return DaemonUnreachableError(f"the connection to the UAL daemon at {address} was lost ({details})", metadata)
    whom = f"no UAL daemon of {ns} answers" if ns else "no UAL daemon answers"
    for sign, cause in _TLS_CAUSES.items():
        if sign in details:
            return DaemonUnreachableError(f"{whom} at {address}: {cause}", metadata)
    cause = details.rpartition(": ")[2].strip(" []") or "no answer"
    return DaemonUnreachableError(f"{whom} at {address} ({cause}){_others(ns)}: {_remedy(address, ns)}", metadata)


def _remedy(address: str, ns: str) -> str:
    """Returns what to do: where the address is not the one of such a daemon, it was said, and may be a gateway's."""
    if address != discovery.default_address(ns):
        return "see whether the daemon, or the gateway to it, runs there, or say where it is (--address, UAL_ADDRESS)"
    start = f"ual-daemon --ns {ns}" if ns else "ual-daemon"
    return f"start one with `{start}`, or say where it is (--address, UAL_ADDRESS)"


def _others(ns: str) -> str:
    """Names the UAVs that run on this computer, where one that was named does not."""
    names = [each.ns for each in discovery.list_daemons()] if ns else []
    if not names or ns in names:
        return ""
    more = f" and {len(names) - _MOST_NAMES} others" if len(names) > _MOST_NAMES else ""
    return f"; {', '.join(names[:_MOST_NAMES])}{more} {'runs' if len(names) == 1 else 'run'} here"


def was_never_sent(error: DaemonUnreachableError) -> bool:
    """Returns whether no connection was made, so that it is safe to try again."""
    return error.metadata.get("details", "").startswith(_NOT_CONNECTED)


def error_info(trailing: Iterable[tuple[str, str | bytes]]) -> ErrorInfo | None:
    """Returns what the trailing metadata of a call say of its error; None where they say nothing of UAL's."""
    # Not by rpc_status.from_call: it accepts only synchronous calls, and raises if a proxy has changed the code.
    for key, value in trailing:
        if key != DETAILS_KEY or not isinstance(value, bytes):
            continue
        try:
            status = Status.FromString(value)
        except DecodeError:
            return None
        for detail in status.details:
            info = ErrorInfo()
            if detail.Unpack(info) and info.domain == DOMAIN:
                return info
    return None


def _clip(text: str) -> str:
    encoded = text.encode(errors="replace")
    if len(encoded) <= _LONGEST_TEXT_BYTES:
        return encoded.decode()
    return encoded[: _LONGEST_TEXT_BYTES - 3].decode(errors="ignore") + "..."
