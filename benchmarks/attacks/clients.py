"""A program that flies, and one that reads telemetry, each a process: ``python -m benchmarks.attacks.clients ADDRESS``.

Tasks: ``fly`` (takes off, and streams a velocity at 50 Hz), ``listen``, ``take`` (returns the times since the last
call), ``stop``. Against the plain server (``--plain``) the calls are the same, without a take-off.
"""

from __future__ import annotations

import argparse
import sys
import threading
import time
from typing import Any

import ual
from benchmarks.children import serve
from benchmarks.marks import yaw_rate_rad_s
from ual.errors import UalError
from ual.geometry import Twist, Vector3
from ual.types import State

RATE_HZ = 50.0
_HEIGHT_M = 5.0
_LIMIT_S = 60.0
_NORTH = Vector3(0.0, 1.0, 0.0)


class ClientTasks:
    """The tasks. Times are of the monotonic clock, in ns."""

    def __init__(self, address: str, *, is_plain: bool) -> None:
        self._uav = ual.Uav(address=address)
        self._is_plain = is_plain
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        self._due: list[tuple[int, int]] = []
        self._samples: list[int] = []
        self._errors: dict[str, int] = {}

    def handle(self, task: dict[str, Any]) -> dict[str, Any]:
        do = task.pop("do")
        answer: dict[str, Any] = getattr(self, do)(**task)
        return answer

    def fly(self) -> dict[str, Any]:
        if not self._is_plain:
            self._uav.wait_for(State.LANDED_DISARMED, State.LANDED_ARMED, timeout_s=_LIMIT_S)
            deadline_s = time.monotonic() + _LIMIT_S
            while not self._try_to_take_off():
                if time.monotonic() > deadline_s:
                    raise TimeoutError("it does not take off")
                time.sleep(0.2)
        threading.Thread(target=self._stream, daemon=True).start()
        return {}

    def _try_to_take_off(self) -> bool:
        try:
            if self._uav.state() is State.LANDED_DISARMED:
                self._uav.arm(timeout_s=_LIMIT_S)
            self._uav.take_off(_HEIGHT_M, timeout_s=_LIMIT_S)
        except UalError as error:
            print(error, file=sys.stderr)
            return False
        return True

    def _stream(self) -> None:
        """Sends a setpoint when it is due; those whose time has passed are left out, as by any control loop."""
        begin_ns = time.monotonic_ns()
        number = 0
        while not self._stopped.is_set():
            number += 1
            due_ns = begin_ns + round(number * 1e9 / RATE_HZ)
            now_ns = time.monotonic_ns()
            if now_ns < due_ns:
                time.sleep((due_ns - now_ns) / 1e9)
            elif now_ns - due_ns > 1e9 / RATE_HZ:
                continue
            try:
                self._uav.set_velocity(Twist(_NORTH, Vector3(0.0, 0.0, yaw_rate_rad_s(number))))
            except UalError as error:
                with self._lock:
                    self._errors[str(error)] = self._errors.get(str(error), 0) + 1
            with self._lock:
                self._due.append((number, due_ns))

    def listen(self) -> dict[str, Any]:
        self._uav.subscribe(lambda _: self._samples.append(time.monotonic_ns()), RATE_HZ)
        return {}

    def take(self) -> dict[str, Any]:
        with self._lock:
            due, self._due = self._due, []
            errors, self._errors = self._errors, {}
        samples, self._samples = self._samples, []
        return {"due": due, "samples": samples, "errors": errors, "now_ns": time.monotonic_ns()}

    def stop(self) -> dict[str, Any]:
        self._stopped.set()
        return {}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("--plain", action="store_true")
    arguments = parser.parse_args()
    serve(ClientTasks(arguments.address, is_plain=arguments.plain).handle)


if __name__ == "__main__":
    main()
