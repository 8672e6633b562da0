"""The plugin param of a simulated MAVROS: its copy of the parameters, as in its sources (param.cpp, 1.21 and 2.12)."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.rosbridge import Answer, Later, Message, RefusedError, Service

TIMEOUT_S, LIST_TIMEOUT_S, RETRIES_COUNT = 1.0, 30.0, 3
_REAL: int = mavlink.MAV_PARAM_TYPE_REAL32
_CHECKSUM = "_HASH_CHECK"
_INT: int = mavlink.MAV_PARAM_TYPE_INT32


class ParamPlugin:
    """Keeps a copy. `send` sends a message to the autopilot; `is_px4`: it puts the bytes of an integer on the wire.

    `server` is the parameter server of ROS 1, which outlives the node.
    """

    def __init__(
        self, send: Callable[[Any], None], target: tuple[int, int], server: dict[str, float], *, ros: int, is_px4: bool
    ) -> None:
        self.copy: dict[str, float] = {}
        self._send = send
        self._target = target
        self._server = server
        self._ros = ros
        self._is_px4 = is_px4
        self._missing: list[int] = []
        self._state = "idle"
        self._retries_count = 0
        self._timeout_s = math.inf
        self._pulls: list[tuple[float, Later]] = []
        self._setting: tuple[str, float, Later, float] | None = None
        self._now_s = 0.0

    def services(self) -> Mapping[str, Service]:
        """Returns its services by name within the node's."""
        if self._ros == 1:
            return {"param/get": self._get, "param/set": self._set, "param/pull": self._pull}
        return {
            "param/get_parameters": self._get_parameters,
            "param/list_parameters": lambda _: {"result": {"names": list(self.copy), "prefixes": []}},
            "param/set": self._set,
            "param/pull": self._pull,
        }

    def die(self) -> None:
        """Ends with its node."""
        for later in (*(each for _, each in self._pulls), *([] if self._setting is None else [self._setting[2]])):
            later.is_lost = True

    def fetch(self) -> None:
        """Begins to fetch all."""
        self._state, self._retries_count = "list", RETRIES_COUNT
        self.copy.clear()
        self._request_list()

    def tick(self, now_s: float) -> None:
        """Asks again, and ends what takes too long."""
        self._now_s = now_s
        if now_s >= self._timeout_s:
            self._on_timeout()
        for end_s, later in self._pulls:
            if now_s >= end_s:
                self._answer_pull(later, success=False)
        self._pulls = [each for each in self._pulls if now_s < each[0]]
        if self._setting is not None and now_s >= self._setting[3]:
            self._end_setting(success=False)

    def on_value(self, message: Any) -> None:
        """Takes a PARAM_VALUE."""
        self.copy[message.param_id] = self._decoded(message)
        if self._setting is not None and self._setting[0] == message.param_id:
            self._end_setting(success=True)
        if self._state not in ("list", "missing"):
            return
        if self._state == "list":
            if self._is_px4:  # it begins its list with a checksum
                self.copy[_CHECKSUM] = 1234
            self._state, self._missing = "missing", list(range(message.param_count))
        if message.param_index in self._missing:
            self._missing.remove(message.param_index)
        self._timeout_s = self._now_s + TIMEOUT_S
        if not self._missing:
            self._state, self._timeout_s = "idle", math.inf
            pulls, self._pulls = self._pulls, []
            for _, later in pulls:
                self._answer_pull(later, success=True)

    def _on_timeout(self) -> None:
        self._timeout_s = self._now_s + TIMEOUT_S
        if self._state == "list" and self._retries_count > 0:
            self._retries_count -= 1
            self._request_list()
        elif self._state == "missing":
            self._send(mavlink.MAVLink_param_request_read_message(*self._target, b"", self._missing[0]))
        elif self._state == "setting" and self._setting is not None:
            self._transmit(self._setting[0], self._setting[1])

    def _request_list(self) -> None:
        self._timeout_s = self._now_s + TIMEOUT_S
        self._send(mavlink.MAVLink_param_request_list_message(*self._target))

    def _decoded(self, message: Any) -> float:
        if message.param_type == _REAL:
            return float(message.param_value)
        if not self._is_px4:
            return int(message.param_value)
        whole: int = struct.unpack("<i", struct.pack("<f", message.param_value))[0]
        return whole

    # --- Its services -------------------------------------------------------------------------------------------------

    def _pull(self, message: Message) -> Answer:
        if message["force_pull"] or (self._state == "idle" and not self.copy):
            self.fetch()
        later = Later()
        if self._state in ("list", "missing"):
            self._pulls.append((self._now_s + LIST_TIMEOUT_S, later))
        else:
            self._answer_pull(later, success=True)
        return later

    def _answer_pull(self, later: Later, *, success: bool) -> None:
        if self._ros == 1:
            self._server.update({name: value for name, value in self.copy.items() if name != _CHECKSUM})
        later.answer = {"success": success, "param_received": len(self.copy)}

    def _set(self, message: Message) -> Answer:
        name = message["param_id"]
        if self._state in ("list", "missing"):
            if self._ros == 1:
                raise RefusedError("service [/mavros/param/set] responded with an error: b''")
            return self._written(name, success=False)
        if name not in self.copy:
            return self._written(name, success=False)
        later = Later()
        self._setting = (name, self._wanted(name, message["value"]), later, self._now_s + 5.0 * TIMEOUT_S)
        self._state, self._timeout_s = "setting", self._now_s + TIMEOUT_S
        self._transmit(*self._setting[:2])
        return later

    def _wanted(self, name: str, value: Message) -> float:
        """Returns the value that is sent. ROS 1 takes a whole number where one is given that is not 0."""
        if self._ros == 2:
            return int(value["integer_value"]) if value["type"] == 2 else float(value["double_value"])
        if value.get("integer", 0):
            return int(value["integer"])
        if value.get("real", 0.0) or isinstance(self.copy[name], float):
            return float(value.get("real", 0.0))
        return 0

    def _transmit(self, name: str, value: float) -> None:
        is_whole = isinstance(value, int)
        on_wire = struct.unpack("<f", struct.pack("<i", value))[0] if is_whole and self._is_px4 else float(value)
        kind = _INT if is_whole else _REAL
        self._send(mavlink.MAVLink_param_set_message(*self._target, name.encode(), on_wire, kind))

    def _end_setting(self, *, success: bool) -> None:
        assert self._setting is not None
        name, _, later, _ = self._setting
        self._setting, self._state, self._timeout_s = None, "idle", math.inf
        later.answer = self._written(name, success=success)

    def _written(self, name: str, *, success: bool) -> Message:
        value = self.copy.get(name)
        return {"success": success, "value": _value1(value) if self._ros == 1 else value2(value)}

    def _get(self, message: Message) -> Message:
        value = self.copy.get(message["param_id"])
        return {"success": value is not None, "value": _value1(value)}

    def _get_parameters(self, message: Message) -> Message:
        return {"values": [value2(self.copy.get(name)) for name in message["names"]]}


def on_server(node: str, server: Mapping[str, float], message: Message) -> Message:
    """Answers ``/rosapi/get_param`` for the parameters of a node: one of them, or all."""
    name = str(message["name"]).removeprefix(f"{node}/param").lstrip("/")
    return {"value": json.dumps(server.get(name) if name else dict(server) or None)}


def _value1(value: float | None) -> Message:
    is_whole = isinstance(value, int)
    return {"integer": value if is_whole else 0, "real": 0.0 if is_whole or value is None else value}


def value2(value: float | None) -> Message:
    """Returns a ParameterValue of ROS 2."""
    kind = 0 if value is None else 2 if isinstance(value, int) else 3
    return {
        "type": kind,
        "bool_value": False,
        "integer_value": value if kind == 2 else 0,
        "double_value": value if kind == 3 else 0.0,
    }
