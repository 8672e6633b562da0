"""What a user's program does, the same for all ways to fly."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

_CONNECT_S = 30.0


@dataclass
class Times:
    """The numbers that were seen, and when (monotonic clock)."""

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
        """Returns once a setpoint can be given, and one was: what happens only at the beginning has happened."""

    @abstractmethod
    def pace(self, first: int, count: int, rate_hz: float) -> Times:
        """Gives setpoints at a rate; when each was given."""

    @abstractmethod
    def flood(self, first: int, duration_s: float) -> int:
        """Gives setpoints as fast as it can for a while; how many."""

    def listen(self, subscribers_count: int, duration_s: float) -> Times:
        """Subscribes to the position so many times; when which one came, for all subscribers."""
        raise NotImplementedError(f"{type(self).__name__} has no telemetry")

    @abstractmethod
    def close(self) -> None:
        """Ends it."""


class SynchronousPeer(Peer):
    """One whose setpoints are given by calls that return when it is done."""

    @abstractmethod
    def send(self, number: int) -> None:
        """Gives one setpoint."""

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
    """Waits for a condition of the beginning."""
    deadline_s = time.monotonic() + _CONNECT_S
    while not is_done():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"{what}: not within {_CONNECT_S:g} s")
        time.sleep(0.01)
