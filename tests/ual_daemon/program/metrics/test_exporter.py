from __future__ import annotations

import logging
import re
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from urllib.error import HTTPError

import pytest
from prometheus_client.parser import text_string_to_metric_families as parsed_older

from tests.descriptors import no_descriptors
from tests.ual_daemon.program.metrics.scraped import parsed, scraped, text_of
from tests.waiting import LIMIT_S, until
from ual_daemon.program.metrics import http_server
from ual_daemon.program.metrics.catalogue import CATALOGUE, MetricSample
from ual_daemon.program.metrics.exporter import VALUES_AGE_LIMIT_S, Collected, Exporter, families
from ual_daemon.server.addresses import Address

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "metrics.md"
UP = MetricSample("ual_up", "", {"ns": "uav_1"}, 1.0)
LATE = [
    MetricSample("ual_setpoint_lateness_seconds", "_bucket", {"ns": "uav_1", "le": le}, 2.0) for le in ("0.01", "+Inf")
] + [
    MetricSample("ual_setpoint_lateness_seconds", "_count", {"ns": "uav_1"}, 2.0),
    MetricSample("ual_setpoint_lateness_seconds", "_sum", {"ns": "uav_1"}, 0.01),
]
SENT = MetricSample("ual_setpoints_sent", "_total", {"ns": "uav_1"}, 3.0)


@pytest.fixture
def serve() -> Iterator[Callable[[Callable[[], Iterable[MetricSample]]], str]]:
    """Serves what a function gathers; where."""
    exporters: list[Exporter] = []

    def start(gather: Callable[[], Iterable[MetricSample]]) -> str:
        exporters.append(Exporter(Address("127.0.0.1", 0)))
        exporters[-1].start(gather)
        return str(exporters[-1].address)

    yield start
    for each in exporters:
        each.close()


Serve = Callable[[Callable[[], Iterable[MetricSample]]], str]


def position_of(address: str) -> tuple[str, int]:
    host, _, port = address.partition(":")
    return host, int(port)


def connection_to(address: str) -> socket.socket:
    return socket.create_connection(position_of(address), LIMIT_S)


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


def test_however_often_it_is_queried_it_gathers_at_most_twice_a_second() -> None:
    gathered = []
    now_s = 5.0

    def gather() -> list[MetricSample]:
        gathered.append(now_s)
        return [UP]

    collected = Collected(gather, lambda: now_s)
    for _ in range(10):
        assert [metric.name for metric in collected.collect()] == ["ual_up"]
    assert gathered == [5.0]
    now_s += VALUES_AGE_LIMIT_S
    list(collected.collect())
    assert len(gathered) == 2


def test_a_defect_is_logged_and_the_next_request_is_answered(serve: Serve, caplog: pytest.LogCaptureFixture) -> None:
    defects: list[Exception] = [ZeroDivisionError("a defect")]

    def gather() -> list[MetricSample]:
        if defects:
            raise defects.pop()
        return [UP]

    address = serve(gather)
    with caplog.at_level(logging.ERROR), pytest.raises(HTTPError, match="500") as caught:
        text_of(address)
    caught.value.close()
    assert "metrics: an entry could not be processed, the others are; this is a defect of UAL" in caplog.text
    assert scraped(address)("ual_up", ns="uav_1") == 1.0


def test_whoever_asks_is_served_at_once_next_to_those_that_say_nothing(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_server, "REQUEST_S", 10.0 * LIMIT_S)
    address = serve(lambda: [UP])
    with ExitStack() as held:
        for _ in range(3 * http_server.MOST_CONNECTIONS):
            held.enter_context(connection_to(address)).sendall(b"GET /metrics HTTP/1.1\r\nX: ")
        assert scraped(address)("ual_up") == 1.0


def test_a_request_has_a_limit_however_slowly_its_bytes_drip(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "REQUEST_S", 0.2)
    address = serve(lambda: [UP])
    with connection_to(address) as dripping:
        dripping.settimeout(0.02)

        def is_left() -> bool:
            try:
                dripping.send(b"a")
                return dripping.recv(1) == b""
            except TimeoutError:
                return False
            except ConnectionError:
                return True

        until(is_left, "the end of the connection")


@pytest.mark.parametrize("request_", [b"\r\n\r\n", b"hello\r\n\r\n", b"GET / RTSP/1.0\r\n\r\n", b"GET /\r\n\r\n"])
def test_what_is_no_request_is_refused(serve: Serve, request_: bytes) -> None:
    with connection_to(serve(lambda: [UP])) as asking:
        asking.sendall(request_)
        assert asking.recv(100).startswith(b"HTTP/1.1 400 ")


def test_an_endless_request_is_left(serve: Serve) -> None:
    with connection_to(serve(lambda: [UP])) as asking, suppress(ConnectionError):
        asking.sendall(b"GET / HTTP/1.1\r\nX: " + b"a" * 100_000)
        assert asking.recv(1) == b""


def test_whoever_does_not_read_the_answer_delays_nobody(serve: Serve) -> None:
    many = [UP._replace(labels={"ns": f"uav_{number}"}) for number in range(20_000)]
    address = serve(lambda: many)
    with connection_to(address) as asking:
        asking.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
        assert asking.recv(1) == b"H"
        assert scraped(address)("ual_up", ns="uav_7") == 1.0


def test_the_end_waits_for_no_client_and_for_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "REQUEST_S", 10.0 * LIMIT_S)
    monkeypatch.setattr(http_server, "_THREAD_END_S", 10.0 * LIMIT_S)
    is_asked, may_go_on = threading.Event(), threading.Event()

    def gather() -> list[MetricSample]:
        is_asked.set()
        may_go_on.wait(LIMIT_S)
        return [UP]

    served = Exporter(Address("127.0.0.1", 0))
    served.start(gather)
    try:
        with connection_to(str(served.address)), connection_to(str(served.address)) as asking:
            asking.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
            assert is_asked.wait(LIMIT_S)
            served.close()
            assert asking.recv(1) == b""
    finally:
        may_go_on.set()


def test_without_file_descriptors_it_says_so_once_and_waits(
    serve: Serve, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_server, "_ACCEPT_RETRY_S", 0.1)
    address = serve(lambda: [UP])
    (thread,) = (each for each in threading.enumerate() if each.name == "metrics")
    with closing(socket.socket()) as asking, caplog.at_level(logging.INFO):
        with no_descriptors():
            asking.connect(position_of(address))
            until(lambda: "connections_fail" in caplog.text, "the line")
            before_s = used_s(thread)
            time.sleep(0.5)  # in which it would spin
            assert used_s(thread) - before_s < 0.03
        until(lambda: "connections_recovered server=metrics" in caplog.text, "the connection")
    assert scraped(address)("ual_up") == 1.0
    assert re.findall("connections_fail .*", caplog.text) == [
        'connections_fail server=metrics why="Too many open files" retry_s=0.1'
    ]


def used_s(thread: threading.Thread) -> float:
    """The processor time of a thread."""
    assert thread.ident is not None
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))


def test_the_end_frees_the_port() -> None:
    first = Exporter(Address("127.0.0.1", 0))
    first.start(lambda: [UP])
    first.close()
    Exporter(first.address).close()
