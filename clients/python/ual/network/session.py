"""Opens a session of Zenoh. The only module, besides those that publish and listen, that knows Zenoh."""

from __future__ import annotations

import ctypes
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from typing_extensions import Self

from ual import _forks
from ual.errors import ClientUnusableError, DaemonUnreachableError, InvalidArgumentError
from ual.network import configuration
from ual.network.lost_links import LostLinks
from ual.network.settings import NetworkSettings
from ual.shared import extras
from ual.shared.renamed import renamed

if TYPE_CHECKING:
    import zenoh

_MOST_SIGNS, _MOST_REPORTS = 1024, 512
_ROUTER_POLL_S = 0.5
_OPEN_RETRY_S = 0.2
"""The pause after all routers were tried."""


class _Sessions:
    """The sessions of this process. In a forked one Zenoh's threads are missing.

    There a session can be neither closed, nor freed, nor opened: each would wait for these threads without an end.
    """

    def __init__(self) -> None:
        self._open: list[zenoh.Session] = []
        self._is_used = False
        self._is_lost = False
        _forks.renew_in_child(self)

    def open(self, config: zenoh.Config) -> zenoh.Session:
        import zenoh

        if self._is_lost:
            raise forked()
        self._is_used = True
        session = zenoh.open(config)
        self._open.append(session)
        return session

    def close(self, session: zenoh.Session) -> None:
        if self._is_lost or session not in self._open:
            return
        self._open.remove(session)
        session.close()  # type: ignore[no-untyped-call]  # Zenoh's stub says nothing of it

    def begin_anew(self) -> None:
        self._is_lost = self._is_used
        for session in self._open:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(session))  # nothing frees it any more


_sessions = _Sessions()


def forked() -> ClientUnusableError:
    """Returns the error of the network of a parent."""
    return ClientUnusableError(
        "the network was joined before this process was forked, which Zenoh does not survive: begin the process by "
        "multiprocessing's 'spawn', or before the network is first used"
    )


def require(what: str, extra: str) -> None:
    """Loads Zenoh.

    Raises:
        NotSupportedError: It is not installed: the message says which extra to install.

    """
    with extras.needs(what, extra):
        import zenoh  # noqa: F401


def open_session(settings: NetworkSettings, timeout_s: float) -> zenoh.Session:
    """Joins the network. The session must be closed: else the program may hang at its end.

    Each router is tried once, in their order, and all of them again until the time is up. One that refuses takes no
    time; one that is silent takes two seconds.

    Raises:
        DaemonUnreachableError: No router answers in time.
        InvalidArgumentError: Zenoh refuses the settings, as where a certificate cannot be read.
        ClientUnusableError: This process was forked from one that had used the network.

    """
    import zenoh

    for path in filter(None, (settings.certificate, settings.key, settings.authority)):
        _require_readable(str(path))
    text = configuration.of(settings)
    until_s = time.monotonic() + timeout_s
    while True:
        try:
            return _sessions.open(zenoh.Config.from_json5(text))
        except zenoh.ZError as error:
            if not settings.connect:
                raise InvalidArgumentError(f"network: {error}", {"field": "network"}) from None
        if time.monotonic() + _OPEN_RETRY_S > until_s:
            raise DaemonUnreachableError(
                f"no router of the network answers ({', '.join(settings.connect)}), or none that knows this certificate"
            )
        time.sleep(_OPEN_RETRY_S)


def queue() -> zenoh.handlers.FifoChannel[zenoh.Sample]:
    """Returns where signs of life wait until they are read. None is lost: while it is full, the network waits."""
    import zenoh

    made: zenoh.handlers.FifoChannel[zenoh.Sample] = zenoh.handlers.FifoChannel(_MOST_SIGNS)
    return made


def ring() -> zenoh.handlers.RingChannel[zenoh.Sample]:
    """Returns where reports wait until they are read. A reader that is too slow gets the newest, not old ones."""
    import zenoh

    made: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(_MOST_REPORTS)
    return made


def close_session(session: zenoh.Session) -> None:
    """Leaves the network. That of a parent stays open, and is the parent's."""
    _sessions.close(session)


def has_router(session: zenoh.Session, settings: NetworkSettings) -> bool:
    """Returns whether the session reaches a router; peers need none."""
    return not settings.connect or bool(session.info.routers_zid())


def _require_readable(path: str) -> None:
    from ual.credentials import read

    read(path, "network")


class RouterSession:
    """A router, from the construction until the end of its block.

    Args:
        file: Its configuration, as Zenoh reads it.

    Raises:
        InvalidArgumentError: The file is none, or its addresses cannot be had.

    """

    def __init__(self, file: Path) -> None:
        import zenoh

        zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]  # RUST_LOG shows what is refused, as in zenohd
        try:
            config = zenoh.Config.from_file(file)
            self._session = _sessions.open(config)
        except zenoh.ZError as error:
            raise InvalidArgumentError(f"{file}: the router cannot run: {error}", {"field": "file"}) from None
        self._links = LostLinks(self._session.info.links)
        self.identifier = str(self._session.zid())
        endpoints = json.loads(config.get_json("listen/endpoints"))
        self.listen: Sequence[str] = endpoints

    def run(self) -> None:
        """Runs until it is interrupted."""
        while True:
            self.keep_links()
            time.sleep(_ROUTER_POLL_S)

    def keep_links(self) -> None:
        """Sees to it that connections without an answer end; to be called repeatedly."""
        self._links.keep()

    look = renamed(keep_links, "RouterSession.look")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        close_session(self._session)
