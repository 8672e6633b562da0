"""A program that listens to the network: ``python -m benchmarks.network.listener CONFIG``.

Tasks: ``until`` (so many UAVs are there), ``discover`` (a new listener, from nothing to all), ``ages`` (how old samples
were as they came, by their stamps), ``processor``. Times are of the monotonic clock, which all processes share.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from benchmarks.children import serve
from ual.network import Network, discover

_LIMIT_S = 120.0
_LOOK_S = 0.02
_IDLE_SHARE = 4.0
"""Factor of a look's duration for which it pauses: a look at thousands of UAVs takes a while."""


class NetworkListener:
    """The tasks."""

    def __init__(self, config: str) -> None:
        self._config = config
        self._network = Network(config, timeout_s=_LIMIT_S)

    def handle(self, task: dict[str, Any]) -> dict[str, Any]:
        answer: dict[str, Any] = getattr(self, task.pop("do"))(**task)
        return answer

    def until(self, count: int, is_exact: bool = False) -> dict[str, Any]:
        """Waits until so many are there, or, exactly, no more either."""

        def is_so() -> bool:
            found = self._present()
            return found == count if is_exact else found >= count

        end_s = time.monotonic() + _LIMIT_S
        while time.monotonic() < end_s:
            began_s = time.monotonic()
            if is_so():
                break
            time.sleep(max(_LOOK_S, _IDLE_SHARE * (time.monotonic() - began_s)))
        return {"at_s": time.monotonic(), "count": self._present(), "problems": dict(self._network.problems)}

    def steady(self, seconds: float) -> dict[str, Any]:
        """Returns the fewest that were there within some seconds."""
        end_s = time.monotonic() + seconds
        fewest = self._present()
        while time.monotonic() < end_s:
            time.sleep(_LOOK_S)
            fewest = min(fewest, self._present())
        return {"count": fewest}

    def discover(self) -> dict[str, Any]:
        began_s = time.monotonic()
        found = discover(self._config, timeout_s=_LIMIT_S)
        return {"took_s": time.monotonic() - began_s, "count": len(found)}

    def ages(self, seconds: float) -> dict[str, Any]:
        """Collects, for some seconds, how long each sample was under way."""
        heard: dict[str, float] = {}
        ages: list[float] = []
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            for uav in self._network.uavs():
                if heard.get(uav.ns) != uav.heard_s:
                    heard[uav.ns] = uav.heard_s
                    ages.append(uav.heard_s - uav.telemetry.stamp_s)
            time.sleep(0.25)
        return {"ages_s": sorted(ages)}

    def processor(self) -> dict[str, Any]:
        return {"processor_s": time.process_time()}

    def _present(self) -> int:
        return sum(1 for uav in self._network.uavs() if uav.gone_s is None)


if __name__ == "__main__":
    serve(NetworkListener(sys.argv[1]).handle)
