"""The base class of backends. A backend is the driver of one kind of autopilot. See ``docs/how-to/write-a-backend.md``.

A backend does only what depends on its autopilot: it converts the autopilot's data to snapshots, and sends setpoints
and commands (`ual_daemon.backends.values`). States, validation, tasks and tracking are above it
(`ual_daemon.vehicle.vehicle`) and the same for all backends. Only backends convert units and axes.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.geometry import Vector3
from ual.interface import Simulation
from ual.types import Limits
from ual_daemon.backends.payload import Payload
from ual_daemon.backends.values import ExternalPose, Freshness, LinkReport, Packet, Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import ConfigError

T = TypeVar("T")


class Clock(Protocol):
    """The time of a backend: monotonic and independent of the wall clock; simulated time in a simulation."""

    def now_s(self) -> float:
        """Returns the present time in seconds. Where it starts from does not matter."""
        ...


@dataclass(frozen=True, slots=True)
class BackendOptions:
    """The arguments of a backend: the namespace, ``--url``, and the backend's section of the configuration."""

    ns: str
    url: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


UpdateCallback = Callable[[Snapshot], None]


def _always() -> bool:
    return True


class SafetyPilot(Protocol):
    """A simulated safety pilot, so that one person at a desk can fly a simulated vehicle (``--auto-arm``)."""

    def may_arm(self) -> bool:
        """Returns whether the vehicle is known to be simulated, and is ready to be armed.

        Raises:
            PermissionDeniedError: The vehicle is a real one, which a simulated pilot must never arm.
        """

    def arm(self) -> None:
        """Arms, and blocks until the vehicle is armed.

        Raises:
            UalError: The autopilot refused.
        """


class SimulatedPilot(SafetyPilot):
    """The pilot of a vehicle that is surely simulated: `may_arm` says whether it is ready, `arm` arms it."""

    def __init__(self, may_arm: Callable[[], bool], arm: Callable[[], None]) -> None:
        self._may_arm = may_arm
        self._arm = arm

    @override
    def may_arm(self) -> bool:
        return self._may_arm()

    @override
    def arm(self) -> None:
        self._arm()


class Backend(ABC):
    """The driver of one kind of autopilot.

    `cls(options)` raises `ual_daemon.settings.ConfigError` for settings that are not valid. Methods may be called from
    any thread and never wait for the autopilot. Commands return a future, which ends with the autopilot's
    acknowledgement, or with a `RejectedByAutopilotError` that quotes the autopilot. The layers above judge what the
    vehicle really does from snapshots, never from the acknowledgement; if an acknowledgement is lost, its future stays
    open. Cancelling the future withdraws the command: it is not sent any more, neither first nor again.
    """

    name: str
    clock: Clock
    freshness: Freshness = Freshness()
    outlived: bool = False
    """Whether its vehicles live on without it, and report their identity (`VehicleInfo.identity`): home is then kept
    for the next daemon. A simulation's world ends with it.
    """

    has_packets: bool = False
    """Whether it calls `on_packet`."""

    def __init__(self, options: BackendOptions) -> None:
        self.options = options
        self.is_update_needed: Callable[[], bool] = _always
        """Whether anybody waits for the next update. Set by the vehicle above; never blocks and takes no lock.

        While it returns False, a backend may leave out updates in which armed, landed, mode and estimator have not
        changed. `snapshot` must return the newest data all the same. This saves a backend with many vehicles most of
        their cost.
        """
        self.is_watch_only = False
        """Whether nothing may be sent that flies, or changes how it flies (``--watch-only``). Set by the vehicle above,
        before `open`; commands do not come then.
        """
        self.on_packet: Callable[[Packet], None] | None = None
        """Called with each packet of the link, from any thread, by backends that have one that can be recorded. Set
        before `open`; never blocks.
        """

    @classmethod
    def fleet(
        cls,
        options: Sequence[BackendOptions],  # noqa: ARG003  for backends that override this
        places: Sequence[Vector3],  # noqa: ARG003
        first: int = 0,  # noqa: ARG003
    ) -> list[Backend]:
        """Makes backends that share one simulation (``--fleet``) or one link (``--fleet-url``), in one process.

        `first` is how many UAVs of a simulated fleet come before these: other processes fly them (``--workers``).
        `places` are where simulated vehicles stand, relative to the first one, in metres east, north, up. Vehicles with
        a URL (`BackendOptions.url`) stand where they stand; no two URLs have the same `vehicle_key`.

        Raises:
            ConfigError: This backend cannot fly a fleet, or a setting is not valid.
        """
        raise ConfigError(f"the {cls.name} backend flies only one UAV: start a daemon for each UAV", "fleet")

    @classmethod
    def vehicle_key(cls, url: str) -> str:
        """Returns a text that is the same for all URLs that lead to one vehicle, so that no fleet flies it twice."""
        return url

    @classmethod
    def vehicle_urls(cls, url: str) -> list[str]:
        """Returns a URL for each vehicle that a ``--fleet-url`` leads to: several may be behind one link.

        Raises:
            ConfigError: The URL is not valid.
        """
        return [url]

    @abstractmethod
    def open(self, on_update: UpdateCallback) -> None:
        """Begins to connect, and keeps trying; returns at once.

        From now on calls `on_update` with each new pose, and at least every 0.1 s of the backend's clock even if
        nothing arrives. Calls it from one thread at a time and without holding a lock.
        """

    @abstractmethod
    def close(self) -> None:
        """Ends everything that `open` began, and with an error each future that is open (`futures.OpenFutures`).

        Once it has returned, `on_update` is not called any more, and futures that are given end at once.
        """

    @abstractmethod
    def info(self) -> VehicleInfo:
        """Returns what is known of the vehicle."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """Returns the newest data."""

    def newest(self) -> tuple[Snapshot, float]:
        """Returns the newest data as they were published, and the time now: what `snapshot` makes one of.

        A backend whose updates share their values overrides it: each setpoint of a stream asks.
        """
        snapshot = self.snapshot()
        return snapshot, snapshot.time_s

    @abstractmethod
    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint, before it returns. Drops the setpoint while the link is down.

        Where sending blocks (a call that waits for an answer, a bridge), hand it to a `mailbox.SetpointMailbox`.
        """

    @abstractmethod
    def arm(self) -> Future[None]:
        """Arms the motors. A mode in which that starts a flight (`Mode.on_arming`) is left first, or it is refused."""

    @abstractmethod
    def disarm(self) -> Future[None]:
        """Disarms the motors; the autopilot must refuse it in the air."""

    @abstractmethod
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        """Begins a take-off to a height above the ground; see `VehicleInfo.flies_takeoff_on_setpoints`.

        An autopilot that climbs by itself keeps to the climb speed of the limits in force, or climbs only a little by
        itself. The setpoints of UAL fly the rest of the way as soon as it reports that it is up.
        """

    @abstractmethod
    def land(self, limits: Limits) -> Future[None]:
        """Begins a landing at the present position, with the descent speed of the limits in force at most, where the
        autopilot's own landing takes a speed. Not called where `VehicleInfo.flies_landing_on_setpoints`.
        """

    @abstractmethod
    def take_control(self) -> Future[None]:
        """Makes the autopilot follow the daemon's setpoints. The caller keeps sending setpoints that hold the pose."""

    @abstractmethod
    def hold(self) -> Future[None]:
        """Makes the autopilot hold its position by itself, without setpoints."""

    def disarm_landed(self) -> Future[None]:
        """Stops the motors after a landing that UAL flew (`VehicleInfo.flies_landing_on_setpoints`).

        The safety pilot may have taken over on the ground: control is never taken for it, and others' motors are not
        stopped.
        """
        return self.disarm()

    def set_external_pose(self, measured: ExternalPose) -> None:
        """Gives the autopilot's estimator a pose from outside, before it returns. Drops it while the link is down.

        Only called if `VehicleInfo.capabilities` has EXTERNAL_POSE. Poses come as fast as their source measures,
        usually 30 to 200 a second, from any thread. They may come before the autopilot has a position.
        """
        raise NotSupportedError(f"the {self.name} backend takes no poses from outside")

    def request_home(self) -> None:  # noqa: B027  most backends hear it all the time, or have none
        """Asks the autopilot where its home is, because a command that begins relies on it. Returns at once.

        What comes then shows in snapshots, and the motion is fitted to it.
        """

    def estimate_jumped(self, offset: Vector3) -> None:  # noqa: B027  most backends keep no places
        """Notes that the autopilot's estimate of the position has jumped, in metres along the local axes.

        Either the local frame has moved in the world, or the estimate was wrong before. A backend that keeps places in
        the local frame (the ground) must not trust them any more. Called inside `on_update`, with no lock held; never
        blocks.
        """

    def utc_s(self) -> float:
        """Returns the present time as UTC since 1970, by which stamps from outside are assessed.

        In a simulation, it is the simulated time from which `MotionState.stamp_s` is made.
        """
        return time.time()

    def link(self) -> LinkReport:
        """Returns how the link to the autopilot has been of late, for monitoring (``--metrics``)."""
        return LinkReport()

    def safety_pilot(self) -> SafetyPilot | None:
        """Returns a simulated safety pilot if the vehicle is or may be simulated; None if it is known to be real."""
        return None

    def payload(self) -> Payload | None:
        """Returns what extensions may read and send through it; None if it offers nothing for them."""
        return None

    def offer(self, kind: type[T]) -> T | None:
        """Returns what it offers of a kind, for a service that is shipped with the daemon; None if it does not.

        The kinds are interfaces of their own, such as `ual_daemon.backends.offers.parameters.AutopilotParameters`.
        """
        return None

    def simulation(self) -> Simulation | None:
        """Returns the world around a simulated vehicle; None for a real one."""
        return None
