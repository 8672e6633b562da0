"""The fence and the rally points of a MAVLink autopilot: what any thread asks for goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

from typing_extensions import override

from ual.errors import RejectedByAutopilotError
from ual.fences.values import FenceZone, RallyPoint
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.fence_items import items_of_rally, items_of_zones, rally_of_items, zones_of_items
from ual_daemon.backends.firmwares.mission_items import (
    FENCE_FIELDS,
    RALLY_FIELDS,
    UNSUPPORTED,
    MissionItem,
    MissionList,
    MissionType,
    difference,
)
from ual_daemon.backends.mavlink.offers.reach import Reach
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.offers.fence import AutopilotFenceStore, FenceSwitch
from ual_daemon.backends.offers.parameters import Refusal

T = TypeVar("T")

_NOTHING = MissionList(())


class MavlinkFenceStore(AutopilotFenceStore):
    """What the autopilot of one backend keeps."""

    def __init__(self, reach: Reach) -> None:
        self._reach = reach

    @property
    @override
    def switches(self) -> tuple[FenceSwitch, ...]:
        session = self._reach.session()
        return () if session is None else session.dialect.fence_switches

    @property
    @override
    def unites_inclusions(self) -> bool:
        session = self._reach.session()
        return session is not None and session.dialect.unites_inclusions(session.telemetry.parameters)

    @override
    def read(self) -> Future[tuple[FenceZone, ...]]:
        return _as(zones_of_items, self._download(MissionType.FENCE))

    @override
    def read_rally(self) -> Future[tuple[RallyPoint, ...]]:
        return _as(rally_of_items, self._download(MissionType.RALLY), otherwise=_none_of_rally)

    @override
    def write(self, zones: Sequence[FenceZone], refusal: Refusal) -> Future[tuple[FenceZone, ...]]:
        items = items_of_zones(zones)
        return _as(zones_of_items, self._replace(MissionType.FENCE, items, refusal, FENCE_FIELDS))

    @override
    def write_rally(self, points: Sequence[RallyPoint], refusal: Refusal) -> Future[tuple[RallyPoint, ...]]:
        items = items_of_rally(points)
        return _as(rally_of_items, self._replace(MissionType.RALLY, items, refusal, RALLY_FIELDS))

    def _download(self, kind: MissionType) -> Future[MissionList]:
        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.download(kind, future)

        return self._reach.give(f"read its {kind.text}", begin)

    def _replace(
        self, kind: MissionType, items: Sequence[MissionItem], refusal: Refusal, fields: Sequence[str]
    ) -> Future[MissionList]:
        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.replace(kind, items, refusal, future, partial(difference, fields=fields))

        return self._reach.give(f"upload its {kind.text}", begin)


def _none_of_rally(error: BaseException) -> MissionList | None:
    """Returns that there are none where the autopilot keeps no such list."""
    is_unsupported = isinstance(error, RejectedByAutopilotError) and error.metadata.get("result") == str(UNSUPPORTED)
    return _NOTHING if is_unsupported else None


def _as(
    convert: Callable[[Sequence[MissionItem]], T],
    found: Future[MissionList],
    otherwise: Callable[[BaseException], MissionList | None] = lambda _: None,
) -> Future[T]:
    """Returns the future of what a list means. Cancelling it cancels that of the list."""
    result: Future[T] = Future()

    def on_found(done: Future[MissionList]) -> None:
        if done.cancelled():
            result.cancel()
            return
        error = done.exception()
        listed = done.result() if error is None else otherwise(error)
        if listed is None:
            assert error is not None
            futures.fail(result, error)
            return
        try:
            meant = convert(listed.items)
        except Exception as failed:  # noqa: BLE001  whatever it is, who waits for the result has to get it
            futures.fail(result, failed)
        else:
            if result.set_running_or_notify_cancel():
                result.set_result(meant)

    result.add_done_callback(lambda ended: found.cancel() if ended.cancelled() else None)
    found.add_done_callback(on_found)
    return result
