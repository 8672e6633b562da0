"""The supervised link: connects, subscribes, and begins again for ever, on one thread."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum

from ual_daemon import logs
from ual_daemon.backends.base import Clock
from ual_daemon.backends.rosbridge import operations
from ual_daemon.backends.rosbridge.calls import PendingCalls, ServiceError, ServiceTimeoutError
from ual_daemon.backends.rosbridge.connections import Connections
from ual_daemon.backends.rosbridge.graph import TOPICS_SERVICE, Graph, RosGeneration, read_graph
from ual_daemon.backends.rosbridge.operations import Fragments, Message, OperationError
from ual_daemon.backends.rosbridge.slow_calls import SlowCalls
from ual_daemon.backends.rosbridge.url import BridgeUrl
from ual_daemon.backends.rosbridge.websocket import Dial, dial

_log = logging.getLogger(__name__)

TICK_S = 0.02
"""The longest wait for messages."""
LOST_LINK_S = 0.8
"""Seconds without a sign of life after which a bridge counts as lost."""
RETRY_S = 0.2
_ANSWER_TIMEOUT_S = 3.0
"""Seconds without a sign of life after which a connection is made again."""
_BLOCKED_S, _DOUBT_S = 6.0, 2.0
"""Seconds without an answer of any service after which a connection is made again, and after which rosapi is asked
before: it always answers else. With ROS 2 a call that is never answered holds up all that come after it. MAVROS answers
after 5 s.
"""
_ASK_S, _ASK_AGAIN_S = 3.0, 1.0
"""Seconds that the question for the topics may take, and after which it is repeated while something is missing."""
_CBOR_S = 1.5
"""Seconds without a message in CBOR after which a topic is subscribed to in JSON: rosbridge cannot send every type."""
_REFRESH_S = 0.5
_TYPES_REQUEST_S = 10.0
"""Seconds after which the question is repeated while nothing is missing."""

OnMessage = Callable[[Message, float], None]
"""Gets a message and the time (the backend's clock) at which it came, on the link's thread."""


class RosbridgeState(Enum):
    """CONNECTING: no connection. ASKING: connected, and the topics are not known yet. UP. SILENT: no sign of life."""

    CONNECTING = "connecting"
    ASKING = "asking"
    UP = "up"
    SILENT = "silent"


@dataclass(slots=True)
class _TopicSubscription:
    """Subscription of a topic, and its last message. After `silence_s` without a message, it is subscribed again."""

    topic: str
    kind: str
    on_message: OnMessage
    throttle_ms: int
    queue_length: int
    silence_s: float
    is_cbor: bool
    is_sent: bool = False
    has_come: bool = False
    active_s: float = -math.inf
    cbor_since_s: float = math.inf
    """Since when it is subscribed to in CBOR on this connection, however often."""
    fault: str = ""


_UNREADABLE = (OperationError, LookupError, AttributeError, TypeError, ValueError, ArithmeticError)
"""Errors that a message raises whose content is other than its type says. It must not cost the link, or each would."""


class _ClosedError(Exception):
    """The link is closed while it connects."""


class RosbridgeLink:
    """One thread. `publish`, `call_service` and the properties are for any thread; they never block.

    Subscribe and advertise before `open`, or on the link's thread. That is only recorded, sent when it can be, and
    outlives every connection.
    """

    def __init__(
        self,
        url: BridgeUrl,
        clock: Clock,
        on_step: Callable[[], None],
        dialler: Dial = dial,
        on_woke: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Args:
        url: The bridge's.
        clock: The backend's.
        on_step: Called on the link's thread after each batch of messages, and at least every 0.1 s.
        dialler: Connects.
        on_woke: Called before each batch is taken. Returns for how long the thread had paused: the messages of topics
            that it then finds are old, and are dropped.

        """
        self.url = url
        self._clock = clock
        self._on_step = on_step
        self._on_woke = on_woke
        self._is_old = False
        """Whether the present batch waited in a pause of this computer."""
        self._dial = dialler
        self._subscriptions: dict[str, _TopicSubscription] = {}
        self._unsubscribed: list[str] = []
        self._advertised: dict[str, str] = {}
        self._announced: set[str] = set()
        """Topics that were advertised on this connection."""
        self._calls = PendingCalls()
        self._slow_calls = SlowCalls(lambda: self._dial(self.url, self._wait_serving), clock.now_s)
        self._fragments = Fragments()
        self._closing = threading.Event()
        self._connections: Connections | None = None
        self._thread = threading.Thread(target=self._run, name=f"rosbridge {url}", daemon=True)
        self._question: Future[Message] | None = None
        self._ask_s = self._refreshed_s = -math.inf
        self._logged: set[str] = set()
        self.state = RosbridgeState.CONNECTING
        self.graph: Graph | None = None
        """Graph by rosapi; None before the first answer of a connection."""
        self.why_not = ""
        """Why the link is not up, human-readable; empty if it is."""
        self.connections_count = 0

    # --- For any thread -----------------------------------------------------------------------------------------------

    @property
    def is_up(self) -> bool:
        """Whether the bridge answers and its topics are known."""
        return self.state is RosbridgeState.UP

    @property
    def holds_up_calls(self) -> bool:
        """Whether a call that is made now may be executed late: the bridge may have stalled, or with ROS 2 it may
        execute one call after another.
        """
        connections = self._connections
        if connections is None or not self.is_up or not connections.answers(self._clock.now_s()):
            return True
        return self.graph is not None and self.graph.ros is RosGeneration.ROS2 and self._calls.hold_up

    def open(self) -> None:
        """Starts the thread; it connects, and keeps trying."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and the connection. The thread itself may call this."""
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def publish(self, topic: str, message: Message) -> None:
        """Publishes a message, before it returns where the connection takes it; else the newest one of a topic leaves
        later. While the link is not up it is dropped.
        """
        connections = self._connections
        if connections is None or not self.is_up:
            return
        topic = self.url.resolve(topic)
        data = operations.publish(topic, message)
        with contextlib.suppress(OSError):  # the link's thread sees it, too
            connections.published.put(topic, data, may_leave=connections.answers(self._clock.now_s()))

    def waits(self, topic: str) -> bool:
        """Returns whether the message of a topic has not left yet."""
        connections = self._connections
        return connections is not None and connections.published.waits(self.url.resolve(topic))

    def withdraw(self, topic: str) -> None:
        """Withdraws the message of a topic that has not left yet."""
        connections = self._connections
        if connections is not None:
            connections.published.withdraw(self.url.resolve(topic))

    def call_service(self, service: str, arguments: Message | None = None, timeout_s: float = 3.0) -> Future[Message]:
        """Calls a service. The future ends with its values, or with a `calls.ServiceError` that names the service.

        A call leaves while the link is up, and within its time. Cancelling the future withdraws it at once if it has
        not left; else it drops the answer, as rosbridge cannot take a call back.
        """
        service, now_s = self.url.resolve(service), self._clock.now_s()
        connections = self._connections
        if connections is None or not (
            self.is_up or (service == TOPICS_SERVICE and self.state is RosbridgeState.ASKING)
        ):
            return _refused(service, self.why_not or f"not connected to {self.url}")
        ident, answer = self._calls.begin(service, now_s, timeout_s)
        data = operations.call_service(service, arguments or {}, ident, timeout_s)

        def withdraw(ended: Future[Message]) -> None:
            if ended.cancelled():
                connections.called.withdraw(ident)

        answer.add_done_callback(withdraw)
        try:
            connections.called.put(ident, data, may_leave=connections.answers(now_s))
        except OSError as error:
            self._calls.refuse(ident, str(error), ServiceTimeoutError)  # a part of it may have left
        return answer

    def call_slow_service(self, service: str, arguments: Message, timeout_s: float) -> Future[Message]:
        """As `call_service`, for a service that may take long: none of the others' calls waits behind it."""
        service = self.url.resolve(service)
        if not self.is_up:
            return _refused(service, self.why_not or f"not connected to {self.url}")
        return self._slow_calls.call(service, arguments, timeout_s)

    def faults(self) -> tuple[str, ...]:
        """Returns what is wrong with the topics that were subscribed to, human-readable."""
        return tuple(each.fault for each in self._subscriptions.values() if each.fault)

    # --- For the link's thread ----------------------------------------------------------------------------------------

    def subscribe(
        self,
        topic: str,
        kind: str,
        on_message: OnMessage,
        throttle_ms: int = 0,
        queue_length: int = 1,
        silence_s: float = math.inf,
    ) -> None:
        """Subscribes to a topic of a type (``pkg/Name``): once somebody publishes it, and after every reconnection.

        `throttle_ms` is the shortest interval between two messages, and `queue_length` how many may wait in the bridge.
        After `silence_s` without a message it is subscribed to again: in ROS 2 a publisher that comes back with another
        quality of service is not received otherwise.
        """
        name = self.url.resolve(topic)
        wanted = _TopicSubscription(
            name, kind, on_message, throttle_ms, queue_length, silence_s, operations.fits_cbor(kind)
        )
        self._subscriptions[name] = wanted
        self._refreshed_s = -math.inf

    def unsubscribe(self, topic: str) -> None:
        """Ends a subscription."""
        subscription = self._subscriptions.pop(self.url.resolve(topic), None)
        if subscription is not None and subscription.is_sent:
            self._unsubscribed.append(subscription.topic)
            self._refreshed_s = -math.inf

    def advertise(self, topic: str, kind: str) -> None:
        """Announces a topic that is published to; needed before `publish`."""
        self._advertised[self.url.resolve(topic)] = kind
        self._refreshed_s = -math.inf

    def _run(self) -> None:
        """Connects until the link is closed. A defect of a listener does not end it: it connects again."""
        while not self._closing.is_set():
            try:
                self._attempt()
                self._turn()
            except _ClosedError:
                return
            except Exception:  # noqa: BLE001 - the callers must see a lost link that comes back: this thread goes on
                _log.exception("the exchange with rosbridge failed; this is a defect of UAL, please report it")
            self._closing.wait(RETRY_S)

    def _attempt(self) -> None:
        try:
            self._connect_and_serve()
        except OSError as error:
            self._lost(error)

    def _connect_and_serve(self) -> None:
        connections = Connections(self.url, self._dial, self._wait, self._clock.now_s)
        end = connections.abort
        try:
            self._connected(connections)
            while not self._closing.is_set():
                self._serve(connections)
            end = connections.close if self.is_up else connections.abort
        except OSError as error:
            self._lost(error)  # before the state changes: other threads say why
            raise
        finally:
            self._connections = None
            self._forget()
            end()

    def _wait(self) -> None:
        if self._closing.is_set():
            raise _ClosedError
        self._turn()

    def _wait_serving(self) -> None:
        """Waits for a further connection: what comes on the others is taken meanwhile.

        Raises:
            OSError: One of them is lost.
        """
        connections = self._connections
        for data in () if connections is None else connections.receive(0.0):
            self._on_data(data)
        self._wait()

    def _turn(self) -> None:
        """Does what is due where there is nothing to read."""
        self._on_woke()
        self._on_step()

    def _connected(self, connections: Connections) -> None:
        self.connections_count += 1
        self._connections = connections
        self._ask_s, self._question = -math.inf, None
        self.state, self.why_not = RosbridgeState.ASKING, f"{self.url} has not said which topics there are"
        logs.event(_log, logging.INFO, "bridge_connected", url=str(self.url))

    def _serve(self, connections: Connections) -> None:
        received = connections.receive(TICK_S)
        self._is_old = self._on_woke() > 0.0
        for data in received:
            self._on_data(data)
        now_s = self._clock.now_s()
        self._supervise(connections, connections.supervise(now_s))
        self._supervise_calls(now_s)
        self._on_step()  # before anything leaves that has waited: what has come may say that it must not
        for ident in self._calls.expire(now_s):
            connections.called.withdraw(ident)
        if self.state is not RosbridgeState.SILENT and connections.answers(now_s):
            connections.flush()
            self._slow_calls.serve()
        self._ask(now_s)
        if now_s - self._refreshed_s >= _REFRESH_S:
            self._refresh_subscriptions()

    def _supervise(self, connections: Connections, silent_s: float) -> None:
        """Takes for how long there was no sign of life.

        Raises:
            TimeoutError: It is too long.
        """
        if silent_s > _ANSWER_TIMEOUT_S:
            raise TimeoutError(f"{self.url} has not answered for {_ANSWER_TIMEOUT_S:g} s")
        if silent_s > LOST_LINK_S and self.state is RosbridgeState.UP:
            self.state, self.why_not = RosbridgeState.SILENT, f"{self.url} does not answer"
            self._drop_waiting(connections)
            logs.event(_log, logging.WARNING, "bridge_silent", url=str(self.url))
        elif silent_s <= LOST_LINK_S and self.state is RosbridgeState.SILENT:
            self._drop_waiting(connections)  # another thread may have put something since
            self.state, self.why_not = RosbridgeState.UP, ""
            logs.event(_log, logging.INFO, "bridge_answers", url=str(self.url))

    def _drop_waiting(self, connections: Connections) -> None:
        connections.published.clear()
        for ident in connections.called.clear():
            self._calls.refuse(ident, self.why_not)

    def _supervise_calls(self, now_s: float) -> None:
        """Asks rosapi once no service answers.

        Raises:
            TimeoutError: It has not answered either.
        """
        unanswered_s = self._calls.unanswered_s(now_s)
        if unanswered_s > _BLOCKED_S:
            raise TimeoutError(f"{self.url} has answered no call of a service for {_BLOCKED_S:g} s")
        if unanswered_s > _DOUBT_S:
            self._ask_s = min(self._ask_s, now_s)

    def _ask(self, now_s: float) -> None:
        """Asks for the topics: at once, again while something is missing, and now and then later."""
        question = self._question
        if question is not None and question.done():
            self._question = None
            self._learn(question, now_s)
        elif question is None and now_s >= self._ask_s:
            self._question = self.call_service(TOPICS_SERVICE, timeout_s=_ASK_S)

    def _learn(self, question: Future[Message], now_s: float) -> None:
        try:
            graph = read_graph(question.result())
        except (ServiceError, ValueError) as error:
            self._ask_s = now_s + _ASK_AGAIN_S
            if self.state is RosbridgeState.ASKING:
                self.why_not = f"rosapi does not answer ({error}): it runs beside rosbridge, and needs a ROS master"
                self._say("bridge_without_topics", self.why_not)
            return
        self.graph = graph
        self._refresh_subscriptions()
        if self.state is RosbridgeState.ASKING:
            self.state, self.why_not = RosbridgeState.UP, ""
        self._ask_s = now_s + (_ASK_AGAIN_S if self.faults() else _TYPES_REQUEST_S)

    def _refresh_subscriptions(self) -> None:
        """Announces what is published, and subscribes to what can be, and to what has fallen silent.

        Raises:
            OSError: The connection is lost. The next one begins again.
        """
        connections, graph, now_s = self._connections, self.graph, self._clock.now_s()
        self._refreshed_s = now_s
        if connections is None or graph is None:
            return
        self._announce(connections, graph)
        transport = connections.caller
        while self._unsubscribed:
            transport.send(operations.unsubscribe(self._unsubscribed.pop()))
        for each in self._subscriptions.values():
            each.fault = graph.fault(each.topic, each.kind)
            if each.is_sent and each.is_cbor and not each.has_come and now_s - each.cbor_since_s > _CBOR_S:
                transport.send(operations.unsubscribe(each.topic))
                each.is_sent = each.is_cbor = False
            if each.is_sent and now_s - each.active_s > each.silence_s:
                each.fault = each.fault or f"nothing comes on {each.topic}"
                transport.send(operations.unsubscribe(each.topic))
                each.is_sent = False
            if not graph.fault(each.topic, each.kind) and not each.is_sent:
                each.is_sent, each.active_s = True, now_s
                each.cbor_since_s = min(each.cbor_since_s, now_s)
                kind = graph.ros.spell(each.kind)
                transport.send(
                    operations.subscribe(each.topic, kind, each.throttle_ms, each.queue_length, is_cbor=each.is_cbor)
                )
            if "has the type" in each.fault:
                self._say("topic_unusable", each.fault)

    def _announce(self, connections: Connections, graph: Graph) -> None:
        for topic, kind in self._advertised.items():
            if topic not in self._announced:
                connections.publisher.send(operations.advertise(topic, graph.ros.spell(kind)))
                self._announced.add(topic)

    def _on_data(self, data: str | bytes) -> None:
        try:
            self._execute(operations.decode(data))
        except _UNREADABLE as error:
            self._say("message_unreadable", f"{type(error).__name__}: {error}")

    def _execute(self, operation: dict[str, object]) -> None:
        kind = operation["op"]
        if kind == "publish":
            if not self._is_old:
                self._deliver(operation)
        elif kind == "service_response":
            self._calls.answer(operation)
        elif kind == "fragment":
            whole = self._fragments.add(operation)
            if whole is not None:
                self._execute(whole)
        elif kind == "status" and operation.get("level") in ("error", "warning"):
            self._say("bridge_status", f"{operation.get('id', '')} {operation.get('msg')}".strip())

    def _deliver(self, operation: dict[str, object]) -> None:
        subscription = self._subscriptions.get(str(operation["topic"]))
        message = operation["msg"]
        if subscription is None or not isinstance(message, dict):
            return
        subscription.active_s = now_s = self._clock.now_s()
        subscription.fault, subscription.has_come = "", True
        subscription.on_message(message, now_s)

    def _forget(self) -> None:
        """Forgets the messages of a connection that has ended."""
        self.state, self.graph, self._question = RosbridgeState.CONNECTING, None, None
        self._fragments = Fragments()
        self._unsubscribed.clear()
        self._announced.clear()
        for each in self._subscriptions.values():
            each.is_sent, each.cbor_since_s, each.fault = False, math.inf, ""
        self._calls.fail_all("the connection to the bridge is lost")
        self._slow_calls.end("the connection to the bridge is lost")

    def _lost(self, error: OSError) -> None:
        why = error.strerror if error.strerror and error.errno else str(error) or repr(error)
        if why != self.why_not and not self._closing.is_set():
            logs.event(_log, logging.WARNING, "bridge_lost", url=str(self.url), why=why)
        self.why_not = why

    def _say(self, event: str, why: str) -> None:
        """Logs something once."""
        if why not in self._logged and len(self._logged) < _MOST_LOGGED_CAUSES:
            self._logged.add(why)
            logs.event(_log, logging.WARNING, event, url=str(self.url), why=why)


def _refused(service: str, text: str) -> Future[Message]:
    answer: Future[Message] = Future()
    answer.set_exception(ServiceError(service, text))
    return answer


_MOST_LOGGED_CAUSES = 1000
