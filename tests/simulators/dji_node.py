"""A bridge in front of `dji_vehicle_node`: one thread (`ros::spin`) serves its services, one after another.

Its take-off and landing answer only when they have ended (`monitoredTakeoff`, `monitoredLanding`), which it looks at
once a second. Whatever is called meanwhile waits.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Callable, Iterable

from typing_extensions import override

from tests.simulators.dji import AUTO_LANDING, AUTO_TAKE_OFF, Aircraft, OsdkVehicleNode
from tests.simulators.rosbridge import Bridge, Message, Node, Session

_LOOK_S = 1.0
_TASK = "/flight_task_control"


class OneThreadBridge(Bridge):
    """The services of the node wait for one another; those of rosapi do not."""

    def __init__(self, ros: int, nodes: Iterable[Node]) -> None:
        super().__init__(ros, nodes)
        self._waiting: deque[Callable[[], None]] = deque()
        self._release: Callable[[], None] | None = None
        self._is_over: Callable[[], bool] = bool
        self._look_s = math.inf

    @property
    def waiting_count(self) -> int:
        """Calls that wait for the thread."""
        return len(self._waiting)

    @override
    def connect(self) -> Session:
        session = _OneThreadSession(self)
        self.sessions.append(session)
        return session

    @override
    def step(self, now_s: float) -> None:
        super().step(now_s)
        if self._release is not None and now_s >= self._look_s:
            self._look_s = now_s + _LOOK_S
            if self._is_over():
                release, self._release = self._release, None
                release()
        while self._waiting and self._release is None:
            self._waiting.popleft()()

    def serve(self, call: Callable[[], None]) -> None:
        """Executes a call as soon as the thread is free."""
        if self._release is None:
            call()
        else:
            self._waiting.append(call)

    def block(self, answer: Callable[[], None], task: int) -> None:
        """Occupies the thread until what was begun has ended."""
        aircraft = self._aircraft()
        display = AUTO_TAKE_OFF if task == _TAKE_OFF else AUTO_LANDING
        self._is_over = lambda: aircraft.display != display or (task == _LAND and aircraft.body.is_on_ground)
        self._release, self._look_s = answer, self.now_s + _LOOK_S

    def _aircraft(self) -> Aircraft:
        return next(node.aircraft for node in self.nodes if isinstance(node, OsdkVehicleNode))


_TAKE_OFF, _LAND = 4, 6


class _OneThreadSession(Session):
    def __init__(self, bridge: OneThreadBridge) -> None:
        super().__init__(bridge)
        self._thread = bridge

    @override
    def _call_service(self, operation: Message) -> None:
        if operation["service"].startswith("/rosapi"):
            super()._call_service(operation)
        else:
            self._thread.serve(lambda: self._serve(operation))

    def _serve(self, operation: Message) -> None:
        task = operation["args"].get("task") if operation["service"] == _TASK else None
        super()._call_service(operation)
        answer = self.out[-1] if self.out else ""
        if task in (_TAKE_OFF, _LAND) and json.loads(answer)["result"]:
            self.out.pop()
            self._thread.block(lambda: self.out.append(answer), task)
