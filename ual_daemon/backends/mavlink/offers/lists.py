"""The lists of a MAVLink autopilot: what any thread requests goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.missions.plan import MissionStage
from ual.types import GeoPoint
from ual_daemon.backends.firmwares.item_lists import ItemLists
from ual_daemon.backends.firmwares.listed_fence import KnownAutopilot, ListedFence
from ual_daemon.backends.firmwares.listed_missions import ListedMissions, MissionAccess, ReceivedMission
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, MissionType
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal

_STAGES = {each.value: each for each in MissionStage}


class MavlinkLists(ItemLists):
    """The lists of one backend."""

    def __init__(self, access: ProtocolAccess) -> None:
        self._access = access

    @override
    def download(self, kind: MissionType) -> Future[MissionList]:
        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.download(kind, future)

        return self._access.run_on_loop(f"read its {kind.text}", begin)

    @override
    def replace(
        self, kind: MissionType, items: Sequence[MissionItem], refusal: Refusal, differs: Difference
    ) -> Future[MissionList]:
        def begin(protocols: Protocols, future: Future[MissionList]) -> None:
            protocols.missions.replace(kind, items, refusal, future, differs)

        return self._access.run_on_loop(f"change its {kind.text}", begin)


def fence_of(access: ProtocolAccess, lists: ItemLists) -> ListedFence:
    """Returns what is offered of the fence."""

    def known() -> KnownAutopilot | None:
        session = access.session()
        return None if session is None else KnownAutopilot(session.dialect, session.telemetry.parameters)

    return ListedFence(lists, known)


def missions_of(
    access: ProtocolAccess,
    lists: ItemLists,
    parameters: AutopilotParameters,
    fly: Callable[[], Future[None]],
    here: Callable[[], GeoPoint | None],
) -> ListedMissions:
    """Returns what is offered of missions. `fly` commands the mode in which one is flown; `here` says where it is."""

    def dialect() -> Dialect | None:
        session = access.session()
        return None if session is None else session.dialect

    def received() -> ReceivedMission | None:
        session = access.session()
        found = None if session is None else session.mission_news
        if found is None:
            return None
        stage = _STAGES.get(found.state, MissionStage.UNKNOWN)
        reached = found.reached, found.reached_s
        return ReceivedMission(stage, found.seq, found.time_s, found.mission_id, *reached, found.changes)

    def choose(seq: int, shown_by: frozenset[int], refusal: Refusal) -> Future[None]:
        def begin(protocols: Protocols, future: Future[None]) -> None:
            protocols.progress.set_current(seq, shown_by, refusal, future)

        return access.run_on_loop("choose an item of its mission", begin)

    return ListedMissions(MissionAccess(lists, dialect, received, choose, fly, parameters.read, here))
