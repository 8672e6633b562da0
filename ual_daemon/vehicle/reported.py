"""Reports of a UAV, flown by a backend or played from a recording: its samples, states and frames."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from ual.geometry import Pose, PoseStamped, Transform
from ual.types import Frame, State, Telemetry
from ual_daemon import logs, validation
from ual_daemon.backends.base import Clock
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import Estimate
from ual_daemon.frames.kept_file import KeptFile
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.vehicle.figures import VehicleFigures
from ual_daemon.vehicle.frame_editor import FrameEditor
from ual_daemon.vehicle.listeners import Listeners

_log = logging.getLogger(__name__)


class _Subscriber(NamedTuple):
    """See `ReportedVehicle.subscribe`."""

    callback: Callable[[Telemetry], None]
    is_due: Callable[[], bool]
    reads_all: bool


class ReportedVehicle(ABC):
    """A UAV that publishes a sample and its state at each update. Any thread may call any member."""

    def __init__(self, ns: str, backend_name: str, clock: Clock, resolver: FrameResolver) -> None:
        self.ns = ns
        self.backend_name = backend_name
        self.clock = clock
        self.log_name = ""
        """The name of this UAV in the log, if there are several in the process."""
        self.daemon_checks: tuple[str, ...] = ()
        """The checks of this daemon that fail, as health tells them: `ual_daemon.program.checks`."""
        self.kept_files: tuple[KeptFile, ...] = ()
        """The files for the next start of the daemon, to be kept by `KeptFile.keep`."""
        self.frame_editor = FrameEditor(resolver, clock)
        """Adds and removes frames."""
        self._resolver = resolver
        self._subscribers: Listeners[_Subscriber] = Listeners()
        self._state_listeners: Listeners[Callable[[State], None]] = Listeners()
        self._sequence = 0
        self._last_state: State | None = None
        self._watchers = ErrorBarrier("a watcher of a UAV")

    # --- What is reported now -----------------------------------------------------------------------------------------

    @abstractmethod
    def _snapshot(self) -> Snapshot:
        """Returns the newest data."""

    @abstractmethod
    def _estimate(self, snapshot: Snapshot) -> Estimate:
        """Estimates the state from data."""

    @abstractmethod
    def _sample(self, snapshot: Snapshot, found: Estimate, *, is_late: bool = False) -> Telemetry:
        """Makes a sample of data and the state that they show; see `make_telemetry`."""

    def state(self) -> State:
        """Returns the state, estimated now."""
        return self._estimate(self._snapshot()).state

    def in_odom(self, local: Pose, boots_count: int) -> PoseStamped | None:
        """Returns a pose of the backend's local frame in ``<ns>/odom``; None where that is not known any more.

        `boots_count` is that of the snapshot from which the pose is (`LinkState.boots_count`).
        """
        if self._resolver.odom_loss is not None or self._snapshot().link.boots_count != boots_count:
            return None
        return PoseStamped(self._resolver.to_odom(local), self._resolver.tree.odom)

    def figures(self) -> VehicleFigures:
        """Returns what is measured of it, as it is now."""
        snapshot = self._snapshot()
        found = self._estimate(snapshot)
        return VehicleFigures(found.state, found.is_link_up, snapshot)

    def telemetry(self) -> Telemetry:
        """Returns the newest sample of everything known."""
        snapshot = self._snapshot()
        return self._sample(snapshot, self._estimate(snapshot))

    def transform(self, target_frame_id: str = "", source_frame_id: str = "") -> Transform:
        """Returns the transform from the source frame (default: the body) to the target frame (default: ``map``).

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known yet where a frame is.
            FrameLostError: It is not known any more.

        """
        validation.require_type(target_frame_id, str, "target_frame_id")
        validation.require_type(source_frame_id, str, "source_frame_id")
        snapshot = self._snapshot()
        return replace(
            self._resolver.transform(target_frame_id, source_frame_id, snapshot), stamp_s=snapshot.motion.stamp_s
        )

    def frames(self) -> list[Frame]:
        """Returns all frames."""
        return self._resolver.tree.frames(self._resolver.body(self._snapshot()))

    def doing(self) -> dict[str, object]:
        """Returns what the UAV is doing, as the fields of an event of the log: for an end that leaves it in motion."""
        sample = self.telemetry()
        fields: dict[str, object] = {"state": sample.state.name}
        task = sample.task
        if task is not None:
            fields |= {"task": task.kind.name.lower(), "progress": round(task.progress or 0.0, 2)}
        if sample.pose is not None:
            p = sample.pose.position
            fields["position"] = f"{p.x:.1f}, {p.y:.1f}, {p.z:.1f} in {sample.frame_id}"
        if sample.velocity is not None:
            fields["speed_m_s"] = round(sample.velocity.linear.norm(), 1)
        return fields

    # --- Subscriptions ------------------------------------------------------------------------------------------------

    def subscribe(
        self,
        callback: Callable[[Telemetry], None],
        is_due: Callable[[], bool] = lambda: True,
        *,
        reads_all: bool = True,
    ) -> Callable[[], None]:
        """Calls back at each update for which `is_due` returns True. Returns the function that ends it.

        Both run on the update thread and must not block. A sample is made only if it is due for a subscriber. Where it
        is due only for those that do not read all of it, a part of it is made when it is read.
        """
        return self._subscribers.add(_Subscriber(callback, is_due, reads_all))

    def listen_to_state(self, callback: Callable[[State], None]) -> Callable[[], None]:
        """Calls back with the new state whenever it has changed. Returns the function that ends it.

        The callback runs on the update thread, before the sample that shows the state, and must not block.
        """
        return self._state_listeners.add(callback)

    def _is_sample_due(self) -> bool:
        return any(each.is_due() for each in self._subscribers)

    # --- Updates ------------------------------------------------------------------------------------------------------

    @abstractmethod
    def _update(self, snapshot: Snapshot) -> None:
        """Makes one update, and publishes it."""

    def _on_update(self, snapshot: Snapshot) -> None:
        """Makes one update, on the update thread. An error must not end the thread, which may fly the UAV."""
        if self.log_name:
            logs.uav.set(self.log_name)
        try:
            self._update(snapshot)
        except Exception:  # noqa: BLE001  logged; the next update goes on
            _log.exception("an update failed; this is a defect of UAL, please report it")

    def _publish(self, snapshot: Snapshot, found: Estimate) -> None:
        """Publishes an update: its state where that has changed, and its sample where one is due."""
        if found.state is not self._last_state:
            self._publish_state(found)
        due, is_late = [], True
        for subscriber in self._subscribers.all:
            if subscriber.is_due():
                due.append(subscriber)
                is_late = is_late and not subscriber.reads_all
        if due:
            sample = self._sample(snapshot, found, is_late=is_late)
            for subscriber in due:
                self._watchers.call(subscriber.callback, sample)

    def _publish_state(self, found: Estimate) -> None:
        last, self._last_state = self._last_state, found.state
        level = logging.WARNING if found.state in (State.UNINITIALIZED, State.FLYING_MANUAL) else logging.INFO
        old = None if last is None else last.name
        logs.event(_log, level, "state", old=old, new=found.state.name, why=found.why)
        for listener in self._state_listeners:
            self._watchers.call(listener, found.state)
