"""Interface between the session and a protocol besides flying: it gets an autopilot, messages and ticks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message

Handler = Callable[[Message, float], None]
"""Takes a message, and the time."""


class Protocol(ABC):
    """A protocol with one autopilot. Belongs to the thread that receives, and never blocks.

    It outlives the session, so that each of its exchanges ends.
    """

    is_waiting = True
    """Whether `tick` may have something to do: no call, as that is asked at each step of a flight. What begins an
    exchange sets it; `tick` ends it where exchanges are usual in a flight.
    """

    @property
    @abstractmethod
    def handlers(self) -> Mapping[int, Handler]:
        """Handlers of messages, by id. They do not change."""

    @property
    def is_urgent(self) -> bool:
        """Whether `tick` should be called often, as an answer is awaited."""
        return False

    @abstractmethod
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        """Exchanges with this autopilot from now on. What is in progress with another one ends."""

    def release(self) -> None:  # noqa: B027 - most have nothing open
        """Sends once what closes on the autopilot what this daemon has open there, as the daemon ends.

        No answer is awaited. `drop` follows.
        """

    @abstractmethod
    def drop(self, why: str) -> None:
        """Ends all exchanges: the autopilot has booted, or the daemon ends."""

    @abstractmethod
    def tick(self, now_s: float) -> None:
        """Sends what is due; to be called often."""
