"""The fence and the rally points of an autopilot that keeps them as lists of items."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from typing import NamedTuple

from typing_extensions import override

from ual.errors import RejectedByAutopilotError
from ual.fences.values import FenceZone, RallyPoint
from ual_daemon.backends.chain import caught, done, then
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.fence_items import (
    item_of_return_point,
    items_of_rally,
    items_of_zones,
    rally_of_items,
    return_point_of_items,
    zones_of_items,
)
from ual_daemon.backends.firmwares.item_lists import ItemLists
from ual_daemon.backends.firmwares.mission_items import (
    FENCE_FIELDS,
    RALLY_FIELDS,
    UNSUPPORTED,
    MissionList,
    MissionType,
    difference,
)
from ual_daemon.backends.offers.fence import AutopilotFenceStore, FenceSwitch
from ual_daemon.backends.offers.parameters import Refusal


class KnownAutopilot(NamedTuple):
    """Knowledge about the autopilot: its kind, and the parameters read so far."""

    autopilot: Autopilot
    parameters: Mapping[str, float]


class ListedFence(AutopilotFenceStore):
    """Fence of one autopilot. `known` returns the autopilot and its parameters; None before there was one."""

    def __init__(self, lists: ItemLists, known: Callable[[], KnownAutopilot | None]) -> None:
        self._lists = lists
        self._known = known
        self._return_point: tuple[float, float] | None = None

    @property
    @override
    def switches(self) -> tuple[FenceSwitch, ...]:
        known = self._known()
        return () if known is None else known.autopilot.fence_switches

    @property
    @override
    def unites_inclusions(self) -> bool:
        known = self._known()
        return known is not None and known.autopilot.unites_inclusions(known.parameters)

    @property
    @override
    def keeps_parts(self) -> bool:
        return self._keeps_parts_of(MissionType.FENCE)

    @property
    @override
    def keeps_parts_of_rally(self) -> bool:
        return self._keeps_parts_of(MissionType.RALLY)

    @property
    @override
    def return_point(self) -> tuple[float, float] | None:
        return self._return_point

    @override
    def read(self) -> Future[tuple[FenceZone, ...]]:
        return then(self._lists.download(MissionType.FENCE), self._zones)

    @override
    def read_rally(self) -> Future[tuple[RallyPoint, ...]]:
        return then(caught(self._lists.download(MissionType.RALLY), _none_of_rally), _rally)

    @override
    def write(self, zones: Sequence[FenceZone], refusal: Refusal) -> Future[tuple[FenceZone, ...]]:
        differs = partial(difference, fields=FENCE_FIELDS)
        items, kept = items_of_zones(zones), self._return_point
        if zones and kept is not None:
            items.insert(0, item_of_return_point(kept))
        return then(self._lists.replace(MissionType.FENCE, items, refusal, differs), self._zones)

    @override
    def write_rally(self, points: Sequence[RallyPoint], refusal: Refusal) -> Future[tuple[RallyPoint, ...]]:
        differs = partial(difference, fields=RALLY_FIELDS)
        return then(self._lists.replace(MissionType.RALLY, items_of_rally(points), refusal, differs), _rally)

    def _keeps_parts_of(self, kind: MissionType) -> bool:
        known = self._known()
        return known is None or kind in known.autopilot.keeps_parts_of

    def _zones(self, found: MissionList) -> tuple[FenceZone, ...]:
        self._return_point = return_point_of_items(found.items)
        return zones_of_items(found.items)


def _rally(found: MissionList) -> tuple[RallyPoint, ...]:
    return rally_of_items(found.items)


def _none_of_rally(error: BaseException) -> Future[MissionList]:
    """There are none where the autopilot keeps no such list."""
    if isinstance(error, RejectedByAutopilotError) and error.metadata.get("result") == str(UNSUPPORTED):
        return done(MissionList(()))
    raise error
