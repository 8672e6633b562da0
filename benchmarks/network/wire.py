"""Many UAVs on the wire alone: twenty processes that tell from recorded telemetry, one router, one listener."""

from __future__ import annotations

import json
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from benchmarks.children import Child, Process
from benchmarks.network import router
from benchmarks.network.goals import NetworkFigure
from tests.ports import free_port
from ual.network import NetworkSettings, configuration

_TELLERS = 20
_SITE = "wire"
_LIMIT_S = 180.0
_LISTED_S = 3.0


def measure(uavs: int, seconds: float) -> list[NetworkFigure]:
    """Measures so many UAVs."""
    each = uavs // _TELLERS
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = NetworkSettings(site=_SITE, connect=(endpoint,))
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="ual-network-")))
        config = directory / "network.yaml"
        config.write_text(f"site: {_SITE}\nconnect: [{endpoint}]\n")
        file = directory / "router.json5"
        file.write_text(json.dumps(configuration.router(settings, listen=[endpoint])))
        routing = stack.enter_context(router.start(file))
        listener = stack.enter_context(Child("benchmarks.network.listener", str(config)))
        tellers = [
            stack.enter_context(Child("benchmarks.network.teller", str(config), str(i * each + 1), str(each)))
            for i in range(_TELLERS)
        ]
        for teller in tellers:
            assert teller.popen.stdout is not None
            teller.popen.stdout.readline()
        ready_s = time.monotonic()
        listed = listener.ask("until", count=uavs, limit_s=_LIMIT_S)
        found = [
            NetworkFigure(
                f"{uavs} UAVs told by {_TELLERS} processes: all listed after all tell",
                max(0.0, listed["at_s"] - ready_s),
                "s",
                _LISTED_S,
            )
        ]
        anew = listener.ask("discover", limit_s=_LIMIT_S)
        found.append(NetworkFigure(f"a program that starts lists {anew['count']} of {uavs}", anew["took_s"], "s"))
        processes: list[Process] = [routing, listener, *tellers]
        before = [process.processor_s() for process in processes]
        began_s = time.monotonic()
        ages_s = listener.ask("ages", seconds=seconds, limit_s=_LIMIT_S)["ages_s"]
        took_s = time.monotonic() - began_s
        shares = [
            100.0 * (process.processor_s() - was) / took_s for process, was in zip(processes, before, strict=True)
        ]
        return [
            *found,
            NetworkFigure("samples a second", len(ages_s) / took_s, "/s"),
            NetworkFigure("from sample to who listens, p50", ages_s[len(ages_s) // 2] * 1e3, "ms"),
            NetworkFigure("from sample to who listens, p99", ages_s[len(ages_s) * 99 // 100] * 1e3, "ms"),
            NetworkFigure("processor: the router", shares[0], "%"),
            NetworkFigure("processor: who listens to all", shares[1], "%"),
            NetworkFigure("processor: the twenty that tell, together", sum(shares[2:]), "%"),
            NetworkFigure("memory: the router", routing.resident_mib(), "MiB"),
            NetworkFigure("memory: who listens", listener.resident_mib(), "MiB"),
        ]
