from __future__ import annotations

import logging
import re
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from urllib.error import HTTPError

import pytest
from prometheus_client.parser import text_string_to_metric_families as parsed_older

from tests.ual_daemon.program.metrics.scraped import parsed, scraped, text_of
from ual_daemon.program.metrics import exporter
from ual_daemon.program.metrics.catalogue import CATALOGUE, Sample
from ual_daemon.program.metrics.exporter import FRESH_S, Collected, Exporter, families
from ual_daemon.server.addresses import Address

PAGE = Path(__file__).parents[4] / "docs" / "metrics.md"
UP = Sample("ual_up", "", {"ns": "uav_1"}, 1.0)
LATE = [
    Sample("ual_setpoint_lateness_seconds", "_bucket", {"ns": "uav_1", "le": le}, 2.0) for le in ("0.01", "+Inf")
] + [
    Sample("ual_setpoint_lateness_seconds", "_count", {"ns": "uav_1"}, 2.0),
    Sample("ual_setpoint_lateness_seconds", "_sum", {"ns": "uav_1"}, 0.01),
]
SENT = Sample("ual_setpoints_sent", "_total", {"ns": "uav_1"}, 3.0)


@pytest.fixture
def serve() -> Iterator[Callable[[Callable[[], Iterable[Sample]]], str]]:
    """Serves what a function gathers; where."""
    exporters: list[Exporter] = []

    def start(gather: Callable[[], Iterable[Sample]]) -> str:
        exporters.append(Exporter(Address("127.0.0.1", 0)))
        exporters[-1].start(gather)
        return str(exporters[-1].address)

    yield start
    for each in exporters:
        each.close()


Serve = Callable[[Callable[[], Iterable[Sample]]], str]


def test_it_speaks_openmetrics_and_the_older_text(serve: Serve) -> None:
    address = serve(lambda: [UP, *LATE, SENT])
    text, kind = text_of(address)
    assert kind.startswith("application/openmetrics-text; version=1.0.0")
    found = {family.name: family for family in parsed(text)}
    assert {name: family.type for name, family in found.items()} == {
        "ual_up": "gauge",
        "ual_setpoints_sent": "counter",
        "ual_setpoint_lateness_seconds": "histogram",
    }
    assert found["ual_setpoint_lateness_seconds"].unit == "seconds"
    older, kind = text_of(address, accept="")
    assert kind.startswith("text/plain")
    names = {sample.name for family in parsed_older(older) for sample in family.samples}
    assert {"ual_up", "ual_setpoints_sent_total", "ual_setpoint_lateness_seconds_bucket"} <= names


def test_the_values_of_several_uavs_stand_together() -> None:
    second = UP._replace(labels={"ns": "uav_2"})
    (metric,) = families([UP, second])
    assert [sample.labels["ns"] for sample in metric.samples] == ["uav_1", "uav_2"]


def test_names_end_in_their_unit_and_are_of_the_project() -> None:
    for name, metric in CATALOGUE.items():
        assert name.startswith("ual_")
        assert not name.endswith(("_total", "_count", "_sum", "_bucket", "_info"))
        assert not metric.unit or name.endswith(f"_{metric.unit}")
        assert metric.text.endswith(".")


def test_the_page_has_all_of_them_and_no_other() -> None:
    suffixes = {"counter": "_total", "info": "_info"}
    served = {name + suffixes.get(metric.kind, "") for name, metric in CATALOGUE.items()}
    assert set(re.findall(r"^\| `(ual_\w+)`", PAGE.read_text(), re.MULTILINE)) == served


def test_however_often_it_is_asked_it_gathers_at_most_twice_a_second() -> None:
    gathered = []
    now_s = 5.0

    def gather() -> list[Sample]:
        gathered.append(now_s)
        return [UP]

    collected = Collected(gather, lambda: now_s)
    for _ in range(10):
        assert [metric.name for metric in collected.collect()] == ["ual_up"]
    assert gathered == [5.0]
    now_s += FRESH_S
    list(collected.collect())
    assert len(gathered) == 2


def test_a_defect_is_logged_and_the_next_request_is_answered(serve: Serve, caplog: pytest.LogCaptureFixture) -> None:
    defects: list[Exception] = [ZeroDivisionError("a defect")]

    def gather() -> list[Sample]:
        if defects:
            raise defects.pop()
        return [UP]

    address = serve(gather)
    with caplog.at_level(logging.ERROR), pytest.raises(HTTPError, match="500") as caught:
        text_of(address)
    caught.value.close()
    assert "metrics: an entry could not be processed, the others are; this is a defect of UAL" in caplog.text
    assert scraped(address)("ual_up", ns="uav_1") == 1.0


def test_who_connects_and_says_nothing_is_left_after_a_while(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exporter._Handler, "timeout", 0.1)
    address = serve(lambda: [UP])
    host, _, port = address.partition(":")
    with closing(socket.create_connection((host, int(port)))):
        assert scraped(address)("ual_up") == 1.0


def test_the_end_frees_the_port() -> None:
    first = Exporter(Address("127.0.0.1", 0))
    first.start(lambda: [UP])
    first.close()
    Exporter(first.address).close()
