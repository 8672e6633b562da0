"""The descriptions of an autopilot's parameters: read once from its files, by a thread of their own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, InvalidStateError
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress

from ual.errors import LinkLostError, UalError
from ual.parameters.values import Description
from ual_daemon import logs
from ual_daemon.backends.mavlink.dialects import parameter_files
from ual_daemon.backends.mavlink.offers.files import has_files
from ual_daemon.backends.mavlink.protocols.component_metadata import MetadataFile
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import MavlinkSession

Descriptions = Mapping[str, Description]

_log = logging.getLogger(__name__)

ANSWER_TIMEOUT_S = 5.0
"""Seconds for which descriptions are awaited: over a slow link they are there the next time."""
READ_S = 600.0
MOST_GENERAL, MOST_PARAMETERS = 100_000, 2_000_000
"""Most bytes of the two files."""


class ParameterDescriptions:
    """Descriptions of the parameters of one session. From any thread.

    Args:
        session: Whose parameters they are.
        post: Has something done on the thread that receives.
    """

    def __init__(self, session: MavlinkSession, post: Callable[[Callable[[Discovery], None]], None]) -> None:
        self.session = session
        self.is_cut_off = False
        """Whether the link was lost meanwhile, so that they may be read again."""
        self._post = post
        self._loaded: Future[Descriptions] = Future()
        if session.dialect.has_descriptions and has_files(session):
            threading.Thread(target=self._load, name="parameter descriptions", daemon=True).start()
        else:
            self._loaded.set_result({})

    def get(self) -> Future[Descriptions]:
        """Returns them, or nothing where they are not there soon."""
        answer: Future[Descriptions] = Future()
        limit = threading.Timer(ANSWER_TIMEOUT_S, _end, (answer, {}))
        limit.daemon = True

        def on_loaded(loaded: Future[Descriptions]) -> None:
            limit.cancel()
            _end(answer, loaded.result())

        limit.start()
        self._loaded.add_done_callback(on_loaded)
        return answer

    def _load(self) -> None:
        found: Descriptions = {}
        try:
            found = self._read()
        except (UalError, ValueError, FutureTimeoutError) as error:
            self.is_cut_off = isinstance(error, LinkLostError)
            logs.event(_log, logging.WARNING, "parameter_descriptions_missing", why=str(error))
        finally:
            self._loaded.set_result(found)

    def _read(self) -> Descriptions:
        address: Future[MetadataFile] = Future()
        self._post(lambda discovery: discovery.protocols.component_metadata.request(address))
        uri, crc = address.result(READ_S)
        where = parameter_files.parameters_uri(self._content(uri, crc, MOST_GENERAL))
        return {} if where is None else parameter_files.descriptions(self._content(*where, MOST_PARAMETERS))

    def _content(self, uri: str, crc: int, most: int) -> bytes:
        """Reads a file of the autopilot. The web is never asked."""
        path = parameter_files.file_path(uri)
        if path is None:
            raise ValueError(f"{uri:.100} is not on the autopilot")
        data: Future[bytes] = Future()
        self._post(
            lambda discovery: discovery.protocols.files.run(data, discovery.protocols.files.read_all(path, most))
        )
        return parameter_files.unpacked(data.result(READ_S), crc)


def _end(future: Future[Descriptions], result: Descriptions) -> None:
    with suppress(InvalidStateError):  # it was not there in time, or is not waited for any more
        future.set_result(result)
