"""The link against the small rosbridge, over real sockets: what it hears, loses and finds again."""

from __future__ import annotations

import math
import socket
import ssl
import subprocess
import threading
import time
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from typing_extensions import override

from tests.simulators.rosbridge import Bridge, Message, RefusedError
from tests.simulators.rosbridge_server import RosbridgeServer
from tests.waiting import until
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.rosbridge import BridgeUrl, RosbridgeLink, RosbridgeState, RosGeneration, parse_url
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.rosbridge.fields import number, numbers, stamp_s
from ual_daemon.backends.rosbridge.websocket import BridgeTransport, dial

STAMP = {"sec": 12, "nanosec": 500_000_000}


class Talker:
    """Publishes a counter at 100 Hz, an array now and then, and hears setpoints."""

    def __init__(self) -> None:
        self.heard: list[Message] = []
        self.count = 0

    @property
    def topics(self) -> Mapping[str, str]:
        return {"/uav/count": "test_msgs/Count"}

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        return {"/uav/setpoint": ("test_msgs/Setpoint", self.heard.append)}

    @property
    def services(self) -> Mapping[str, Callable[[Message], Message]]:
        return {"/uav/add": lambda args: {"sum": args["a"] + args["b"]}, "/uav/refuse": self._refuse}

    def _refuse(self, _: Message) -> Message:
        raise RefusedError("not today")

    def step(self, now_s: float) -> Iterable[tuple[str, Message]]:
        self.count += 1
        values = array("d", (1.0, math.nan))
        yield "/uav/count", {"header": {"stamp": STAMP}, "count": self.count, "bad": math.nan, "values": values}


class Listener:
    def __init__(self, url: str) -> None:
        self.messages: list[tuple[Message, float]] = []
        self.steps_count = 0
        self.link = RosbridgeLink(parse_url(url), MonotonicClock(), self._step)
        self.link.subscribe("count", "test_msgs/Count", self._on_count, silence_s=0.5)
        self.link.advertise("setpoint", "test_msgs/Setpoint")

    def _step(self) -> None:
        self.steps_count += 1

    def _on_count(self, message: Message, now_s: float) -> None:
        self.messages.append((message, now_s))

    @property
    def has_news(self) -> bool:
        return bool(self.messages)


@contextmanager
def listening(url: str, kind: type[Listener] = Listener) -> Iterator[Listener]:
    listener = kind(f"{url}/uav")
    listener.link.open()
    try:
        yield listener
    finally:
        listener.link.close()
    assert not [each for each in threading.enumerate() if each.name.startswith("rosbridge ")]


def publish_until_received(heard: Listener, talker: Talker, x: float) -> None:
    """Publishes a setpoint until it is heard: a busy computer may be silent for so long that the link drops some."""

    def is_received() -> bool:
        heard.link.publish("setpoint", {"x": x})
        return bool(talker.heard)

    until(is_received)
    assert [each["x"] for each in talker.heard] == [x] * len(talker.heard)


@contextmanager
def bridged(ros: int = 1, **options: Any) -> Iterator[tuple[RosbridgeServer, Talker]]:
    talker = Talker()
    with RosbridgeServer(Bridge(ros, [talker], **options)) as server:
        yield server, talker


@pytest.mark.parametrize("has_cbor", [True, False])
@pytest.mark.parametrize("ros", [1, 2])
def test_it_finds_out_which_ros_and_reads_messages(ros: int, has_cbor: bool) -> None:
    with bridged(ros, has_cbor=has_cbor) as (server, _), listening(server.url) as heard:
        until(lambda: heard.has_news)
        assert heard.link.is_up
        assert heard.link.graph is not None
        assert heard.link.graph.ros is RosGeneration(ros)
        message, _ = heard.messages[0]
        assert stamp_s(message) == 12.5
        assert math.isnan(number(message["bad"]))
        assert [math.isnan(each) for each in numbers(message["values"])] == [False, True]


def test_a_type_that_rosbridge_cannot_send_in_cbor_comes_in_json() -> None:
    class Fixed(Talker):
        def step(self, now_s: float) -> Iterable[tuple[str, Message]]:
            yield "/uav/count", {"fixed": (1.0, 2.0)}

    with RosbridgeServer(Bridge(1, [Fixed()])) as server, listening(server.url) as heard:
        until(lambda: heard.has_news)
        assert heard.messages[0][0] == {"fixed": [1.0, 2.0]}


def test_a_defect_of_what_listens_does_not_end_the_link(caplog: pytest.LogCaptureFixture) -> None:
    class Defective(Listener):
        has_failed = False

        @override
        def _step(self) -> None:
            if self.messages and not self.has_failed:
                self.has_failed = True
                raise ZeroDivisionError

    with bridged() as (server, _), listening(server.url, Defective) as heard:
        until(lambda: heard.link.connections_count == 2 and heard.link.is_up)
        count = len(heard.messages)
        until(lambda: len(heard.messages) > count)
    assert "this is a defect of UAL" in caplog.text


@pytest.mark.parametrize("error", [KeyError("z"), IndexError(), AttributeError(), OverflowError()])
def test_a_message_that_cannot_be_read_costs_only_itself(error: Exception, caplog: pytest.LogCaptureFixture) -> None:
    class Unreadable(Listener):
        @override
        def _on_count(self, message: Message, now_s: float) -> None:
            super()._on_count(message, now_s)
            raise error

    with bridged() as (server, _), listening(server.url, Unreadable) as heard:
        until(lambda: len(heard.messages) > 3)
        assert heard.link.connections_count == 1
    assert sum("message_unreadable" in each.getMessage() for each in caplog.records) == 1


def test_services_answer_refuse_are_missing_or_never_answer() -> None:
    with bridged() as (server, _), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        server.bridge.faults.dead_services.add("/uav/slow")
        assert heard.link.call_service("add", {"a": 1, "b": 2}).result(30.0) == {"sum": 3}
        with pytest.raises(ServiceError, match=r"/uav/refuse: not today"):
            heard.link.call_service("refuse").result(30.0)
        with pytest.raises(ServiceError, match=r"/uav/none.*does not exist"):
            heard.link.call_service("none").result(30.0)
        with pytest.raises(ServiceTimeoutError, match=r"/uav/slow"):
            heard.link.call_service("slow", timeout_s=0.1).result(30.0)


def test_a_service_that_does_not_answer_holds_up_no_setpoint() -> None:
    """With ROS 2 rosbridge executes nothing more of a client while one of its calls waits."""
    with bridged(2) as (server, talker), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        server.bridge.faults.dead_services.add("/uav/slow")
        heard.link.call_service("slow", timeout_s=30.0)
        behind = heard.link.call_service("add", {"a": 1, "b": 2})
        publish_until_received(heard, talker, 1.5)
        assert not behind.done()


def test_a_connection_on_which_no_service_answers_is_made_anew() -> None:
    with bridged(2) as (server, talker), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        server.bridge.faults.dead_services.add("/uav/slow")
        with pytest.raises(ServiceTimeoutError):
            heard.link.call_service("slow", timeout_s=0.1).result(30.0)
        begun_s = time.monotonic()
        until(lambda: heard.link.connections_count == 2 and heard.link.is_up)
        assert time.monotonic() - begun_s > 5.0
        assert heard.link.call_service("add", {"a": 1, "b": 2}).result(30.0) == {"sum": 3}
        publish_until_received(heard, talker, 1.5)


def test_a_service_that_does_not_answer_leaves_a_connection_on_which_others_do() -> None:
    with bridged(1) as (server, _), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        server.bridge.faults.dead_services.add("/uav/slow")
        asked = server.bridge.sessions[0].operations.count("call_service")
        with pytest.raises(ServiceTimeoutError):
            heard.link.call_service("slow", timeout_s=7.0).result(30.0)
        assert server.bridge.sessions[0].operations.count("call_service") > asked + 1  # it has asked rosapi
        assert heard.link.connections_count == 1


@pytest.mark.parametrize("index", [0, 1])
def test_the_link_is_lost_when_either_of_its_connections_is(index: int) -> None:
    with bridged() as (server, talker), listening(server.url) as heard:
        until(lambda: heard.has_news)
        server.drop(index)
        until(lambda: heard.link.connections_count == 2 and heard.link.is_up)
        until(lambda: server.accepted_count == 4)
        publish_until_received(heard, talker, 1.5)


def test_what_is_published_arrives() -> None:
    with bridged(2) as (server, talker), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        publish_until_received(heard, talker, 1.5)


def test_a_bridge_that_goes_is_lost_at_once_and_found_again() -> None:
    with bridged() as (server, talker), listening(server.url) as heard:
        until(lambda: heard.has_news)
        server.stop()
        until(lambda: not heard.link.is_up)
        assert "nobody listens there" in heard.link.why_not or until(lambda: "nobody listens" in heard.link.why_not)
        with pytest.raises(ServiceError):
            heard.link.call_service("add", {"a": 1, "b": 2}).result(30.0)
        heard.link.publish("setpoint", {"x": 1.0})
        heard.messages.clear()
        server.start()
        until(lambda: heard.has_news)
        publish_until_received(heard, talker, 2.0)
        assert heard.link.connections_count == 2


def test_a_bridge_that_stalls_is_silent_within_a_second_and_then_connected_anew() -> None:
    with bridged() as (server, talker), listening(server.url) as heard:
        until(lambda: heard.has_news)
        server.is_frozen = True
        begun_s = time.monotonic()
        until(lambda: heard.link.state is RosbridgeState.SILENT)
        for _ in range(1000):
            heard.link.publish("setpoint", {"x": 1.0})  # dropped: the link is not up
        assert heard.steps_count > 10
        until(lambda: heard.link.state is RosbridgeState.CONNECTING)
        assert time.monotonic() - begun_s > 2.0
        server.is_frozen = False
        heard.messages.clear()
        until(lambda: heard.has_news)
        assert talker.heard == []


def test_publishing_to_a_bridge_that_does_not_read_never_blocks_and_the_newest_is_kept() -> None:
    with bridged() as (server, talker), listening(server.url) as heard:
        until(lambda: heard.link.is_up)
        with server.lock:
            for index in range(3000):
                heard.link.publish("setpoint", {"x": index, "filling": "x" * 4000})
        until(lambda: talker.heard and talker.heard[-1]["x"] == 2999)
        assert len(talker.heard) < 3000


def test_wrong_types_and_missing_topics_are_reported_by_name() -> None:
    with bridged() as (server, _), listening(server.url) as heard:
        heard.link.subscribe("/uav/setpoint", "test_msgs/Other", lambda *_: None)
        heard.link.subscribe("/uav/nothing", "test_msgs/Other", lambda *_: None)
        until(lambda: len(heard.link.faults()) == 2)
        assert "/uav/setpoint has the type test_msgs/Setpoint, not test_msgs/Other" in heard.link.faults()
        assert "nobody publishes /uav/nothing" in heard.link.faults()


def test_a_bridge_without_a_master_is_reported_and_healed() -> None:
    with bridged() as (server, _):
        server.bridge.faults.has_master = False
        with listening(server.url) as heard:
            until(lambda: "Unable to communicate with master" in heard.link.why_not)
            assert heard.link.state is RosbridgeState.ASKING
            server.bridge.faults.has_master = True
            until(lambda: heard.has_news)


def test_a_node_that_comes_late_is_subscribed_to() -> None:
    with bridged() as (server, talker):
        server.bridge.nodes.clear()
        with listening(server.url) as heard:
            until(lambda: "nobody publishes /uav/count" in heard.link.faults())
            server.bridge.nodes.append(talker)
            until(lambda: heard.has_news)
            until(lambda: not heard.link.faults())


def test_a_connection_that_breaks_while_a_backend_subscribes_for_the_first_time_is_made_anew() -> None:
    breaks = ["subscribe"]

    def dial_breaking(url: BridgeUrl, on_wait: Callable[[], None]) -> BridgeTransport:
        transport = dial(url, on_wait)
        send = transport.send

        def send_or_break(text: bytes, *, is_perishable: bool = False) -> bool:
            if breaks and b'"subscribe"' in text:
                breaks.clear()
                raise ConnectionResetError("the bridge closed the connection")
            return send(text, is_perishable=is_perishable)

        transport.send = send_or_break  # type: ignore[method-assign]
        return transport

    came: list[str] = []
    begun: list[bool] = []

    def begin() -> None:
        if link.is_up and not begun:
            begun.append(True)
            link.subscribe("/uav/count", "test_msgs/Count", lambda *_: came.append("count"))
            link.subscribe("/uav/other", "test_msgs/Count", lambda *_: came.append("other"))
            link.advertise("/uav/setpoint", "test_msgs/Setpoint")

    class Two(Talker):
        @property
        def topics(self) -> Mapping[str, str]:
            return {**super().topics, "/uav/other": "test_msgs/Count"}

        def step(self, now_s: float) -> Iterable[tuple[str, Message]]:
            yield from super().step(now_s)
            yield "/uav/other", {"count": 1}

    talker = Two()
    with RosbridgeServer(Bridge(1, [talker])) as server:
        link = RosbridgeLink(parse_url(server.url), MonotonicClock(), begin, dial_breaking)
        link.open()
        try:
            until(lambda: {"count", "other"} <= set(came))
            link.publish("/uav/setpoint", {"x": 1.0})
            until(lambda: talker.heard)
        finally:
            link.close()
    assert not breaks
    assert link.connections_count == 2


def test_a_silent_topic_is_subscribed_anew() -> None:
    with bridged(2) as (server, _), listening(server.url) as heard:
        until(lambda: heard.has_news)
        server.bridge.faults.silent_topics.add("/uav/count")
        with server.lock:
            heard.link._ask_s = -math.inf  # it looks every 10 s
        until(lambda: server.bridge.sessions[0].operations.count("subscribe") > 1 or _poll(heard))


def _poll(heard: Listener) -> bool:
    heard.link._ask_s = -math.inf
    return False


def test_a_port_that_is_no_rosbridge_is_reported() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]

        def answer() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1000)
                connection.sendall(b"SSH-2.0-OpenSSH_9.2\r\n\r\n")

        answering = threading.Thread(target=answer)
        answering.start()
        with listening(f"rosbridge://127.0.0.1:{port}") as heard:
            until(lambda: "no rosbridge" in heard.link.why_not)
        answering.join()


def test_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {"-keyout": tmp_path / "key.pem", "-out": tmp_path / "certificate.pem"}
    options = [
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-subj",
        "/CN=127.0.0.1",
        "-addext",
        "subjectAltName=IP:127.0.0.1",
    ]
    paths = [str(each) for pair in files.items() for each in pair]
    subprocess.run(["openssl", "req", *options, *paths], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(files["-out"], files["-keyout"])
    monkeypatch.setenv("SSL_CERT_FILE", str(files["-out"]))
    talker = Talker()
    with RosbridgeServer(Bridge(1, [talker]), tls=context) as server, listening(server.url) as heard:
        assert server.url.startswith("rosbridges://")
        until(lambda: heard.has_news)


def test_late_and_overtaking_messages_arrive_and_status_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with bridged(1, sends_status=True) as (server, _):
        server.bridge.faults.delay_s, server.bridge.faults.jitter_s = 0.05, 0.1
        with listening(server.url) as heard:
            until(lambda: len(heard.messages) > 30)
            heard.link._connections.publisher.send(b'{"op":"publish","topic":"/x","msg":{}}')  # type: ignore[union-attr]
            until(lambda: any("was not advertised" in str(vars(each)) for each in caplog.records))
        counts = [message["count"] for message, _ in heard.messages]
        assert counts != sorted(counts)
