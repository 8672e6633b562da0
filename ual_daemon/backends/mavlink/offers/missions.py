"""The missions of a MAVLink autopilot: what any thread asks for goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError
from ual.missions.items import MOVING, Item
from ual.missions.plan import MissionStage
from ual.parameters.values import Parameter
from ual.types import GeoPoint
from ual_daemon.backends import chain
from ual_daemon.backends.firmwares.mission_codec import MissionCodec, Place
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, MissionType
from ual_daemon.backends.mavlink.offers.reach import Reach
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.offers.missions import (
    AutopilotMissions,
    KeptMission,
    MissionReport,
    OnItsOwn,
)
from ual_daemon.backends.offers.parameters import Refusal

_STAGES = {each.value: each for each in MissionStage}


class MavlinkMissions(AutopilotMissions):
    """The missions of one backend.

    Args:
        reach: The way to the thread that receives.
        fly: Commands the mode in which the mission is flown.
        here: Returns where the UAV is; None while that is not known.

    """

    def __init__(
        self,
        reach: Reach,
        fly: Callable[[], Future[None]],
        here: Callable[[], GeoPoint | None],
    ) -> None:
        self._reach = reach
        self._fly = fly
        self._here = here

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

    @override
    def require(self, items: Sequence[Item]) -> None:
        self._codec().require(items)

    @override
    def upload(self, items: Sequence[Item], refusal: Refusal) -> Future[KeptMission]:
        codec = self._codec()
        here = self._here()
        encoded = codec.encode(items, None if here is None else Place(here.latitude_deg, here.longitude_deg))
        return self._replace(codec, encoded, refusal)

    @override
    def clear(self, refusal: Refusal) -> Future[KeptMission]:
        return self._replace(self._codec(), [], refusal)

    def _replace(self, codec: MissionCodec, items: Sequence[MissionItem], refusal: Refusal) -> Future[KeptMission]:
        differs: Difference = codec.difference

        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.replace(MissionType.MISSION, items, refusal, future, differs)

        return chain.then(self._reach.give("change its mission", begin), lambda found: _kept(codec, found))

    @override
    def download(self) -> Future[KeptMission]:
        codec = self._codec()

        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.download(MissionType.MISSION, future)

        return chain.then(self._reach.give("read its mission", begin), lambda found: _kept(codec, found))

    @override
    def report(self) -> MissionReport | None:
        session = self._reach.session()
        heard = None if session is None else session.mission_heard
        if session is None or heard is None:
            return None
        codec = session.dialect.missions
        if codec is None:
            return None
        return MissionReport(
            _STAGES.get(heard.state, MissionStage.UNKNOWN),
            _number(codec, heard.seq),
            None if heard.reached is None else _number(codec, heard.reached),
            heard.time_s,
            heard.mission_id,
        )

    @override
    def set_current(self, items: Sequence[Item], item: int, refusal: Refusal, *, anew: bool) -> Future[None]:
        codec = self._codec()
        seq = codec.restart_seq if anew and item == 1 else codec.seq_of(item - 1)
        moving = next((index for index in range(item - 1, len(items)) if isinstance(items[index], MOVING)), item - 1)
        shown_by = frozenset({codec.seq_of(item - 1), codec.seq_of(moving)})
        return self._reach.give(
            "choose an item of its mission",
            lambda protocols, future: protocols.progress.set_current(seq, shown_by, refusal, future),
        )

    @override
    def fly(self) -> Future[None]:
        return self._fly()

    @override
    def on_its_own(self) -> Future[OnItsOwn]:
        codec = self._codec()

        def read(found: tuple[float, ...]) -> Future[OnItsOwn]:
            if len(found) == len(codec.parameters):
                return chain.done(codec.on_its_own(found))
            return chain.then_wait(self._read(codec.parameters[len(found)]), lambda each: read((*found, each.value)))

        return read(())

    def _read(self, name: str) -> Future[Parameter]:
        return self._reach.give(
            "read its parameters", lambda protocols, future: protocols.parameters.read(name, future)
        )

    def _codec(self) -> MissionCodec:
        session = self._reach.session()
        if session is None:
            raise LinkLostError("no autopilot is heard, so it is not known what its missions can have")
        codec = session.dialect.missions
        if codec is None:
            raise NotSupportedError(f"UAL brings no missions to {session.dialect.name}")
        return codec


def _kept(codec: MissionCodec, found: MissionList) -> KeptMission:
    return KeptMission(tuple(codec.decode(found.items)), codec.digest(found.items))


def _number(codec: MissionCodec, seq: int) -> int | None:
    """Returns an item, counted from 1; None for ArduPilot's home, and for no item."""
    index = codec.index_of(seq)
    return index + 1 if index >= 0 else None
