"""The plugins waypoint, geofence and rallypoint of a simulated MAVROS, as mission_protocol_base.cpp (1.21 and 2.12)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.rosbridge import Answer, Later, Message, RefusedError, Service

NAMES = {"mission": 0, "geofence": 1, "rallypoint": 2}
TIMEOUT_S, LIST_TIMEOUT_S, RETRIES_COUNT = 1.0, 30.0, 3
_GLOBAL = (0, 3, 5, 6, 10, 11)
_SENDING = ("list out", "items out")


class ListPlugin:
    """One plugin. `send` sends a message to the autopilot, `publish` publishes on a topic of the node."""

    def __init__(
        self,
        name: str,
        send: Callable[[Any], None],
        publish: Callable[[str, Message], None],
        target: tuple[int, int],
        *,
        ros: int,
    ) -> None:
        self.name = name
        self.waypoints: list[dict[str, Any]] = []
        self.current = 0
        self._kind = NAMES[name]
        self._send = send
        self._publish = publish
        self._target = target
        self._ros = ros
        self._state = "idle"
        self._outgoing: list[dict[str, Any]] = []
        self._count = self._seq = 0
        self._chosen = 0
        self._retries_count = 0
        self._timeout_s = self._end_s = math.inf
        self._later: Later | None = None
        self._now_s = 0.0

    def services(self) -> Mapping[str, Service]:
        """Returns its services by name within the node's."""
        found: dict[str, Service] = {"pull": self._pull, "push": self._push, "clear": self._clear}
        if self.name == "mission":
            found["set_current"] = self._set_current
        return {f"{self.name}/{service}": call for service, call in found.items()}

    def topics(self) -> Mapping[str, str]:
        """Returns its topics by name within the node's."""
        found = {f"{self.name}/waypoints": "mavros_msgs/WaypointList"}
        return found | ({"mission/reached": "mavros_msgs/WaypointReached"} if self.name == "mission" else {})

    def die(self) -> None:
        """Ends with its node."""
        if self._later is not None:
            self._later.is_lost = True

    def fetch(self) -> None:
        """Begins to pull by itself, as it does after the boot."""
        if self._state == "idle":
            self._request_list()

    def tick(self, now_s: float) -> None:
        """Sends again, and ends what takes too long."""
        self._now_s = now_s
        if now_s >= self._timeout_s:
            self._on_timeout()
        if now_s >= self._end_s:
            self._end(success=False)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_message(self, message: Any) -> None:
        """Takes a message of the mission protocol."""
        name = message.get_type()
        if name == "MISSION_CURRENT" and self.name == "mission":
            self._on_current(message.seq)
        elif name == "MISSION_ITEM_REACHED" and self.name == "mission":
            self._publish("mission/reached", {"wp_seq": message.seq})
        elif getattr(message, "mission_type", None) == self._kind:
            handler = {
                "MISSION_COUNT": self._on_count,
                "MISSION_ITEM_INT": self._on_item,
                "MISSION_REQUEST_INT": self._on_request,
                "MISSION_REQUEST": self._on_request,
                "MISSION_ACK": self._on_ack,
            }.get(name)
            if handler is not None:
                handler(message)

    def _on_count(self, message: Any) -> None:
        if self._state != "list in":
            return
        self._count, self._seq, self.waypoints = message.count, 0, []
        self._state = "items in"
        self._go_on_reading()

    def _on_item(self, message: Any) -> None:
        if self._state == "items in" and message.seq == self._seq:
            self.waypoints.append(_waypoint(message))
            self._seq += 1
            self._go_on_reading()

    def _go_on_reading(self) -> None:
        self._restart_timer()
        if self._seq < self._count:
            self._send(mavlink.MAVLink_mission_request_int_message(*self._target, self._seq, self._kind))
            return
        self._send(mavlink.MAVLink_mission_ack_message(*self._target, 0, self._kind))
        self._end(success=True)
        self._publish_list()

    def _on_request(self, message: Any) -> None:
        is_first = self._state == "list out" and message.seq == 0
        is_next = self._state == "items out" and message.seq in (self._seq, self._seq + 1)
        if (is_first or is_next) and message.seq < len(self._outgoing):
            self._state, self._seq = "items out", message.seq
            self._restart_timer()
            self._send(self._item(message.seq))

    def _on_ack(self, message: Any) -> None:
        is_accepted = message.type == 0
        if self._state in _SENDING:
            if is_accepted and self._seq == len(self._outgoing) - 1:
                self.waypoints = self._outgoing
                self._end(success=True)
                self._publish_list()
            elif message.type != mavlink.MAV_MISSION_INVALID_SEQUENCE or self._state == "list out":
                self._end(success=False)
        elif self._state == "clear":
            if is_accepted:
                self.waypoints = []
            self._end(success=is_accepted)
            if is_accepted:
                self._publish_list()

    def _on_current(self, seq: int) -> None:
        is_chosen = self._state == "choosing"
        if not is_chosen and (self._state != "idle" or seq == self.current):
            return
        self.current = seq
        for index, each in enumerate(self.waypoints):
            each["is_current"] = index == seq
        if is_chosen:
            self._end(success=True)
        self._publish_list()

    # --- What is asked for --------------------------------------------------------------------------------------------

    def _pull(self, _: Message) -> Answer:
        return self._begin(self._request_list)

    def _push(self, message: Message) -> Answer:
        def begin() -> None:
            self._outgoing = [dict(each) for each in message["waypoints"]]
            self._state, self._seq = "list out", 0
            self._transmit()

        return self._begin(begin)

    def _clear(self, _: Message) -> Answer:
        def begin() -> None:
            self._state = "clear"
            self._transmit()

        return self._begin(begin)

    def _set_current(self, message: Message) -> Answer:
        def begin() -> None:
            self._state, self._chosen = "choosing", message["wp_seq"]
            self._transmit()

        return self._begin(begin)

    def _begin(self, act: Callable[[], None]) -> Answer:
        if self._state != "idle":
            if self._ros == 1:
                raise RefusedError(f"service [/mavros/{self.name}] responded with an error: b''")
            return {"success": False, "wp_received": 0, "wp_transfered": 0}
        self._later, self._end_s = Later(), self._now_s + LIST_TIMEOUT_S
        later = self._later
        act()
        return later

    def _request_list(self) -> None:
        self._state = "list in"
        self._transmit()

    def _transmit(self) -> None:
        self._retries_count = RETRIES_COUNT
        self._timeout_s = self._now_s + TIMEOUT_S
        self._send_again()

    def _send_again(self) -> None:
        target, kind = self._target, self._kind
        if self._state == "list in":
            self._send(mavlink.MAVLink_mission_request_list_message(*target, kind))
        elif self._state == "items in":  # with floats, and it does not take the answer
            self._send(mavlink.MAVLink_mission_request_message(*target, self._seq, kind))
        elif self._state == "list out":
            self._send(mavlink.MAVLink_mission_count_message(*target, len(self._outgoing), kind))
        elif self._state == "items out":
            self._send(self._item(self._seq))
        elif self._state == "clear":
            self._send(mavlink.MAVLink_mission_clear_all_message(*target, kind))
        elif self._state == "choosing":
            self._send(mavlink.MAVLink_mission_set_current_message(*target, self._chosen))

    def _on_timeout(self) -> None:
        if self._retries_count <= 0:
            self._end(success=False)
            return
        self._retries_count -= 1
        self._timeout_s = self._now_s + TIMEOUT_S
        self._send_again()

    def _restart_timer(self) -> None:
        self._retries_count, self._timeout_s = RETRIES_COUNT, self._now_s + TIMEOUT_S

    def _end(self, *, success: bool) -> None:
        later, self._later = self._later, None
        counts = {"wp_received": len(self.waypoints), "wp_transfered": self._seq + 1}
        self._state, self._timeout_s, self._end_s = "idle", math.inf, math.inf
        if later is not None:
            later.answer = {"success": success, **counts}

    def _publish_list(self) -> None:
        copied = [dict(each) for each in self.waypoints]
        self._publish(f"{self.name}/waypoints", {"current_seq": self.current, "waypoints": copied})

    def _item(self, seq: int) -> Any:
        item = self._outgoing[seq]
        factor = 1e7 if item["frame"] in _GLOBAL else 1.0
        x, y = int(item["x_lat"] * factor), int(item["y_long"] * factor)  # it cuts off what is beyond
        params = (item[f"param{index}"] for index in range(1, 5))
        flags = int(item["is_current"]), int(item["autocontinue"])
        return mavlink.MAVLink_mission_item_int_message(
            *self._target, seq, item["frame"], item["command"], *flags, *params, x, y, item["z_alt"], self._kind
        )


def _waypoint(message: Any) -> dict[str, Any]:
    factor = 1e7 if message.frame in _GLOBAL else 1.0
    return {
        "frame": message.frame,
        "command": message.command,
        "is_current": bool(message.current),
        "autocontinue": bool(message.autocontinue),
        **{f"param{index}": getattr(message, f"param{index}") for index in range(1, 5)},
        "x_lat": message.x / factor,
        "y_long": message.y / factor,
        "z_alt": message.z,
    }
