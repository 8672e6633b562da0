"""The two connections of a link, supervised as one.

With ROS 2 rosbridge executes the operations of a client one after another. A call of a service holds up all that come
after it until it is answered, however long that takes (``call_services_in_new_thread`` is false by default). So what is
published has a connection of its own.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence

from ual_daemon.backends.rosbridge.outbox import Outbox
from ual_daemon.backends.rosbridge.url import BridgeUrl
from ual_daemon.backends.rosbridge.websocket import BridgeTransport, Dial

PING_S = 0.1
DOUBTFUL_PING_S = 0.3
"""Seconds without an answer to a ping after which a bridge may have stalled. What it gets then is executed when it goes
on.
"""


class Connections:
    """`caller` calls and subscribes, `publisher` advertises and publishes. The link's thread connects and closes."""

    def __init__(self, url: BridgeUrl, dialler: Dial, on_wait: Callable[[], None], now_s: Callable[[], float]) -> None:
        """Connects twice.

        Raises:
            OSError: One of them does not connect.
        """
        self.caller = dialler(url, on_wait)
        try:
            self.publisher = dialler(url, on_wait)
        except BaseException:
            self.caller.close()
            raise
        self.called = Outbox(self.caller)
        self.published = Outbox(self.publisher)
        begun_s = now_s()
        self._pulses = [_Pulse(each, begun_s) for each in (self.caller, self.publisher)]

    def receive(self, timeout_s: float) -> list[str | bytes]:
        """Returns what has come on both, after waiting for something on the first.

        Raises:
            OSError: One of them is lost.
        """
        came: Sequence[str | bytes] = self.caller.receive(timeout_s)
        return [*came, *self.publisher.receive(0.0)]

    def supervise(self, now_s: float) -> float:
        """Notes signs of life, and requests them. Returns for how long there is none on one of them, in seconds."""
        for pulse in self._pulses:
            pulse.update(now_s)
        return now_s - min(pulse.heard_s for pulse in self._pulses)

    def answers(self, now_s: float) -> bool:
        """Returns whether no ping waits for long for its answer, so that what is sent is read at once. From any
        thread.
        """
        return all(now_s - pulse.unanswered_since_s <= DOUBTFUL_PING_S for pulse in self._pulses)

    def flush(self) -> None:
        """Sends what waits.

        Raises:
            OSError: One of them is lost.
        """
        self.published.flush()
        self.called.flush()

    def close(self) -> None:
        """Closes both, without waiting."""
        with contextlib.ExitStack() as stack:
            stack.callback(self.caller.close)
            stack.callback(self.publisher.close)

    def abort(self) -> None:
        """Gives both up: what has not reached the bridge's computer never does."""
        with contextlib.ExitStack() as stack:
            stack.callback(self.caller.abort)
            stack.callback(self.publisher.abort)


class _Pulse:
    """The signs of life of one connection."""

    def __init__(self, transport: BridgeTransport, now_s: float) -> None:
        self.heard_s = now_s
        self.unanswered_since_s = math.inf
        """Time of the oldest ping without an answer; infinite if all are answered."""
        self._transport = transport
        self._received = transport.received_count
        self._pinged_s = -math.inf

    def update(self, now_s: float) -> None:
        if self._transport.received_count != self._received:
            self._received, self.heard_s, self.unanswered_since_s = self._transport.received_count, now_s, math.inf
        if now_s - self._pinged_s >= PING_S:
            self._pinged_s, self.unanswered_since_s = now_s, min(self.unanswered_since_s, now_s)
            self._transport.ping()
