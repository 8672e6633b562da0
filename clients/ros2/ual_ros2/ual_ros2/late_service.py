"""Services whose answers come later, without a thread for each and without a busy executor."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

from ual_ros2 import values
from ual_ros2.messages import Entity, Message


class LateService:
    """A service whose callback returns a future, and which answers when that is done.

    rclpy has a coroutine for this. Its executors resume one again and again until it ends, so that a go-to that is
    waited for would cost a whole core. Here the executor hands the future to what sends the response, and is done.
    """

    def __init__(
        self, node: Entity, kind: Entity, name: str, begin: Callable[[Message, float], Future[Message]]
    ) -> None:
        """`begin` gets the request, and when it was sent (UTC; 0: not known)."""
        self._begin = begin
        self._is_made = threading.Event()
        self.entity = node.create_service(kind, name, self._pass_on)
        self._send = self.entity.send_response
        self.entity.send_response = self._answer
        self._is_made.set()

    def _pass_on(self, request: Message, _: Message) -> Message:
        """Hands a request to `_answer`. It may come before all is made, where the event loop makes the service."""
        self._is_made.wait()
        return request

    def _answer(self, request: Message, header: Message) -> None:
        """Takes the place of what sends responses, because only that is given the header."""
        future = self._begin(request, header.source_timestamp / values.NANO)
        future.add_done_callback(lambda done: self._send(done.result(), header))
