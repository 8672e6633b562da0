"""The UAVs of the page: those of this computer and those at given addresses, each with its connection."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from ual import Uav
from ual.discovery import Registration
from ual.errors import UalError
from ual.interface import Lease
from ual.shared import guard
from ual.shared.ages import without_seconds
from ual.types import Frame, Geofence, Info, Route, TaskStatus, Telemetry
from ual_tools.network.feed import Feed, feeding
from ual_tools.output import error_text
from ual_tools.selection import chosen_daemons
from ual_tools.session import CommandSession
from ual_tools.view.carried import PayloadBoard
from ual_tools.view.journal import Journal
from ual_tools.view.taken import Taken
from ual_tools.watch_board import Board
from ual_tools.watch_roster import WatchRoster, kept_up_to_date

if TYPE_CHECKING:
    from ual.network import Network

T = TypeVar("T")

TELEMETRY_RATE_HZ = 10.0
_GONE_UAV_S = 600.0
"""A UAV whose daemon has ended stays on the page for this time: it may still be in the air."""
_ROUTE_CHECK_S = 0.5
_FENCE_S = 2.0
_RETRY_S = 1.0
_LOST_UAV_S = 1.5
"""So that the page greys a UAV within 2 s of its last sample."""


@dataclass
class PageMember:
    """Knowledge about one UAV apart from its telemetry.

    `frames`, `fence` and `route` are None where they are not known now, `route` also where no way is flown.
    """

    uav: Uav
    info: Info
    frames: Sequence[Frame] | None = None
    running: dict[str, None] = field(default_factory=dict)
    """The identifiers of the tasks whose end is still to be written down."""
    fence: Geofence | None = None
    fence_due_s: float = 0.0
    route: Route | None = None
    route_due_s: float = 0.0
    taken: Taken = field(default_factory=Taken)
    """Pictures that its cameras have taken."""
    carried: PayloadBoard = field(default_factory=PayloadBoard)
    """Grippers, winches, servos and relays, while a page shows them."""
    lease: Lease | None = None
    """Lease that the pages hold."""


class PageFleet:
    """All UAVs of the page.

    Args:
        session: The options of the command.
        addresses: Of daemons that are not on this computer, or not to be found there.
        journal: Gets how tasks ended, and what cannot be reached.

    """

    def __init__(self, session: CommandSession, addresses: Sequence[str], journal: Journal) -> None:
        self.board = Board([], TELEMETRY_RATE_HZ, _GONE_UAV_S)
        self.board.lost_after_s = _LOST_UAV_S
        self.wants_frames = False
        """Whether anybody looks at the frames."""
        self.wants_pictures = False
        """Whether anybody wants the last picture of each UAV to be fetched."""
        self.wants_gimbals = False
        """Whether anybody wants to see where the gimbals look."""
        self.wants_carried: frozenset[str] = frozenset()
        """The UAVs of which anybody sees what they carry."""
        self._session = session
        self._journal = journal
        self._named = [Named(address, session, self._say) for address in addresses]
        self._members: dict[str, PageMember] = {}
        self._roster = WatchRoster(session, self.board, TELEMETRY_RATE_HZ, self._say, self._choose, self._attend)

    @contextmanager
    def running_on(self, network: Network) -> Iterator[None]:
        """Shows what the UAVs of a network tell while the block runs. Nothing is asked of their daemons."""
        with feeding(Feed(network, self.board, self._say)):
            yield

    @contextmanager
    def running(self) -> Iterator[None]:
        """Keeps the fleet up to date while the block runs."""
        for each in self._named:
            each.start()
        try:
            with kept_up_to_date(self._roster):
                yield
        finally:
            for each in self._named:
                each.is_closed.set()

    def members(self) -> Mapping[str, PageMember]:
        """Returns the UAVs that are connected."""
        return dict(self._members)

    def _choose(self) -> list[Registration]:
        """Returns the daemons of this computer, and those at the addresses whose names are known.

        One name is one UAV: the first that has it.
        """
        wanted = self._session.ns.split(",") if self._session.ns else None
        found = {each.ns: each for each in chosen_daemons(self._session) if wanted is None or each.ns in wanted}
        for named in self._named:
            if named.found is not None and found.setdefault(named.found.ns, named.found).address != named.address:
                named.refuse(f"not shown, because another UAV has its name, {named.found.ns}")
        return list(found.values())

    def _say(self, text: str) -> None:
        self._journal.write("ual view", text.removeprefix("ual: "), time.time())

    def _attend(self, ns: str, uav: Uav, is_ended: threading.Event) -> None:
        member = self._members[ns] = PageMember(uav, uav.info())
        try:
            while not is_ended.wait(_ROUTE_CHECK_S):
                self._poll(ns, member)
        finally:
            if self._members.get(ns) is member:  # else it was connected to again
                self._members.pop(ns)

    def _poll(self, ns: str, member: PageMember) -> None:
        """Asks for what the telemetry does not have. What is not answered is not known."""
        watched = self.board.watched_uavs().get(ns)
        telemetry = None if watched is None else watched.telemetry
        with suppress(UalError):
            self._check_task(ns, member, telemetry)
        member.frames = _answer(member.uav.frames) if self.wants_frames or self.wants_gimbals else None
        now_s = time.monotonic()
        if now_s >= member.fence_due_s:
            member.fence, member.fence_due_s = _answer(member.uav.geofence), now_s + _FENCE_S
        self._poll_route(member, telemetry, now_s)
        member.taken.poll(member.uav.cameras, now_s, wants_image=self.wants_pictures)
        member.carried.poll(member.uav.gripper, now_s, is_wanted=ns in self.wants_carried)
        self._check_lease(ns, member)

    def _check_lease(self, ns: str, member: PageMember) -> None:
        """Writes down that the lease of the pages was lost. They fly without one from then on, if others let them."""
        lease = member.lease
        if lease is None or lease.lost is None:
            return
        self._journal.write(ns, error_text(lease.lost), time.time())
        member.lease = None
        lease.release()

    def _check_task(self, ns: str, member: PageMember, telemetry: Telemetry | None) -> None:
        """Writes down how a task ended: the telemetry has only the one that runs."""
        present = _task_id(telemetry)
        for task_id in set(member.running) - {present}:
            del member.running[task_id]
            info = member.uav.task(task_id).info()
            if info.status is TaskStatus.RUNNING:  # the telemetry is older than the order
                member.running[task_id] = None
            else:
                self._journal.ended(ns, info, time.time())
        if present:
            member.running[present] = None

    def _poll_route(self, member: PageMember, telemetry: Telemetry | None, now_s: float) -> None:
        """Asks for the way that is flown: of a task once, to a goal that moves repeatedly."""
        route = member.route
        if telemetry is None or telemetry.reference_pose is None:
            member.route = None
            return
        is_other = route is None or route.task_id != _task_id(telemetry)
        if route is not None and not is_other and not route.is_goal_moving:
            return
        if is_other and now_s < member.route_due_s:
            return
        member.route = _answer(member.uav.route)
        # What hovers seldom begins to follow a goal that moves.
        member.route_due_s = now_s + (_ROUTE_CHECK_S if _task_id(telemetry) else _FENCE_S)


def _task_id(telemetry: Telemetry | None) -> str:
    return "" if telemetry is None or telemetry.task is None else telemetry.task.id


def _answer(ask: Callable[[], T]) -> T | None:
    """Returns what a daemon answers; None where it does not, or does not know."""
    try:
        return ask()
    except UalError:
        return None


class Named:
    """A daemon at an address. Asks for its name until it answers."""

    def __init__(self, address: str, session: CommandSession, say: Callable[[str], None]) -> None:
        self.address = address
        self.found: Registration | None = None
        self.is_closed = threading.Event()
        self._session = session
        self._say = say
        self._note = ""

    def start(self) -> None:
        """Begins to ask, on a thread of its own."""
        threading.Thread(target=self._ask, name=f"ual view {self.address}", daemon=True).start()

    def refuse(self, why: str) -> None:
        """Says once why it is not shown."""
        if without_seconds(why) != self._note:
            self._note = without_seconds(why)
            self._say(f"{self.address}: {why}")

    def _ask(self) -> None:
        while self.found is None and not self.is_closed.is_set():
            try:
                with Uav(
                    address=self.address, tls_ca=self._session.tls_ca, credentials=self._session.credentials
                ) as uav:
                    info = uav.info()
                self.found = Registration(info.namespace, 0, self.address, info.backend, 0.0)
            except UalError as error:
                self.refuse(error_text(error))
                self.is_closed.wait(_RETRY_S)
            except Exception as error:  # noqa: BLE001  what answers there may be no daemon
                self.refuse(guard.cause(error))
                self.is_closed.wait(_RETRY_S)
