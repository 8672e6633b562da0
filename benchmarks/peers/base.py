"""The base class of user programs, the same for all ways to fly."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

_CONNECT_S = 30.0


@dataclass
class Times:
    """The numbers that came, and when (monotonic clock)."""

    number: list[int] = field(default_factory=list)
    at_ns: list[int] = field(default_factory=list)

    def add(self, number: int, at_ns: int) -> None:
        self.number.append(number)
        self.at_ns.append(at_ns)


class Peer(ABC):
    """A program that flies the vehicle. `port` is the UDP port to which the vehicle sends, `address` the server's."""

    def __init__(self, port: int, address: str) -> None:
        self.port = port
        self.address = address

    @abstractmethod
    def connect(self) -> None:
        """Returns once a setpoint has been sent, so that everything that happens only once is done."""

    @abstractmethod
    def pace(self, first: int, count: int, rate_hz: float) -> Times:
        """Sends setpoints at a rate. Returns when each was sent."""

    @abstractmethod
    def flood(self, first: int, duration_s: float) -> int:
        """Sends setpoints as fast as it can for a while. Returns how many."""

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        """Subscribes to the position several times. Returns when each position came, for all subscribers."""
        raise NotImplementedError(f"{type(self).__name__} has no telemetry")

    @abstractmethod
    def close(self) -> None:
        """Ends it."""


class SynchronousPeer(Peer):
    """A peer whose setpoints are sent by blocking calls."""

    @abstractmethod
    def send(self, number: int) -> None:
        """Sends one setpoint."""

    def pace(self, first: int, count: int, rate_hz: float) -> Times:
        given = Times()
        due_s = time.monotonic()
        for number in range(first, first + count):
            due_s += 1.0 / rate_hz
            time.sleep(max(0.0, due_s - time.monotonic()))
            given.add(number, time.monotonic_ns())
            self.send(number)
        return given

    def flood(self, first: int, duration_s: float) -> int:
        number, ends_s = first, time.monotonic() + duration_s
        while time.monotonic() < ends_s:
            self.send(number)
            number += 1
        return number - first


def until(is_done: Callable[[], bool], what: str) -> None:
    """Blocks until a condition of the start holds."""
    deadline_s = time.monotonic() + _CONNECT_S
    while not is_done():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"{what}: not within {_CONNECT_S:g} s")
        time.sleep(0.01)
