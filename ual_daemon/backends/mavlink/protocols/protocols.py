"""All protocols besides flying of one link."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

from typing_extensions import override

from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.cameras import CameraProtocol
from ual_daemon.backends.mavlink.protocols.component_commands import ComponentCommands
from ual_daemon.backends.mavlink.protocols.component_metadata import ComponentMetadata
from ual_daemon.backends.mavlink.protocols.corrections_injection import CorrectionsInjection
from ual_daemon.backends.mavlink.protocols.ftp import Ftp
from ual_daemon.backends.mavlink.protocols.gimbals import GimbalProtocol, GimbalServices
from ual_daemon.backends.mavlink.protocols.gripper_reports import GripperReports
from ual_daemon.backends.mavlink.protocols.log_transfers import LogTransfers
from ual_daemon.backends.mavlink.protocols.mission_progress import MissionProgressProtocol
from ual_daemon.backends.mavlink.protocols.mission_transfers import MissionTransfers
from ual_daemon.backends.mavlink.protocols.parachute_releases import ParachuteReleases
from ual_daemon.backends.mavlink.protocols.parameter_transfers import ParameterTransfers
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message


class Protocols(Protocol):
    """Belongs to the thread that receives. A defect of one of them ends its exchanges, and neither others nor the link.

    Args:
        send: Sends a message.
        is_up: Says whether the link is up at a time.
        is_gentle: Says whether it may be flying, so that nothing may delay what flies it.
        has_room: Says whether nothing that is urgent has to wait for what is sent now.
        speed_up: Asks for all streams so many times as often as usual.
        of_gimbals: What the gimbals need of the session.

    """

    def __init__(
        self,
        send: Callable[[Message], object],
        is_up: Callable[[float], bool],
        is_gentle: Callable[[], bool] = lambda: True,
        has_room: Callable[[], bool] = lambda: True,
        speed_up: Callable[[float], object] = lambda _: None,
        of_gimbals: GimbalServices | None = None,
    ) -> None:
        self.parameters = ParameterTransfers(send, is_up)
        self.missions = MissionTransfers(send, is_up)
        self.files = Ftp(send, is_up, is_gentle, speed_up)
        self.logs = LogTransfers(send, is_up, is_gentle)
        self.component_metadata = ComponentMetadata(send)
        self.corrections = CorrectionsInjection(send, is_up, has_room)
        self.cameras = CameraProtocol(send, is_gentle)
        self.gimbals = GimbalProtocol(of_gimbals or GimbalServices(send))
        self.progress = MissionProgressProtocol(send, is_up)
        self.gripper = GripperReports()
        self.components = ComponentCommands(send)
        self.parachute = ParachuteReleases()
        self._all: tuple[Protocol, ...] = (
            self.parameters,
            self.missions,
            self.progress,
            self.files,
            self.logs,
            self.component_metadata,
            self.corrections,
            self.cameras,
            self.gripper,
            self.components,
            self.parachute,
            self.gimbals,
        )
        self._contained: dict[Protocol, ErrorBarrier] = {each: ErrorBarrier(type(each).__name__) for each in self._all}
        taken: defaultdict[int, list[Handler]] = defaultdict(list)
        for protocol in self._all:
            for message_id, handler in protocol.handlers.items():
                taken[message_id].append(handler)
        self._handlers = {message_id: _in_turn(handlers) for message_id, handlers in taken.items()}

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return self._handlers

    @property
    @override
    def is_urgent(self) -> bool:
        return self.files.is_urgent or self.logs.is_urgent or self.gimbals.is_urgent  # no other one ever is

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        for protocol in self._all:
            protocol.attach(target, dialect)

    @override
    def release(self) -> None:
        for protocol in self._all:
            self._contained[protocol].call(protocol.release)

    @override
    def drop(self, why: str) -> None:
        for protocol in self._all:
            protocol.drop(why)

    @override
    def tick(self, now_s: float) -> None:
        for protocol in self._all:
            if not protocol.is_waiting:
                continue
            try:  # here, and not by `ErrorBarrier.call`: each sample costs it
                protocol.tick(now_s)
            except Exception as error:  # noqa: BLE001 - what flies goes on
                self._end_defective(protocol, error)

    def _end_defective(self, protocol: Protocol, error: Exception) -> None:
        contained = self._contained[protocol]
        contained.tell(error)
        contained.call(protocol.drop, "a defect of UAL")  # else what was begun would fail again at each tick


def _in_turn(handlers: list[Handler]) -> Handler:
    """Returns what gives a message to each of several."""
    if len(handlers) == 1:
        return handlers[0]

    def on_message(message: Message, now_s: float) -> None:
        for handler in handlers:
            handler(message, now_s)

    return on_message
