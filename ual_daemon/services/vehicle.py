"""Interface of a UAV for services, and the checks that are the same for all of them."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Protocol, TypeVar

from ual.errors import LinkLostError, NotSupportedError, UalError, UalTimeoutError, WrongStateError
from ual.geometry import Pose, PoseStamped, Transform
from ual.types import State
from ual_daemon.backends import futures
from ual_daemon.flight.refusals import only_watching
from ual_daemon.vehicle.commands import Commands
from ual_daemon.vehicle.gimbals import UavGimbals
from ual_daemon.vehicle.missions import Missions
from ual_daemon.vehicle.upload_journal import UploadJournal

T = TypeVar("T")


class ServedVehicle(Protocol):
    """A UAV, or a recording that plays as one; see `ual_daemon.choice`."""

    @property
    def ns(self) -> str:
        """Its namespace."""

    @property
    def backend_name(self) -> str:
        """The name of its backend."""

    @property
    def is_watch_only(self) -> bool:
        """Whether it is only watched."""

    def state(self) -> State:
        """Its state."""

    def offer(self, kind: type[T]) -> T | None:
        """See `ual_daemon.backends.base.Backend.offer`."""

    def is_armed(self) -> bool | None:
        """Returns whether it is armed; None while that is not known."""

    def require_lease(self, command: str, lease_id: str) -> None:
        """Raises `LeaseHeldError` or `LeaseLostError`, or returns."""


class LoadedVehicle(ServedVehicle, Protocol):
    """One to whose autopilot lists are uploaded."""

    @property
    def uploads(self) -> UploadJournal:
        """The uploads that were begun, and not finished; raises `NotSupportedError` where there can be none."""


class LocatedVehicle(ServedVehicle, Protocol):
    """One that knows how the backend's local frame lies to its own frames."""

    def in_odom(self, local: Pose, boots_count: int) -> PoseStamped | None:
        """Returns a pose of the backend's local frame in ``<ns>/odom``; None where that is not known any more."""


class GimbalVehicle(ServedVehicle, Protocol):
    """One that knows its frames, and what its gimbals do."""

    @property
    def gimbals(self) -> UavGimbals:
        """Gimbals of the UAV; raises `NotSupportedError` where there can be none."""

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns the transform from the source frame to the target frame."""


class CommandedVehicle(LoadedVehicle, Protocol):
    """One that may be flown, as far as its members say."""

    @property
    def commands(self) -> Commands:
        """Its commands; raises `NotSupportedError` where it has none."""

    @property
    def missions(self) -> Missions:
        """Missions of the autopilot; raises `NotSupportedError` where it cannot be commanded."""


def driver_of(vehicle: ServedVehicle, kind: type[T], what: str) -> T:
    """Returns what the backend offers.

    Raises:
        NotSupportedError: It does not offer that.

    """
    found = vehicle.offer(kind)
    if found is None:
        text = f"{what}: the backend {vehicle.backend_name} of {vehicle.ns} does not offer them"
        raise NotSupportedError(text, {"backend": vehicle.backend_name})
    return found


def require_change(vehicle: ServedVehicle, command: str, lease_id: str) -> None:
    """Checks that a caller may change something of the autopilot.

    Raises:
        PermissionDeniedError: The daemon only watches.
        LeaseHeldError: Another program holds the lease.
        LeaseLostError: The caller's lease has ended.

    """
    require_not_watching(vehicle, command)
    vehicle.require_lease(command, lease_id)


def require_not_watching(vehicle: ServedVehicle, command: str) -> None:
    """Checks that anything may be sent.

    Raises:
        PermissionDeniedError: The daemon only watches.

    """
    if vehicle.is_watch_only:
        raise only_watching(command)


def require_disarmed(vehicle: ServedVehicle, command: str, what_then: str) -> None:
    """Checks that the UAV is known to be disarmed. `what_then` says what to do.

    Raises:
        LinkLostError: Nothing is received that says so.
        WrongStateError: It is armed.

    """
    is_armed = vehicle.is_armed()
    if is_armed is False:
        return
    metadata = {"state": vehicle.state().name, "needed": State.LANDED_DISARMED.name}
    if is_armed is None:
        why = "the autopilot is not heard to say whether the UAV is armed"
        raise LinkLostError(f"{command}: {why}; it must be disarmed", metadata)
    raise WrongStateError(f"{command}: the UAV is armed; {what_then}", metadata)


def wait(future: Future[T], limit_s: float, what: str) -> T:
    """Waits for a result, in the class.

    Raises:
        UalTimeoutError: It was not there in time.
        UalError: As the future ends, or the backend has withdrawn it.

    """
    return futures.wait(future, limit_s, late(what, limit_s).message, withdrawn(what).message)


def withdrawn(what: str) -> UalError:
    """Returns that the backend has cancelled something."""
    return UalError(f"{what} was withdrawn by the backend")


def late(what: str, limit_s: float) -> UalTimeoutError:
    """Returns that something has not ended in time."""
    return UalTimeoutError(f"{what} did not end within {limit_s:g} s")
