"""Serves the metrics over HTTP, by threads of their own.

Nothing that flies waits for them. The values are gathered at most twice a second, however often they are requested.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import prometheus_client
from prometheus_client.core import Metric
from typing_extensions import override

from ual_daemon import logs
from ual_daemon.program.metrics.catalogue import CATALOGUE, MetricSample
from ual_daemon.program.metrics.http_server import HttpServer
from ual_daemon.server.addresses import Address

_log = logging.getLogger(__name__)

VALUES_AGE_LIMIT_S = 0.5
"""Values that are not older than this are served again: no number of requests takes more time from the flight."""


class Collected(prometheus_client.registry.Collector):
    """The values of a function, as metrics of prometheus_client."""

    def __init__(
        self, gather: Callable[[], Iterable[MetricSample]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._gather = gather
        self._clock = clock
        self._gathered_s = float("-inf")
        self._metrics: Sequence[Metric] = ()

    @override
    def collect(self) -> Iterator[Metric]:
        now_s = self._clock()
        if now_s - self._gathered_s >= VALUES_AGE_LIMIT_S:
            self._metrics, self._gathered_s = families(self._gather()), now_s
        yield from self._metrics

    def describe(self) -> Iterator[Metric]:
        """Yields nothing: its registration must not gather."""
        return iter(())


def families(samples: Iterable[MetricSample]) -> list[Metric]:
    """Returns the metrics with their values, in the order of the catalogue: those that have values."""
    found = {name: Metric(name, each.text, each.kind, each.unit) for name, each in CATALOGUE.items()}
    for sample in samples:
        found[sample.metric].add_sample(sample.metric + sample.suffix, dict(sample.labels), sample.value)
    return [metric for metric in found.values() if metric.samples]


class Exporter:
    """Serves what a function gathers, from `start` to `close`. Its port is open before `start`."""

    def __init__(self, address: Address) -> None:
        """Opens the port.

        Raises:
            OSError: It cannot be had.

        """
        self._server = HttpServer(address, "metrics")
        self.address = self._server.address

    def start(self, gather: Callable[[], Iterable[MetricSample]]) -> None:
        """Begins to serve. `gather` is called on a thread of the exporter's."""
        registry = prometheus_client.CollectorRegistry(auto_describe=False)
        registry.register(Collected(gather))
        self._server.start(prometheus_client.make_wsgi_app(registry))
        logs.event(_log, logging.INFO, "metrics", address=str(self.address))

    def leave(self) -> None:
        """Closes the port in a process that has inherited it and does not serve it."""
        self._server.leave()

    def close(self) -> None:
        """Ends it. Waits for no client."""
        self._server.close()
