"""What a backend is: the driver of one kind of autopilot. See ``docs/write-a-backend.md``.

A backend does only what its autopilot alone knows: it turns the autopilot's data into snapshots, and sends setpoints
and commands (`ual_daemon.backends.values`). States, validation, tasks and tracking live above it
(`ual_daemon.vehicle.vehicle`), the same for all. Units and axes are converted at this edge and nowhere else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Protocol

from ual.geometry import Vector3
from ual.interface import Simulation
from ual_daemon.backends.values import Freshness, Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import ConfigError


class Clock(Protocol):
    """The time of a backend: wall-clock independent and monotonic; simulated time in a simulation."""

    def now_s(self) -> float: ...


@dataclass(frozen=True, slots=True)
class BackendOptions:
    """What a backend is made from: the namespace, ``--url``, and its own section of the configuration."""

    ns: str
    url: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


UpdateCallback = Callable[[Snapshot], None]


def _always() -> bool:
    return True


class SafetyPilot(Protocol):
    """A simulated safety pilot, so that one person at a desk can fly a simulated vehicle (``--auto-arm``)."""

    def may_arm(self) -> bool:
        """Whether the vehicle is surely simulated, and stands ready to be armed. Raises `PermissionDeniedError` as soon
        as it is known to be a real one, which he must never arm.
        """

    def arm(self) -> None:
        """Arms, and returns when it is armed. Raises an error of `ual.errors` where that is refused."""


class Backend(ABC):
    """The driver of one kind of autopilot.

    Made by `cls(options)`, which raises `ual_daemon.settings.ConfigError` for settings that it cannot take.
    Methods may be called from any thread and never block on the autopilot: commands return a future that ends with
    the autopilot's acknowledgement, or with `RejectedByAutopilotError` in its own words. What the vehicle then really
    does is judged above, from snapshots, never from the acknowledgement; one that is lost just leaves its future open.
    Cancelling the future withdraws the command: what was not sent yet, or would be sent again, is not sent any more.
    """

    name: str
    clock: Clock
    freshness: Freshness = Freshness()

    def __init__(self, options: BackendOptions) -> None:
        self.options = options
        self.is_update_needed: Callable[[], bool] = _always
        """Whether anybody waits for the next update; set by the vehicle above, never waits, and locks nothing.

        While it says no, a backend may leave out updates in which neither armed, landed, mode nor estimator has
        changed, as long as `snapshot` is the newest all the same: one with many vehicles saves most of their cost so.
        """

    @classmethod
    def fleet(
        cls,
        options: Sequence[BackendOptions],  # noqa: ARG003  for those that can
        places: Sequence[Vector3],  # noqa: ARG003
    ) -> list[Backend]:
        """Makes backends that share what they can, for ``--fleet``. `places` are where their vehicles stand from the
        first one, metres east, north, up. Raises `ConfigError` where this backend has no such thing.
        """
        raise ConfigError(f"the {cls.name} backend flies one UAV for each daemon: start a daemon for each", "fleet")

    @abstractmethod
    def open(self, on_update: UpdateCallback) -> None:
        """Begins to connect, and goes on trying; returns at once.

        From now on `on_update` is called, from one thread at a time and with no lock held, at each new pose, and at
        least every 0.1 s of the backend's clock even when nothing comes.
        """

    @abstractmethod
    def close(self) -> None:
        """Ends everything that `open` began; `on_update` is not called any more once it returns."""

    @abstractmethod
    def info(self) -> VehicleInfo:
        """What is known of the vehicle."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """The newest data."""

    @abstractmethod
    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint; it has left when this returns. Not sent while the link is down."""

    @abstractmethod
    def arm(self) -> Future[None]:
        """Arms the motors."""

    @abstractmethod
    def disarm(self) -> Future[None]:
        """Disarms the motors; the autopilot must refuse it in the air."""

    @abstractmethod
    def take_off(self, height_m: float) -> Future[None]:
        """Begins a take-off to a height above the ground; see `VehicleInfo.flies_takeoff_on_setpoints`."""

    @abstractmethod
    def land(self) -> Future[None]:
        """Begins a landing where it is."""

    @abstractmethod
    def take_control(self) -> Future[None]:
        """Makes the autopilot follow our references. Setpoints that hold the pose are being sent meanwhile."""

    @abstractmethod
    def hold(self) -> Future[None]:
        """Makes the autopilot hold its position by itself, without references from us."""

    def safety_pilot(self) -> SafetyPilot | None:
        """A simulated safety pilot, where the vehicle can turn out to be simulated; None where it is surely real."""
        return None

    def simulation(self) -> Simulation | None:
        """The world around a simulated vehicle; None for a real one."""
        return None
