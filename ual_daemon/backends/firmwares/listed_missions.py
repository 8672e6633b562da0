"""The missions of an autopilot that keeps them as lists of items, by its codec."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError
from ual.missions.items import MOVING, Item
from ual.missions.plan import MissionStage
from ual.parameters.values import Parameter
from ual.types import GeoPoint
from ual_daemon.backends import chain
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.item_lists import ItemLists
from ual_daemon.backends.firmwares.mission_codec import GeoPosition, MissionCodec
from ual_daemon.backends.firmwares.mission_items import MissionItem, MissionList, MissionType
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport, OnItsOwn
from ual_daemon.backends.offers.parameters import Refusal


class ReceivedMission(NamedTuple):
    """The newest of what the autopilot has reported of its mission, with its own numbers of the items."""

    stage: MissionStage
    seq: int
    time_s: float
    mission_id: int = 0
    reached: int | None = None
    reached_s: float = -math.inf
    """Time of that report."""
    changes: tuple[int, ...] = ()
    """See `MissionReport.changes`."""


class MissionAccess(NamedTuple):
    """The way to the missions of one autopilot.

    Attributes:
        lists: Transfers the mission.
        autopilot: Returns the kind of the autopilot; None before there was one.
        heard: Returns the newest report; None while that is nothing.
        choose: Makes the item of a number the current one, which one of some numbers then shows.
        fly: Commands the mode in which the mission is flown.
        read_parameter: Reads a parameter.
        here: Returns where the UAV is; None while that is not known.

    """

    lists: ItemLists
    autopilot: Callable[[], Autopilot | None]
    heard: Callable[[], ReceivedMission | None]
    choose: Callable[[int, frozenset[int], Refusal], Future[None]]
    fly: Callable[[], Future[None]]
    read_parameter: Callable[[str], Future[Parameter]]
    here: Callable[[], GeoPoint | None]


class ListedMissions(AutopilotMissions):
    """The missions of one backend."""

    def __init__(self, access: MissionAccess) -> None:
        self._access = access

    @property
    @override
    def mode(self) -> str:
        return self._codec().mode

    @property
    @override
    def return_mode(self) -> str:
        return self._codec().return_mode

    @property
    @override
    def pause_mode(self) -> str:
        return self._codec().pause_mode

    @property
    @override
    def done_mode(self) -> str:
        return self._codec().done_mode

    @property
    @override
    def keeps_parts(self) -> bool:
        autopilot = self._access.autopilot()
        return autopilot is None or MissionType.MISSION in autopilot.keeps_parts_of

    @override
    def require(self, items: Sequence[Item]) -> None:
        self._codec().require(items)

    @override
    def upload(self, items: Sequence[Item], refusal: Refusal) -> Future[KeptMission]:
        codec, here = self._codec(), self._access.here()
        encoded = codec.encode(items, None if here is None else GeoPosition(here.latitude_deg, here.longitude_deg))
        return self._replace(codec, encoded, refusal)

    @override
    def clear(self, refusal: Refusal) -> Future[KeptMission]:
        return self._replace(self._codec(), [], refusal)

    def _replace(self, codec: MissionCodec, items: Sequence[MissionItem], refusal: Refusal) -> Future[KeptMission]:
        kept = self._access.lists.replace(MissionType.MISSION, items, refusal, codec.difference)
        return chain.then(kept, lambda found: _kept(codec, found))

    @override
    def download(self) -> Future[KeptMission]:
        codec = self._codec()
        return chain.then(self._access.lists.download(MissionType.MISSION), lambda found: _kept(codec, found))

    @override
    def report(self) -> MissionReport | None:
        heard, autopilot = self._access.heard(), self._access.autopilot()
        codec = None if autopilot is None else autopilot.missions
        if heard is None or codec is None:
            return None
        reached = None if heard.reached is None else _number(codec, heard.reached)
        item = _number(codec, heard.seq)
        return MissionReport(heard.stage, item, reached, heard.time_s, heard.mission_id, heard.reached_s, heard.changes)

    @override
    def set_current(self, items: Sequence[Item], item: int, refusal: Refusal, *, anew: bool) -> Future[None]:
        codec = self._codec()
        seq = codec.restart_seq if anew and item == 1 else codec.seq_of(item - 1)
        moving = next((index for index in range(item - 1, len(items)) if isinstance(items[index], MOVING)), item - 1)
        return self._access.choose(seq, frozenset({codec.seq_of(item - 1), codec.seq_of(moving)}), refusal)

    @override
    def fly(self) -> Future[None]:
        return self._access.fly()

    @override
    def on_its_own(self) -> Future[OnItsOwn]:
        codec = self._codec()

        def read(found: tuple[float, ...]) -> Future[OnItsOwn]:
            if len(found) == len(codec.parameters):
                return chain.done(codec.on_its_own(found))
            parameter = self._access.read_parameter(codec.parameters[len(found)])
            return chain.then_wait(parameter, lambda each: read((*found, each.value)))

        return read(())

    def _codec(self) -> MissionCodec:
        autopilot = self._access.autopilot()
        if autopilot is None:
            raise LinkLostError("no autopilot is heard, so it is not known what its missions can have")
        if autopilot.missions is None:
            raise NotSupportedError(f"UAL brings no missions to {autopilot.name}")
        return autopilot.missions


def _kept(codec: MissionCodec, found: MissionList) -> KeptMission:
    return KeptMission(tuple(codec.decode(found.items)), codec.digest(found.items), found.opaque_id)


def _number(codec: MissionCodec, seq: int) -> int | None:
    """Returns an item, counted from 1; None for ArduPilot's home, and for no item."""
    index = codec.index_of(seq)
    return index + 1 if index >= 0 else None
