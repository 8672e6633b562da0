"""The parachute of a simulated vehicle: a part of the autopilot, or a component of its own that sends heartbeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual_daemon.backends.mavlink.wire.messages import Codec, Message, mavlink

if TYPE_CHECKING:
    from tests.simulators.autopilot import Autopilot
    from tests.simulators.mission_store import Sender

COMPONENT: int = mavlink.MAV_COMP_ID_PARACHUTE
COMMAND: int = mavlink.MAV_CMD_DO_PARACHUTE
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
_HEARTBEAT_S = 1.0


class Parachute:
    """Made, it is carried. `orders` has what it has taken (PARACHUTE_ACTION), `failures` how often it hears nothing."""

    def __init__(self, autopilot: Autopilot, *, is_component: bool) -> None:
        self.orders: list[int] = []
        self.failures = 0
        self.component_id = COMPONENT if is_component else autopilot.component_id
        self._is_component = is_component
        self._autopilot = autopilot
        self._codec = Codec(COMPONENT)
        self._codec.join(autopilot.system_id)
        with autopilot.lock:
            autopilot.parachute = self
            if is_component:
                self._beat()

    def on_command(self, message: Message, sender: Sender) -> None:
        """Takes a command, and acknowledges it."""
        if self.failures > 0:
            self.failures -= 1
            return
        self.orders.append(int(message.param1))
        ids = (sender.system_id, sender.component_id)
        ack = mavlink.MAVLink_command_ack_message(COMMAND, self._result(), 0, 0, *ids)
        if self._is_component:
            sender.channel.port.send(self._codec.encode(ack), self._autopilot.elapsed_s)
        else:
            sender.channel.send(ack, self._autopilot.elapsed_s)

    def _result(self) -> int:
        """It opens only where it was enabled."""
        enabled = [each for each in self.orders if each != mavlink.PARACHUTE_RELEASE]
        is_refused = self.orders[-1] == mavlink.PARACHUTE_RELEASE and enabled[-1:] != [mavlink.PARACHUTE_ENABLE]
        return DENIED if is_refused else ACCEPTED

    def _beat(self) -> None:
        kind, none = mavlink.MAV_TYPE_PARACHUTE, mavlink.MAV_AUTOPILOT_INVALID
        beat = mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
        for channel in self._autopilot.channels:
            channel.port.send(self._codec.encode(beat), self._autopilot.elapsed_s)
        self._autopilot.at(_HEARTBEAT_S, self._beat)
