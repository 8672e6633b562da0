"""Reads the autopilot's parameters from MAVROS, which holds a copy of all of them.

MAVROS fetches them 10 s after it has found the autopilot; over a slow link that takes a minute (ArduPilot has 1,400).
Until then it knows none, and logs an error for each that is requested.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.rosbridge import Message, RosGeneration
from ual_daemon.backends.rosbridge.fields import number

FIRST_ROUND_S, LONGEST_ROUND_S = 2.0, 60.0
REQUEST_PERIOD_S = 30.0
"""Seconds between two reads of known parameters: a ground station may have changed them."""

BOOL, INTEGER, DOUBLE = 1, 2, 3
FIELDS = {BOOL: "bool_value", INTEGER: "integer_value", DOUBLE: "double_value"}
"""The field of a ROS 2 ParameterValue by its type."""

Call = Callable[[str, Message, Callable[[Message], None], float], None]
"""Calls a service: its name, its arguments, the handler of the answer, and the time limit in seconds."""


class ParameterReader:
    """Reads parameters, one call at a time. `on_read` is called when some have come."""

    def __init__(
        self,
        autopilot: Autopilot,
        parameters: dict[str, float],
        judge: Plausibility,
        on_read: Callable[[], None],
        optional: Callable[[], tuple[str, ...]] = tuple,
    ) -> None:
        """`optional` returns the names of others that are wanted, by what was read. Each is requested until an answer
        comes.
        """
        self._autopilot = autopilot
        self._failed: set[str] = set()
        """The names under which MAVROS had none in this round."""
        self._parameters = parameters
        self._judge = judge
        self._on_read = on_read
        self._queue: list[str] = []
        self._next_s = 0.0
        self._round_s = FIRST_ROUND_S
        self._optional_requested = False
        self._optional = optional
        self._optional_requested_s: dict[str, float] = {}
        """Time of the request for each of these; infinite once it was answered."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Human-readable names of those that should be there, and have not come."""
        return self._autopilot.missing_parameters(self._parameters)

    def tick(self, now_s: float, ros: RosGeneration, call: Call) -> bool:
        """Asks for what is due. Returns whether it has called a service."""
        if not self._queue:
            self._queue = self._new_optional(now_s)
        if not self._queue:
            if now_s < self._next_s:
                return False
            self._begin_round(now_s)
        if ros is RosGeneration.ROS2:
            names, self._queue = self._queue, []
            call(topics.GET_PARAMETERS_ROS2, {"names": names}, lambda answer: self._on_values(names, answer), 3.0)
        else:
            name = self._queue.pop(0)
            call(topics.GET_PARAMETER_ROS1, {"param_id": name}, lambda answer: self._on_answer(name, answer), 3.0)
        return True

    def _begin_round(self, now_s: float) -> None:
        self._failed.clear()
        absent = self._autopilot.absent_parameters(self._parameters)
        if self.missing:
            self._queue = absent
            self._next_s, self._round_s = now_s + self._round_s, min(2.0 * self._round_s, LONGEST_ROUND_S)
        else:
            # The optional ones once: MAVROS logs an error for each that the autopilot does not have.
            self._queue = [*self._parameters, *([] if self._optional_requested else absent)]
            self._optional_requested = True
            self._next_s = now_s + REQUEST_PERIOD_S

    def _new_optional(self, now_s: float) -> list[str]:
        """Returns those besides flying that were not requested lately, once all that a flight needs have come."""
        requested_s = self._optional_requested_s
        if self.missing:
            requested_s.clear()  # it has booted
            return []
        found = [name for name in self._optional() if now_s - requested_s.get(name, -math.inf) >= REQUEST_PERIOD_S]
        requested_s.update(dict.fromkeys(found, now_s))
        return found

    def _note_answered(self, name: str) -> None:
        if name in self._optional_requested_s:
            self._optional_requested_s[name] = math.inf

    def _on_values(self, names: list[str], answer: Message) -> None:
        for name, value in zip(names, answer["values"], strict=False):
            self._note_answered(name)
            field = FIELDS.get(int(value["type"]))
            if field is not None:
                self._on_value(name, number(value[field]))
        self._on_read()

    def _on_answer(self, name: str, answer: Message) -> None:
        self._note_answered(name)
        if not answer["success"]:
            self._failed.add(name)
            is_optional = name in self._autopilot.optional_parameters or name in self._optional_requested_s
            if not is_optional and self._failed.issuperset(self._autopilot.names_of(name)):
                self._queue = []  # MAVROS has not fetched them yet: it would log an error for each
            return
        value = answer["value"]
        self._on_value(name, float(int(value["integer"])) or number(value["real"]))
        self._on_read()

    def _on_value(self, name: str, value: float) -> None:
        if self._judge.accepts_parameter(name, value):
            self._parameters[name] = value
