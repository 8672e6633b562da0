"""The parachute of a simulated vehicle: a part of the autopilot, or a component of its own that sends heartbeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from ual_daemon.backends.mavlink.wire.messages import Message

if TYPE_CHECKING:
    from tests.simulators.autopilot import Autopilot
    from tests.simulators.mission_store import Sender

COMPONENT: int = mavlink.MAV_COMP_ID_PARACHUTE
COMMAND: int = mavlink.MAV_CMD_DO_PARACHUTE
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
_HEARTBEAT_S = 1.0
_TEXT_S = 0.05


class Parachute:
    """Made, it is carried. `orders` has what it has taken (PARACHUTE_ACTION), `failures` how often it hears nothing.

    That of an autopilot accepts each order, as ArduPilot does, and says what comes of a release in a text: on the
    ground, below `least_height_m`, or released. Disabled, it says nothing.
    """

    def __init__(self, autopilot: Autopilot, *, is_component: bool) -> None:
        self.orders: list[int] = []
        self.failures = 0
        self.least_height_m = 0.0
        self.component_id = COMPONENT if is_component else autopilot.component_id
        self._is_component = is_component
        self._autopilot = autopilot
        self._codec = AutopilotCodec(COMPONENT)
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
            return
        if self.orders[-1] == mavlink.PARACHUTE_RELEASE and self._is_enabled:
            self._autopilot.at(_TEXT_S, self._release)
        sender.channel.send(ack, self._autopilot.elapsed_s)

    @property
    def _is_enabled(self) -> bool:
        enabled = [each for each in self.orders if each != mavlink.PARACHUTE_RELEASE]
        return enabled[-1:] == [mavlink.PARACHUTE_ENABLE]

    def _release(self) -> None:
        body = self._autopilot.body
        if body.is_on_ground:
            self._autopilot.say("Parachute: Landed", mavlink.MAV_SEVERITY_INFO)
        elif body.ground_z_m - body.position[2] < self.least_height_m:
            self._autopilot.say("Parachute: Too low", mavlink.MAV_SEVERITY_ALERT)
        else:
            self._autopilot.say("Parachute: Released", mavlink.MAV_SEVERITY_INFO)
            self._autopilot.disarm(is_forced=True)

    def _result(self) -> int:
        """A component opens only where it was enabled."""
        is_release = self.orders[-1] == mavlink.PARACHUTE_RELEASE
        return DENIED if self._is_component and is_release and not self._is_enabled else ACCEPTED

    def _beat(self) -> None:
        kind, none = mavlink.MAV_TYPE_PARACHUTE, mavlink.MAV_AUTOPILOT_INVALID
        beat = mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
        for channel in self._autopilot.channels:
            channel.port.send(self._codec.encode(beat), self._autopilot.elapsed_s)
        self._autopilot.at(_HEARTBEAT_S, self._beat)
