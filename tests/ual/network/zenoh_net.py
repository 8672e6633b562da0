"""Routers, daemons and listeners over real Zenoh on loopback, each closed with its test."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path

from tests.ports import free_port
from tests.ual.network.samples import source
from ual.network import configuration
from ual.network.listening import Network
from ual.network.publishing import Publication
from ual.network.session import RouterSession
from ual.network.settings import NetworkSettings
from ual.network.values import Report

JOIN_S = 30.0
_PAUSE_S = 0.01


def saying(told: Publication, once: Report) -> Callable[[], None]:
    """Returns a function that repeats a report between two looks of `tests.waiting.until`."""

    def say() -> None:
        told.put(once)
        time.sleep(_PAUSE_S)  # the pause of `until`

    return say


class ZenohNet:
    """One router without certificates, and what joins it. A site of its own keeps tests apart."""

    def __init__(self, directory: Path, stack: ExitStack) -> None:
        self._stack = stack
        self._directory = directory
        self.site = f"s{secrets.token_hex(4)}"
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.settings = NetworkSettings(site=self.site, connect=(self.endpoint,))

    def router(self, *connect: str, endpoint: str = "") -> ExitStack:
        """Starts a router; closing what is returned ends it."""
        at = endpoint or self.endpoint
        file = self._directory / f"{at.rpartition(':')[2]}.json5"
        file.write_text(json.dumps(configuration.router(self.settings, listen=[at], connect=connect)))
        running = self._stack.enter_context(ExitStack())
        running.enter_context(RouterSession(file))
        return running

    def publication(
        self, publisher: str = "uav_1", instance: int = 1, settings: NetworkSettings | None = None
    ) -> Publication:
        """A daemon's presence."""
        by = source(publisher, instance, self.site)
        return self._stack.enter_context(closing(Publication(settings or self.settings, by, JOIN_S)))

    def network(self, settings: NetworkSettings | None = None) -> Network:
        """Returns a listener."""
        return self._stack.enter_context(Network(settings or self.settings, timeout_s=JOIN_S))
