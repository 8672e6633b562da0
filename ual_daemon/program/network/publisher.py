"""Tells the network of the UAVs of this process, on a thread of its own.

It requests samples as any reader does, and yields between two UAVs. So a flight never waits for it. While no router
answers it tries again, and says so once.
"""

from __future__ import annotations

import logging
import os
import secrets
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from ual.errors import UalError
from ual.network import computer
from ual.network.keys import Source
from ual.network.publishing import Publication
from ual.network.settings import NetworkSettings
from ual.network.values import Report, Teller, UavReport
from ual.shared.guard import WorkGuard
from ual_daemon import logs
from ual_daemon._version import __version__
from ual_daemon.program.network.announcement import UavAnnouncement

_log = logging.getLogger(__name__)

_UAVS_PER_REPORT = 128
"""UAVs: about 40 kB, less than what Zenoh sends as one piece."""
_JOIN_S = 1.0
_RETRY_S = 1.0
_PUBLISH_PAUSE_S = 0.001
_CLOSE_TIMEOUT_S = 8.0
"""Longer than it may wait for a router: a thread that came back from Zenoh while Python ends would abort it."""
_INSTANCE_BYTES = 8


class Publisher:
    """Tells the network from `start` to `close`.

    Args:
        settings: The network.
        publisher: For which UAVs this process may speak: `ual.network.keys.publisher`.

    """

    def __init__(self, settings: NetworkSettings, publisher: str) -> None:
        self._settings = settings
        self._source = Source(settings.site, publisher, secrets.token_hex(_INSTANCE_BYTES))
        self._host = settings.host or computer.host()
        self._uavs: Sequence[UavAnnouncement] = ()
        self._is_closing = threading.Event()
        self._guard = WorkGuard("network")
        self._is_connected: bool | None = None
        self._thread = threading.Thread(target=self._run, name="network", daemon=True)

    def start(self, uavs: Sequence[UavAnnouncement]) -> None:
        """Begins to tell of UAVs, once they are served."""
        self.begin(uavs)
        self._thread.start()

    def begin(self, uavs: Sequence[UavAnnouncement]) -> None:
        """Takes note of the UAVs to tell of."""
        self._uavs = uavs
        self._teller = Teller(
            __version__,
            computer.host(),
            computer.identifier(),
            os.getpid(),
            time.time(),
            self._settings.rate_hz,
            len(uavs),
        )

    def close(self) -> None:
        """Leaves the network: its UAVs are gone there at once."""
        self._is_closing.set()
        if self._thread.ident is not None:
            self._thread.join(_CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        publication = self._join()
        if publication is None:
            return
        try:
            self._publish(publication)
        finally:
            publication.close()

    def _join(self) -> Publication | None:
        """Returns the way into the network, as soon as there is one; None if it is closed before."""
        while not self._is_closing.is_set():
            try:
                return Publication(self._settings, self._source, _JOIN_S)
            except UalError as error:
                self._note(is_connected=False, why=str(error))
            except Exception as error:  # noqa: BLE001  such as a router's answer that the library does not know
                self._guard.note(error)
                self._note(is_connected=False, why=self._guard.last_cause)
            self._is_closing.wait(_RETRY_S)
        return None

    def _publish(self, publication: Publication) -> None:
        period_s = 1.0 / self._settings.rate_hz
        due_s = time.monotonic()
        while not self._is_closing.is_set():
            self._guard.contain(lambda: self._note(is_connected=publication.is_connected, why="no router is reached"))
            for report in self.reports(period_s):
                self._put(publication, report)
            due_s = max(due_s + period_s, time.monotonic())
            self._is_closing.wait(due_s - time.monotonic())

    def _put(self, publication: Publication, report: Report) -> None:
        """Tells of UAVs, and where that fails of each by itself: one of them must not silence the others."""
        if not self._guard.contain(partial(publication.put, report)):
            for uav in report.uavs:
                self._guard.contain(partial(publication.put, replace(report, uavs=(uav,))))

    def reports(self, period_s: float) -> Iterator[Report]:
        """Makes what is reported at once, in pieces, and leaves time to others between two UAVs."""
        pause_s = min(_PUBLISH_PAUSE_S, period_s / 4.0 / len(self._uavs))
        for begin in range(0, len(self._uavs), _UAVS_PER_REPORT):
            parts: list[UavReport] = []
            for uav in self._uavs[begin : begin + _UAVS_PER_REPORT]:
                found = self._guard.run(partial(uav.report, self._host), _nothing)
                parts += [] if found is None else [found]
                time.sleep(pause_s)  # a flight's thread runs meanwhile
            yield Report(self._teller, tuple(parts))

    def _note(self, *, is_connected: bool, why: str) -> None:
        """Logs when the network is reached, and when it is not any more."""
        if is_connected is self._is_connected:
            return
        self._is_connected = is_connected
        where = " ".join(self._settings.connect) or self._settings.means.value
        if is_connected:
            publisher = self._source.publisher
            logs.event(_log, logging.INFO, "network_joined", site=self._settings.site, at=where, publisher=publisher)
        else:
            logs.event(_log, logging.WARNING, "network_lost", site=self._settings.site, at=where, why=why)


def _nothing(_: str) -> None:
    """Returns the report of a UAV whose state cannot be read."""
