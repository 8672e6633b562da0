"""A small rosbridge: protocol 2 in JSON and CBOR, ROS 1 and ROS 2, rosapi, and nodes that are plain Python objects.

It behaves as rosbridge_suite does. A wrong type or an unknown topic is written to its own log and not sent to the
client (unless `sends_status`). A service that is not there is answered with an error; NaN is null in JSON. With ROS 2
the operations of a client are executed one after another, and a call holds up those after it until it is answered.
"""

from __future__ import annotations

import heapq
import itertools
import json
import math
import random
from array import array
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import cbor2

Message = Mapping[str, Any]


class Later:
    """The answer of a service that waits for something: None until it is there.

    `is_lost`: its node has died. ROS 1 says so to the caller, ROS 2 says nothing.
    """

    def __init__(self) -> None:
        self.answer: Message | None = None
        self.is_lost = False

    @property
    def has_ended(self) -> bool:
        return self.is_lost or self.answer is not None


Answer = Message | Later
Service = Callable[[Message], Answer]
_TAGS = {"d": 86, "f": 85, "h": 77, "H": 69, "i": 78, "I": 70}
_PLAIN = frozenset((float, int, str, bool, type(None)))


class Node(Protocol):
    """A ROS node. Types are ``pkg/Name``; stamps have ``sec`` and ``nanosec``; arrays of numbers are `array.array`."""

    @property
    def topics(self) -> Mapping[str, str]:
        """Published topics: types by topic."""

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        """Subscribed topics: type and callback by topic."""

    @property
    def services(self) -> Mapping[str, Service]:
        """Its services by name. One raises `RefusedError` to fail."""

    def step(self, now_s: float) -> Iterable[tuple[str, Message]]:
        """Advances to a time, and returns the messages that it publishes meanwhile."""


class RefusedError(Exception):
    """A service fails; the words go to the caller."""


@dataclass
class Faults:
    """Faults of the bridge. Delays apply to what is published to clients; jitter lets messages overtake."""

    has_master: bool = True
    silent_topics: set[str] = field(default_factory=set)
    dead_services: set[str] = field(default_factory=set)
    """They never answer."""
    slow_services: dict[str, float] = field(default_factory=dict)
    """They are executed at once, and answer after so many seconds."""
    delay_s: float = 0.0
    jitter_s: float = 0.0


@dataclass
class _Subscription:
    throttle_s: float
    queue: deque[Message]
    is_cbor: bool
    sent_s: float = -math.inf


class Bridge:
    """The bridge and its nodes. `step` advances both; `sessions` are the clients."""

    def __init__(
        self,
        ros: int,
        nodes: Iterable[Node],
        *,
        has_cbor: bool = True,
        sends_status: bool = False,
        calls_in_new_thread: bool | None = None,
    ) -> None:
        """`calls_in_new_thread` is rosbridge's parameter: by default true with ROS 1, and false with ROS 2."""
        self.ros = ros
        self.calls_in_new_thread = ros == 1 if calls_in_new_thread is None else calls_in_new_thread
        self.nodes = list(nodes)
        self.has_cbor = has_cbor
        self.sends_status = sends_status
        self.faults = Faults()
        self.sessions: list[Session] = []
        self.now_s = 0.0
        self.groups: tuple[frozenset[str], ...] = ()
        """Services of which one is executed at a time: callback groups that are mutually exclusive."""
        self._busy_s: dict[frozenset[str], float] = {}
        self._queued: list[tuple[Session, Message]] = []
        self._unanswered: list[tuple[Session, Message, Later]] = []
        """Calls whose services wait for something."""
        self.published: list[tuple[float, str, Message]] = []
        """Messages that clients have published, with their times."""
        self.noise = random.Random(1)

    def connect(self) -> Session:
        """Adds a client."""
        session = Session(self)
        self.sessions.append(session)
        return session

    def step(self, now_s: float) -> None:
        """Advances the nodes, and gives clients what is due."""
        self.now_s = now_s
        for node in list(self.nodes):
            for topic, message in node.step(now_s):
                if topic not in self.faults.silent_topics:
                    for session in self.sessions:
                        session.offer(topic, message)
        for session in self.sessions:
            session.step(now_s)
        self._answer_waiting()
        self._call_queued()

    def wait_for(self, session: Session, operation: Message, later: Later) -> None:
        """Answers a call once its service can. With ROS 2 its group is busy until then."""
        self._unanswered.append((session, operation, later))
        if self.ros == 2:
            self.occupy(operation["service"], math.inf)
        self._answer_waiting()

    def _answer_waiting(self) -> None:
        ended = [each for each in self._unanswered if each[2].has_ended]
        self._unanswered = [each for each in self._unanswered if not each[2].has_ended]
        for session, operation, later in ended:
            self.occupy(operation["service"], -math.inf)
            if session in self.sessions:
                session.answer(operation, later)

    def _call_queued(self) -> None:
        queued, self._queued = self._queued, []
        for session, operation in queued:
            if session in self.sessions:
                session.call(operation)

    def queues(self, session: Session, operation: Message) -> bool:
        """Queues a call if its group is busy, and returns whether it is."""
        is_busy = self._busy_s.get(self._group(operation["service"]), -math.inf) > self.now_s
        if is_busy:
            self._queued.append((session, operation))
        return is_busy

    def occupy(self, service: str, until_s: float) -> None:
        """Makes a service's group busy."""
        self._busy_s[self._group(service)] = until_s

    def _group(self, service: str) -> frozenset[str]:
        return next((each for each in self.groups if service in each), frozenset((service,)))

    def topics(self) -> dict[str, str]:
        """Returns the types by topic, as this ROS writes them."""
        found = {"/rosout": "rosgraph_msgs/Log" if self.ros == 1 else "rcl_interfaces/Log"}
        for node in self.nodes:
            found.update(node.topics)
            found.update({topic: kind for topic, (kind, _) in node.subscriptions.items()})
        return {topic: self.spelled(kind) for topic, kind in found.items()}

    def spelled(self, kind: str) -> str:
        """Returns a type's name as this ROS writes it."""
        package, name = kind.split("/")
        if self.ros == 1:
            return f"{package}/VFR_HUD" if name == "VfrHud" else kind  # renamed for ROS 2
        return f"{package}/msg/{name}"

    def service(self, name: str) -> Service | None:
        """Returns a service of rosapi or a node."""
        if name == "/rosapi/topics":
            return self._list_topics
        if name == "/rosapi/services":
            return self._list_services
        return next((node.services[name] for node in self.nodes if name in node.services), None)

    def call(self, name: str, arguments: Message) -> Answer:
        """Calls a service.

        Raises:
            RefusedError: It is not there, or fails.
        """
        service = self.service(name)
        if service is None:
            raise RefusedError(f"Service {name} does not exist")
        if _has_null(arguments):
            raise RefusedError("a message requires a float64 for a field, but got a <class 'NoneType'>")
        return service(arguments)

    def latched(self, topic: str) -> Message | None:
        """Returns what a new subscriber of a topic gets at once; None for nothing."""
        found = (getattr(node, "latched", {}).get(topic) for node in self.nodes)
        return next((each for each in found if each is not None), None)

    def _list_topics(self, _: Message) -> Message:
        if not self.faults.has_master:
            raise RefusedError("Unable to communicate with master!")
        topics = self.topics()
        return {"topics": list(topics), "types": list(topics.values())}

    def _list_services(self, _: Message) -> Message:
        return {"services": ["/rosapi/topics", *(name for node in self.nodes for name in node.services)]}

    def deliver(self, topic: str, message: Message) -> None:
        """Gives a node what a client publishes."""
        self.published.append((self.now_s, topic, message))
        for node in self.nodes:
            if topic in node.subscriptions:
                node.subscriptions[topic][1](message)


class Session:
    """One client: `receive` takes what it sends, and `out` has what it gets."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge
        self._subscriptions: dict[str, _Subscription] = {}
        self._advertised: set[str] = set()
        self._late: list[tuple[float, int, str, Message]] = []
        self._numbers = itertools.count()
        self._answers: list[tuple[float, int, str]] = []
        self.is_held_up = False
        """Whether its operations wait until a call is answered."""
        self._held_up: deque[Message] = deque()
        self.out: deque[str | bytes] = deque()
        self.operations: list[str] = []
        """Requested operations, for tests."""

    def receive(self, text: str | bytes) -> None:
        """Takes an operation."""
        operation = json.loads(text)
        self.operations.append(operation["op"])
        if self.is_held_up:
            self._held_up.append(operation)
        else:
            self._execute(operation)

    def _execute(self, operation: Message) -> None:
        try:
            getattr(self, f"_{operation['op']}")(operation)
        except RefusedError as error:
            self._log(operation.get("id", ""), str(error))

    def offer(self, topic: str, message: Message) -> None:
        """Takes a node's message, to be sent when its delay is over."""
        if topic in self._subscriptions:
            faults = self._bridge.faults
            due_s = self._bridge.now_s + faults.delay_s + self._bridge.noise.uniform(0.0, faults.jitter_s)
            heapq.heappush(self._late, (due_s, next(self._numbers), topic, message))

    def step(self, now_s: float) -> None:
        """Sends what is due."""
        while self._answers and self._answers[0][0] <= now_s:
            self.out.append(heapq.heappop(self._answers)[2])
            self._go_on()
        while self._late and self._late[0][0] <= now_s:
            _, _, topic, message = heapq.heappop(self._late)
            if topic in self._subscriptions:
                self._subscriptions[topic].queue.append(message)
        for topic, subscription in self._subscriptions.items():
            while subscription.queue and now_s - subscription.sent_s >= subscription.throttle_s - 1e-6:
                subscription.sent_s = now_s
                self._send(topic, subscription.queue.popleft(), is_cbor=subscription.is_cbor)

    def _subscribe(self, operation: Message) -> None:
        topic, kind = operation["topic"], operation.get("type")
        known = self._bridge.topics().get(topic)
        if known is not None and kind is not None and known != kind:
            raise RefusedError(f"subscribe: {topic} has the type {known}, not {kind}")
        length = operation.get("queue_length", 0)
        is_cbor = self._bridge.has_cbor and operation.get("compression") == "cbor"
        throttle_s = operation.get("throttle_rate", 0) / 1000.0
        self._subscriptions[topic] = _Subscription(throttle_s, deque(maxlen=length or None), is_cbor)
        latched = self._bridge.latched(topic)
        if latched is not None:
            self.offer(topic, latched)

    def _unsubscribe(self, operation: Message) -> None:
        self._subscriptions.pop(operation["topic"], None)

    def _advertise(self, operation: Message) -> None:
        known = self._bridge.topics().get(operation["topic"])
        if known is not None and known != operation["type"]:
            raise RefusedError(f"advertise: {operation['topic']} has the type {known}, not {operation['type']}")
        self._advertised.add(operation["topic"])

    def _unadvertise(self, operation: Message) -> None:
        self._advertised.discard(operation["topic"])

    def _publish(self, operation: Message) -> None:
        if operation["topic"] not in self._advertised:
            raise RefusedError(f"publish: {operation['topic']} was not advertised")
        self._bridge.deliver(operation["topic"], operation["msg"])

    def _call_service(self, operation: Message) -> None:
        if operation["service"] in self._bridge.faults.dead_services:
            self.is_held_up = not self._bridge.calls_in_new_thread
        else:
            self.call(operation)

    def call(self, operation: Message) -> None:
        """Calls a service, unless its group is busy."""
        bridge, name = self._bridge, operation["service"]
        if bridge.queues(self, operation):
            self.is_held_up = not bridge.calls_in_new_thread
            return
        answer: dict[str, Any] = {"op": "service_response", "service": name, "id": operation.get("id")}
        try:
            values = bridge.call(name, operation.get("args", {}))
            if isinstance(values, Later):
                self.is_held_up = not bridge.calls_in_new_thread
                bridge.wait_for(self, operation, values)
                return
            answer |= {"values": json_ready(values), "result": True}
        except RefusedError as error:
            answer |= {"values": str(error), "result": False}
        slow_s = bridge.faults.slow_services.get(name)
        if slow_s is None:
            self.out.append(json.dumps(answer))
            self._go_on()
            return
        self.is_held_up = not bridge.calls_in_new_thread
        bridge.occupy(name, bridge.now_s + slow_s)
        heapq.heappush(self._answers, (bridge.now_s + slow_s, next(self._numbers), json.dumps(answer)))

    def answer(self, operation: Message, later: Later) -> None:
        """Sends the answer of a service that has waited."""
        name = operation["service"]
        answer: dict[str, Any] = {"op": "service_response", "service": name, "id": operation.get("id")}
        if later.answer is not None:
            answer |= {"values": json_ready(later.answer), "result": True}
        elif self._bridge.ros == 1:
            text = "transport error completing service call: unable to receive data from sender"
            answer |= {"values": text, "result": False}
        else:
            return
        self.out.append(json.dumps(answer))
        self._go_on()

    def _go_on(self) -> None:
        """Executes what was held up."""
        self.is_held_up = False
        while self._held_up and not self.is_held_up:
            self._execute(self._held_up.popleft())

    def _send(self, topic: str, message: Message, *, is_cbor: bool) -> None:
        message = stamped(message, self._bridge.ros)
        if is_cbor and _fails_in_cbor(message):
            return
        if is_cbor:
            self.out.append(cbor2.dumps({"op": "publish", "topic": topic, "msg": _cbor_ready(message)}))
        else:
            self.out.append(json.dumps({"op": "publish", "topic": topic, "msg": json_ready(message)}))

    def _log(self, ident: str, words: str) -> None:
        if self._bridge.sends_status:
            self.out.append(json.dumps({"op": "status", "level": "error", "msg": words, "id": ident}))


def _has_null(value: Any) -> bool:
    """Returns whether arguments have null for a number, which rosbridge_suite refuses."""
    if isinstance(value, Mapping):
        return any(map(_has_null, value.values()))
    return any(map(_has_null, value)) if isinstance(value, list) else value is None


def stamped(message: Message, ros: int) -> Message:
    """Returns the message with its stamp as this ROS names it."""
    header = message.get("header")
    if ros == 2 or header is None:
        return message
    stamp = {"secs": header["stamp"]["sec"], "nsecs": header["stamp"]["nanosec"]}
    return {**message, "header": {**header, "stamp": stamp, "seq": 0}}


def json_ready(value: Any) -> Any:
    """Returns what JSON can hold: null for NaN."""
    if isinstance(value, Mapping):
        return {key: json_ready(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, array)):
        return [json_ready(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _fails_in_cbor(message: Message) -> bool:
    """Returns whether rosbridge_suite drops it: it encodes no arrays of a fixed length (here: tuples), and none of
    texts.
    """
    return any(isinstance(each, tuple) or (isinstance(each, list) and "" in each) for each in message.values())


def _cbor_ready(value: Any) -> Any:
    """Returns what CBOR can hold: typed arrays. Most values are plain, and are not looked into."""
    if isinstance(value, dict):
        return {key: each if type(each) in _PLAIN else _cbor_ready(each) for key, each in value.items()}
    if isinstance(value, array):
        return bytes(value) if value.typecode == "B" else cbor2.CBORTag(_TAGS[value.typecode], value.tobytes())
    if isinstance(value, Mapping):
        return _cbor_ready(dict(value))
    return [_cbor_ready(each) for each in value] if isinstance(value, list | tuple) else value
