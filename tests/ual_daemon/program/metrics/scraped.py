"""Metrics as a test asks for them."""

from __future__ import annotations

import urllib.request
from collections.abc import Iterable
from typing import Any

from prometheus_client.core import Metric
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from tests.waiting import LIMIT_S
from ual_daemon.program.metrics.catalogue import MetricSample

OPENMETRICS = "application/openmetrics-text; version=1.0.0"


class Values:
    """Samples, by name and labels: ``values("ual_state", state="LANDING")``. The name includes the suffix."""

    def __init__(self, samples: Iterable[Any]) -> None:
        """`samples` are those of prometheus_client, or with `name` as metric and suffix."""
        self._samples = [(str(each.name), dict(each.labels), float(each.value)) for each in samples]

    @classmethod
    def of(cls, samples: Iterable[MetricSample]) -> Values:
        found = Metric("all", "", "untyped")
        for each in samples:
            found.add_sample(each.metric + each.suffix, dict(each.labels), each.value)
        return cls(found.samples)

    def all(self, name: str, **labels: str) -> list[float]:
        return [value for found, has, value in self._samples if found == name and labels.items() <= has.items()]

    def __call__(self, name: str, **labels: str) -> float:
        """Returns the single value."""
        (value,) = self.all(name, **labels)
        return value

    def labels(self, name: str, label: str) -> list[str]:
        """The values of a label, of all samples of that name that are not 0."""
        return [has[label] for found, has, value in self._samples if found == name and value]


def text_of(address: str, accept: str = OPENMETRICS) -> tuple[str, str]:
    """Returns the served text, and its content type."""
    request = urllib.request.Request(f"http://{address}/metrics", headers={"Accept": accept})
    with urllib.request.urlopen(request, timeout=LIMIT_S) as answer:
        return answer.read().decode(), str(answer.headers["Content-Type"])


def parsed(text: str) -> list[Metric]:
    """The metrics of OpenMetrics' text."""
    return list(text_string_to_metric_families(text))  # type: ignore[no-untyped-call]


def scraped(address: str) -> Values:
    text, _ = text_of(address)
    return Values(sample for family in parsed(text) for sample in family.samples)
