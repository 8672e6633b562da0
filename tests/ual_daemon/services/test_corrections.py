"""Corrections that are passed on, and their senders, through the class, with a backend and a UAV that are made up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import pytest

from tests.rtcm import message, messages
from ual.corrections import MOST_BYTES, CorrectionsStatus
from ual.errors import InvalidArgumentError, NotSupportedError, PermissionDeniedError, ResourceExhaustedError
from ual.types import State
from ual_daemon.backends.offers.corrections import AutopilotCorrections, Injected
from ual_daemon.services._derived import Corrections
from ual_daemon.services.corrections import (
    BURST_BYTES,
    MOST_BYTES_PER_S,
    CorrectionsStream,
    VehicleCorrections,
)

T = TypeVar("T")


class Offer(AutopilotCorrections):
    def __init__(self) -> None:
        super().__init__()
        self.messages: list[bytes] = []

    def inject(self, message: bytes) -> None:
        self.messages.append(message)

    def injected(self) -> Injected:
        return Injected(len(self.messages), sum(map(len, self.messages)), left_s=7.0 if self.messages else None)

    def now_s(self) -> float:
        return 9.5


class Vehicle:
    ns, backend_name, is_watch_only = "uav_1", "made_up", False

    def __init__(self, offer: Offer | None) -> None:
        self._offer = offer

    def state(self) -> State:
        return State.FLYING_AUTO

    def offer(self, kind: type[T]) -> T | None:
        return self._offer if isinstance(self._offer, kind) else None

    def is_armed(self) -> bool | None:
        return True

    def require_lease(self, command: str, lease_id: str) -> None:
        raise AssertionError("no lease is needed")


@pytest.fixture
def offer() -> Offer:
    return Offer()


@pytest.fixture
def corrections(offer: Offer) -> Corrections:
    return Corrections(Vehicle(offer))


def test_whole_messages_are_passed_on_also_in_flight_and_without_a_lease(
    corrections: Corrections, offer: Offer
) -> None:
    first, second = messages([100, 900])
    assert corrections.status() == CorrectionsStatus()
    status = corrections.stream([first[:40], first[40:] + b"abc" + second[:1], second[1:], first[:9]], "a base")
    assert offer.messages == [first, second]
    assert status == CorrectionsStatus("", 2, 1000, skipped_bytes_count=3, age_s=2.5)


def test_what_is_longer_than_an_element_is_cut(corrections: Corrections, offer: Offer) -> None:
    sent = messages([1000] * 20)
    corrections.stream([b"".join(sent)])
    assert offer.messages == sent
    with pytest.raises(InvalidArgumentError, match=f"at most {MOST_BYTES}"):
        CorrectionsStream(offer, "a base").send(bytes(MOST_BYTES + 1))


def test_a_second_one_is_refused_with_the_name_of_the_first(corrections: Corrections, offer: Offer) -> None:
    refused: list[ResourceExhaustedError] = []

    def meanwhile() -> Iterator[bytes]:
        yield message(50, 1)
        assert corrections.status().sender == "the caster"
        with pytest.raises(ResourceExhaustedError, match="the caster sends them already") as error:
            corrections.stream([message(50, 2)], "a serial base")
        refused.append(error.value)
        yield message(50, 3)

    corrections.stream(meanwhile(), "the caster")
    assert refused[0].metadata["held_by"] == "the caster"
    assert offer.messages == [message(50, 1), message(50, 3)]
    corrections.stream([message(50, 2)], "a serial base")  # its turn now


def test_it_lets_others_send_also_where_the_source_fails(corrections: Corrections) -> None:
    def failing() -> Iterator[bytes]:
        yield message(50)
        raise OSError("unplugged")

    with pytest.raises(OSError, match="unplugged"):
        corrections.stream(failing())
    assert corrections.status().sender == ""


def test_a_flood_is_refused_and_a_burst_is_not(offer: Offer) -> None:
    now_s = [0.0]
    stream = CorrectionsStream(offer, "a base", lambda: now_s[0])
    for _ in range(BURST_BYTES // MOST_BYTES):
        stream.send(bytes(MOST_BYTES))
    with pytest.raises(ResourceExhaustedError, match="bytes a second came from a base") as refused:
        stream.send(b"x")
    assert refused.value.metadata == {"limit": str(MOST_BYTES_PER_S)}
    now_s[0] += 1.0
    for _ in range(4):
        stream.send(bytes(MOST_BYTES))


@pytest.mark.parametrize("wrong", ["text", 5, None])
def test_what_is_no_bytes_is_refused(corrections: Corrections, wrong: object) -> None:
    with pytest.raises(InvalidArgumentError, match="rtcm"):
        corrections.stream([wrong])  # type: ignore[list-item]  # what a program without types may do
    with pytest.raises(InvalidArgumentError, match="sender"):
        corrections.stream([], 5)  # type: ignore[arg-type]


def test_a_daemon_that_only_watches_sends_none_and_a_backend_without_them_says_so(offer: Offer) -> None:
    watching = Vehicle(offer)
    watching.is_watch_only = True
    with pytest.raises(PermissionDeniedError):
        VehicleCorrections(watching).open("a base")
    for ask in (lambda: VehicleCorrections(Vehicle(None)).open("a base"), Corrections(Vehicle(None)).status):
        with pytest.raises(NotSupportedError, match="corrections: the backend made_up"):
            ask()
