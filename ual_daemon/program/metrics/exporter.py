"""Serves the metrics over HTTP, by a thread of its own, one request after the other.

Nothing that flies waits for it. The values are gathered at most twice a second, however often they are asked for.
"""

from __future__ import annotations

import logging
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, TypeAlias
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer

import prometheus_client
from prometheus_client.core import Metric
from typing_extensions import override

from ual.shared.guard import WorkGuard
from ual_daemon import logs
from ual_daemon.program.metrics.catalogue import CATALOGUE, Sample
from ual_daemon.server.addresses import Address

Application: TypeAlias = Callable[[dict[str, Any], Any], Iterable[bytes]]
"""An application of WSGI."""

_log = logging.getLogger(__name__)

FRESH_S = 0.5
"""Values that are not older than this are served again: no number of requests takes more time from the flight."""
_REQUEST_S = 2.0
"""A client that sends nothing for so long is left, as the next one waits."""
_END_S = 5.0
_AFTER_DEFECT_S = 0.1
"""The pause after a request that ended in an exception: without one it could take all of a core."""


class Collected(prometheus_client.registry.Collector):
    """The values of a function, as metrics of prometheus_client."""

    def __init__(self, gather: Callable[[], Iterable[Sample]], clock: Callable[[], float] = time.monotonic) -> None:
        self._gather = gather
        self._clock = clock
        self._gathered_s = float("-inf")
        self._metrics: Sequence[Metric] = ()

    @override
    def collect(self) -> Iterator[Metric]:
        now_s = self._clock()
        if now_s - self._gathered_s >= FRESH_S:
            self._metrics, self._gathered_s = families(self._gather()), now_s
        yield from self._metrics

    def describe(self) -> Iterator[Metric]:
        """Yields nothing: whoever registers it must not gather."""
        return iter(())


def families(samples: Iterable[Sample]) -> list[Metric]:
    """Returns the metrics with their values, in the order of the catalogue: those that have values."""
    found = {name: Metric(name, each.text, each.kind, each.unit) for name, each in CATALOGUE.items()}
    for sample in samples:
        found[sample.metric].add_sample(sample.metric + sample.suffix, dict(sample.labels), sample.value)
    return [metric for metric in found.values() if metric.samples]


def _guarded(app: Application) -> Application:
    """Returns the application with its defects in the log, instead of on stderr."""
    guard = WorkGuard("metrics")

    def answer(environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:  # noqa: ANN401  as WSGI has it
        try:
            return app(environ, start_response)
        except Exception as error:  # noqa: BLE001  a defect concerns the metrics only
            guard.note(error)
            start_response("500 Internal Server Error", [])
            return ()

    return answer


class _Handler(WSGIRequestHandler):
    timeout = _REQUEST_S

    @override
    def log_message(self, format: str, *args: object) -> None:
        _log.debug("metrics: %s", format % args)


class _Server(WSGIServer):
    """Listens, and asks no name server for its own name, as its base would."""

    def __init__(self, address: Address) -> None:
        self.address_family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        super().__init__((address.host, address.port), _Handler)

    @override
    def server_bind(self) -> None:
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]  # type: ignore[assignment]
        self.setup_environ()

    @override
    def handle_error(self, request: object, client_address: object) -> None:
        _log.debug("a request for metrics failed", exc_info=True)


class Exporter:
    """Serves what a function gathers, from `start` to `close`. Its port is open before `start`."""

    def __init__(self, address: Address) -> None:
        """Opens the port.

        Raises:
            OSError: It cannot be had.

        """
        self._server = _Server(address)
        self.address = Address(address.host, self._server.server_port)
        self._is_closing = False
        self._guard = WorkGuard("metrics")
        self._thread = threading.Thread(target=self._run, name="metrics", daemon=True)

    def start(self, gather: Callable[[], Iterable[Sample]]) -> None:
        """Begins to serve. `gather` is called on the exporter's thread."""
        registry = prometheus_client.CollectorRegistry(auto_describe=False)
        registry.register(Collected(gather))
        self._server.set_app(_guarded(prometheus_client.make_wsgi_app(registry)))
        self._thread.start()
        logs.event(_log, logging.INFO, "metrics", address=str(self.address))

    def leave(self) -> None:
        """Closes the port in a process that has inherited it and does not serve it."""
        self._server.server_close()

    def close(self) -> None:
        """Ends it. Waits for the request that is answered."""
        self._is_closing = True
        if self._thread.is_alive():
            with suppress(OSError), socket.create_connection((self.address.host, self.address.port), _REQUEST_S):
                pass  # the thread looks
            self._thread.join(_END_S)
        self._server.server_close()

    def _run(self) -> None:
        while not self._is_closing:
            if not self._guard.contain(self._server.handle_request):
                time.sleep(_AFTER_DEFECT_S)
