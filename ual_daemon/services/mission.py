"""The missions that the autopilot flies by itself: what may be done and when. The manual is docs/how-to/missions.md."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import SupportsInt

from ual.errors import FrameLostError, UalError, WrongStateError
from ual.missions import checks
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.types import TaskInfo
from ual_daemon import logs, validation
from ual_daemon.backends.chain import then, then_wait
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, OnItsOwn
from ual_daemon.flight.flight import CommandOrigin
from ual_daemon.services.answers import Pause, Steps, in_thread
from ual_daemon.services.vehicle import CommandedVehicle, driver_of, require_change
from ual_daemon.vehicle.upload_journal import MISSION

LOOK = Pause(0.2)
"""Pause between two looks at a watched mission. Autopilots tell it once or twice a second."""
_PLAN, _UPLOAD, _CLEAR, _START = "plan_mission", "upload_mission", "clear_mission", "start_mission"

_log = logging.getLogger(__name__)


class VehicleMission:
    """The missions of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: CommandedVehicle) -> None:
        self._vehicle = vehicle

    @in_thread  # it reads a thousand items
    def plan(self, items: Sequence[Item]) -> Future[MissionPlan]:
        """See `ual.interface.Mission`."""
        self._require_items(self._offer(), items)
        return self._planned(_PLAN, items)

    @in_thread  # it writes a file
    def upload(self, items: Sequence[Item], lease_id: str) -> Future[StoredMission]:
        """See `ual.interface.Mission`."""
        offer = self._offer()
        self._require_change(_UPLOAD, lease_id)
        self._require_items(offer, items)
        self._require_inside(items)
        upload = self._vehicle.uploads.begin(MISSION, len(items))
        undo = partial(self._removal, offer, lease_id) if offer.keeps_parts else None
        sent = list(items)
        uploading = upload.run(partial(offer.upload, sent), partial(self._refusal, _UPLOAD, lease_id), undo)

        def end(kept: KeptMission) -> StoredMission:
            self._vehicle.missions.brought(kept)
            return _noted("mission_uploaded", _numbered(kept, items))

        return then(uploading, end)

    def download(self) -> Future[StoredMission]:
        """See `ual.interface.Mission`."""
        return then(self._offer().download(), _stored)

    @in_thread  # it writes a file
    def clear(self, lease_id: str) -> Future[None]:
        """See `ual.interface.Mission`."""
        offer = self._offer()
        self._require_change(_CLEAR, lease_id)

        def end(kept: KeptMission) -> None:
            self._vehicle.missions.brought(kept)
            _noted("mission_cleared", kept)

        return then(self._removal(offer, lease_id), end)

    def start(self, first_item: SupportsInt, on_link_loss: LinkLossAction | None, lease_id: str) -> Future[TaskInfo]:
        """See `ual.interface.Mission`. Reads the mission first: another station may have changed it.

        That may take long. A command that comes meanwhile counts, and the mission does not begin.
        """
        offer, first = self._offer(), _item(first_item, "first_item")
        require_change(self._vehicle, _START, lease_id)
        self._vehicle.missions.require_whole()
        since, began_in = self._vehicle.commands.last_command, self._vehicle.missions.mode_before_start()

        def on_read(kept: KeptMission) -> Future[TaskInfo]:
            if not kept.items:
                raise WrongStateError(f"{_START}: the autopilot has no mission; upload one", {"needed": _UPLOAD})
            changes_count = self._vehicle.missions.changes_count
            return then_wait(offer.on_its_own(), lambda own: on_known(kept, own, changes_count))

        def on_known(kept: KeptMission, own: OnItsOwn, changes_count: int) -> Future[TaskInfo]:
            _require_link_loss(on_link_loss, own)
            # Not here, on the thread that sends the setpoints.
            check = partial(self._vehicle.missions.check_start, kept, first, own, lease_id, changes_count)
            checking = self._vehicle.missions.plans.begin(_START, check)
            return then(checking, lambda _: begin(kept, own, changes_count))

        def begin(kept: KeptMission, own: OnItsOwn, changes_count: int) -> TaskInfo:
            order = CommandOrigin(lease_id, since)
            return self._vehicle.missions.start(offer, kept, first, own, order, changes_count, began_in).info()

        return then_wait(offer.download(), on_read)

    def pause(self, lease_id: str) -> None:
        """See `ual.interface.Mission`."""
        self._offer()
        self._vehicle.commands.pause(self._vehicle.missions.require_task("pause_mission"), lease_id)

    def resume(self, lease_id: str) -> None:
        """See `ual.interface.Mission`."""
        self._offer()
        self._vehicle.commands.resume(self._vehicle.missions.require_task("resume_mission"), lease_id)

    def jump_to(self, item: SupportsInt, lease_id: str) -> Future[None]:
        """See `ual.interface.Mission`."""
        self._offer()
        return self._vehicle.missions.jump(_item(item, "item"), lease_id)

    def progress(self) -> MissionProgress:
        """See `ual.interface.Mission`."""
        return self._vehicle.missions.progress(self._offer())

    def watch(self) -> Steps[MissionProgress]:
        """See `ual.interface.Mission`."""
        last = None
        while True:
            progress = self.progress()
            if progress != last:
                last = progress
                yield progress
            yield LOOK

    def _removal(self, offer: AutopilotMissions, lease_id: str) -> Future[KeptMission]:
        removal = self._vehicle.uploads.begin(MISSION, 0)
        return removal.run(offer.clear, partial(self._refusal, _CLEAR, lease_id))

    def _require_items(self, offer: AutopilotMissions, items: Sequence[Item]) -> None:
        checks.require(items)
        offer.require(items)

    def _require_inside(self, items: Sequence[Item]) -> None:
        """Checks a mission against the geofence, as far as that is known; its start checks it again."""
        try:
            self._planned(_UPLOAD, items).result()
        except (WrongStateError, FrameLostError) as error:
            logs.event(_log, logging.INFO, "mission_not_planned", why=error.message)

    def _planned(self, command: str, items: Sequence[Item]) -> Future[MissionPlan]:
        missions = self._vehicle.missions
        return missions.plans.begin(command, partial(missions.plan, items))

    def _require_change(self, command: str, lease_id: str) -> None:
        require_change(self._vehicle, command, lease_id)
        self._vehicle.missions.require_none_running(command)

    def _refusal(self, command: str, lease_id: str) -> UalError | None:
        """Returns why nothing may be sent now that changes the mission; None if it may. Asked before each message."""
        self._vehicle.missions.changes_count += 1  # first: a start that begins now either sees it, or is seen
        try:
            self._require_change(command, lease_id)
        except UalError as error:
            return error
        return None

    def _offer(self) -> AutopilotMissions:
        return driver_of(self._vehicle, AutopilotMissions, "missions")  # type: ignore[type-abstract]  # it is only looked for


def _item(value: SupportsInt, field: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise validation.refuse(field, f"{value!r:.40} is no item; they are counted from 1")
    return value


def _require_link_loss(wanted: LinkLossAction | None, own: OnItsOwn) -> None:
    if wanted is not None and wanted is not own.link_loss:
        raise WrongStateError(
            f"{_START}: on_link_loss is {wanted.name}, but {own.link_loss_text}; set these parameters on the ground, "
            "or start it without on_link_loss",
            {"field": "on_link_loss"},
        )


def _numbered(kept: KeptMission, items: Sequence[Item]) -> KeptMission:
    """Returns what was read back, with the numbers of the file from which it was uploaded."""
    pairs = zip(kept.items, items, strict=True)
    return kept._replace(items=tuple(replace(found, number=sent.number) for found, sent in pairs))


def _stored(kept: KeptMission) -> StoredMission:
    return StoredMission(kept.items, kept.digest if kept.items else "")


def _noted(event: str, kept: KeptMission) -> StoredMission:
    logs.event(_log, logging.INFO, event, items=len(kept.items), digest=kept.digest)
    return _stored(kept)
