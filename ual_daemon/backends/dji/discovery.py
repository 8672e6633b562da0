"""Detection of the wrapper that runs behind a bridge."""

from __future__ import annotations

import logging
from concurrent.futures import Future

from ual_daemon import logs
from ual_daemon.backends.dji.wrappers import WRAPPERS, Wrapper
from ual_daemon.backends.rosbridge import Message, RosbridgeLink
from ual_daemon.backends.rosbridge.calls import ServiceError

_log = logging.getLogger(__name__)

_SERVICES = "/rosapi/services"
_ASK_S, _ASK_AGAIN_S = 3.0, 1.0


class WrapperDiscovery:
    """Asks for the services until those of a wrapper are there.

    The one that obtains the control authority has another name in each. Their topics do not tell: both nodes of
    dji_osdk_ros have the same ones, and a node that has just begun has a part of them.
    """

    def __init__(self, link: RosbridgeLink) -> None:
        self._link = link
        self._question: Future[Message] | None = None
        self._ask_s = float("-inf")
        self.why_not = ""
        """Why none was found, human-readable."""

    def find(self, now_s: float) -> Wrapper | None:
        """Asks, where it is time to, and returns the wrapper that was found."""
        question = self._question
        if question is None:
            if now_s >= self._ask_s:
                self._question = self._link.call_service(_SERVICES, timeout_s=_ASK_S)
            return None
        if not question.done():
            return None
        self._question, self._ask_s = None, now_s + _ASK_AGAIN_S
        return self._read(question)

    def _read(self, question: Future[Message]) -> Wrapper | None:
        try:
            services = question.result().get("services")
        except ServiceError as error:
            self.why_not = f"rosapi does not say which services there are ({error})"
            return None
        if not isinstance(services, list):
            self.why_not = f"{_SERVICES} answers without services"
            return None
        wrapper = next((each for each in WRAPPERS if self._link.url.resolve(each.obtain[0].service) in services), None)
        if wrapper is None:
            namespace = self._link.url.namespace or "/"
            self.why_not = f"{self._link.url} has no services of psdk_ros2 or dji_osdk_ros in the namespace {namespace}"
        else:
            logs.event(_log, logging.INFO, "wrapper_found", wrapper=wrapper.name)
        return wrapper
