"""Effect of the network on a flight by setpoints: of announcements, of a router that ends, and of nonsense."""

from __future__ import annotations

import json
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.attacks.scenes import LightScene
from benchmarks.children import Process
from benchmarks.network import router
from benchmarks.network.goals import NetworkFigure
from tests.ports import free_port
from ual.network import Network, NetworkSettings, configuration
from ual.network.session import close_session, open_session

_SITE = "flight"
_JOIN_S = 30.0
_MOST_P99_MS = 20.0
"""As `benchmarks.attacks` wants."""
_MOST_MORE_MS = 5.0
"""The flight without the network is another one, and the machine is not quiet."""
_FLAGS = "UAL_TEST_ATTACKS_FLAGS"


def measure(messages: int, seconds: float) -> list[NetworkFigure]:
    """Measures the lateness of setpoints, each with a daemon of its own."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = NetworkSettings(site=_SITE, connect=(endpoint,))
    with tempfile.TemporaryDirectory(prefix="ual-network-") as name:
        directory = Path(name)
        config = directory / "network.yaml"
        config.write_text(f"site: {_SITE}\nconnect: [{endpoint}]\n")
        file = directory / "router.json5"
        file.write_text(json.dumps(configuration.router(settings, listen=[endpoint])))
        without = _late("without the network", None, lambda _: time.sleep(seconds))
        found = [without]
        with router.start(file) as first:
            found.append(_late("telling at 1 Hz", config, lambda _: time.sleep(seconds)))
            found += _nonsense(settings, config, messages)
            found.append(
                _late("its router is killed and started again", config, lambda _: _restart(first, file, seconds))
            )
        return [*found, *(_more(each, without) for each in found[1:] if each.unit == "ms")]


def _more(found: NetworkFigure, without: NetworkFigure) -> NetworkFigure:
    return NetworkFigure(
        f"{found.what}: more than without the network", found.value - without.value, "ms", _MOST_MORE_MS
    )


def _late(what: str, config: Path | None, act: Callable[[LightScene], None]) -> NetworkFigure:
    """Returns how late setpoints were while something happens."""
    os.environ[_FLAGS] = "" if config is None else f"--network {config}"
    with LightScene() as scene:
        scene.begin()
        act(scene)
        measured = scene.measure()
        defects = scene.defects()
    print(f"{what}: {measured.setpoints}, {measured.errors}, {defects[:3]}", file=sys.stderr, flush=True)
    return NetworkFigure(f"setpoints at 50 Hz, p99 lateness: {what}", measured.setpoints.p99, "ms", _MOST_P99_MS)


def _restart(routing: Process, file: Path, seconds: float) -> None:
    routing.popen.kill()
    routing.popen.wait()
    time.sleep(seconds / 3.0)
    with router.start(file):
        time.sleep(seconds * 2.0 / 3.0)


def _nonsense(settings: NetworkSettings, config: Path, messages: int) -> list[NetworkFigure]:
    sent: list[float] = []

    def send(_: LightScene) -> None:
        with Network(settings, timeout_s=_JOIN_S) as network:
            network.wait_for(lambda it: bool(it.uavs()), _JOIN_S)
            instance = network.find("uav_1").instance
        began_s = time.monotonic()
        _send(settings, instance, messages)
        sent.append(time.monotonic() - began_s)

    late = _late(f"{messages} messages of nonsense", config, send)
    return [late, NetworkFigure(f"{messages} messages of nonsense took", sent[0], "s")]


def _send(settings: NetworkSettings, instance: str, messages: int) -> None:
    """Sends puts, deletions and queries under the daemon's own keys and others, at most 20,000 a second."""
    drawn = random.Random(1)
    own = f"ual/{settings.site}/uav_1/{instance}"
    keys = [
        f"{own}/telemetry",
        f"{own}/alive",
        f"{own}/command",
        "ual/**",
        f"ual/{settings.site}/uav_1/take_off",
        "@/**",
    ]
    session = open_session(settings, _JOIN_S)
    pause = threading.Event()
    try:
        for number in range(messages):
            key, data = drawn.choice(keys), drawn.randbytes(drawn.randrange(300))
            if number % 50 == 0:
                session.get(key, lambda _: None, payload=data, timeout=0.1)
            elif number % 5 == 0:
                session.delete(key)
            else:
                session.put(key, data)
            if number % 100 == 0:
                pause.wait(0.005)
    finally:
        close_session(session)
