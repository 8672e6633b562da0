"""Makes the landing that suits the vehicle: its own, or one by velocities of UAL."""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial

from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.manoeuvres.land import LandManoeuvre, OnHeight, ignore_height
from ual_daemon.flight.manoeuvres.land_on_setpoints import LandOnSetpoints
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre
from ual_daemon.flight.manoeuvres.recover import RecoverFirst
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Reference


class Landings:
    """The landings of one UAV."""

    def __init__(self, backend: Backend, flight: Flight) -> None:
        self._backend = backend
        self._flight = flight

    def here(self, task: VehicleTask, snapshot: Snapshot) -> Handover:
        """Returns the landing at the present position, also out of a mode in which the autopilot flies by itself."""
        is_ours = self._flight.raw_estimate(snapshot).state is State.FLYING_AUTO
        if is_ours:
            return self.after(task, snapshot, self._flight.brake(snapshot))
        return self._recovering(task, snapshot) if self._is_on_setpoints else self._own(task, snapshot, None)

    def after(
        self,
        task: VehicleTask,
        snapshot: Snapshot,
        reference: Reference,
        name: str = "land",
        on_height: OnHeight = ignore_height,
    ) -> Handover:
        """Returns the landing of a UAV that follows a reference."""
        if not self._is_on_setpoints:
            return self._own(task, snapshot, reference, name, on_height)
        has_pilot, disarm = self._flight.has_safety_pilot, self._backend.disarm_landed
        landing = LandOnSetpoints(task, disarm, reference, snapshot, name, on_height, has_safety_pilot=has_pilot)
        return Handover(landing)

    @property
    def _is_on_setpoints(self) -> bool:
        return self._backend.info().flies_landing_on_setpoints

    def _own(
        self,
        task: VehicleTask,
        snapshot: Snapshot,
        reference: Reference | None,
        name: str = "land",
        on_height: OnHeight = ignore_height,
    ) -> Handover:
        command = AutopilotCommand("land")
        has_pilot = self._flight.has_safety_pilot
        send = self._send
        landing = LandManoeuvre(
            task, command, reference, snapshot, name, on_height, has_safety_pilot=has_pilot, send=send
        )
        return Handover(landing, partial(command.send, self._send, snapshot))

    def _send(self) -> Future[None]:
        return self._backend.land(self._flight.limits.get())

    def _recovering(self, task: VehicleTask, snapshot: Snapshot) -> Handover:
        """Takes control back from the autopilot first. A landing ends a flight also where a failsafe holds it."""

        def onward(now: Snapshot) -> Manoeuvre:
            return self.after(task, now, self._flight.brake(now)).manoeuvre

        command = AutopilotCommand("take our references")
        recover = RecoverFirst(task, "land", command, self._backend.take_control, lambda _: None, onward)
        is_open = snapshot.control.held_by is Cause.OPEN
        return Handover(recover) if is_open else Handover(recover, partial(recover.send, snapshot))
