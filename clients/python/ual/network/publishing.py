"""Tells the network of a process and its UAVs: one liveliness token, and reports. It takes nothing from the network."""

from __future__ import annotations

import zenoh

from ual.network.keys import Source
from ual.network.lost_links import LostLinks
from ual.network.session import close_session, has_router, open_session
from ual.network.settings import NetworkSettings
from ual.network.values import Report
from ual.wire import network as wire


class Publication:
    """A process that is present on the network from the construction until `close`.

    Raises:
        DaemonUnreachableError: No router answers in time.
        InvalidArgumentError: Zenoh refuses the settings.

    """

    def __init__(self, settings: NetworkSettings, source: Source, timeout_s: float) -> None:
        self._settings = settings
        self._key = source.telemetry
        self._session = open_session(settings, timeout_s)
        self._links = LostLinks(self._session.info.links)
        try:
            self._token = self._session.liveliness().declare_token(source.alive)
        except BaseException:
            close_session(self._session)
            raise

    @property
    def is_connected(self) -> bool:
        """Whether the network is reached; Zenoh connects again by itself."""
        return has_router(self._session, self._settings)

    def put(self, report: Report) -> None:
        """Tells. What cannot be sent at once is dropped: the next report is newer."""
        self._links.keep()
        self._session.put(
            self._key,
            wire.report_to_bytes(report),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
        )

    def close(self) -> None:
        """Leaves the network."""
        close_session(self._session)
