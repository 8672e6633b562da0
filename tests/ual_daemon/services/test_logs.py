"""One download at a time, what may be asked for, and how it ends, with a backend that is made up."""

from __future__ import annotations

import hashlib
from concurrent.futures import Future
from typing import TypeVar

import pytest

from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
)
from ual.logs import Log
from ual.logs.values import LogChunk
from ual.types import State
from ual_daemon.backends.offers.logs import AutopilotLogs
from ual_daemon.services._derived import Logs
from ual_daemon.services.answers import Steps
from ual_daemon.services.logs import CHUNK_BYTES, LONGEST_ID_CHARACTERS, UNTAKEN_S, VehicleLogs

T = TypeVar("T")
CONTENT = bytes(range(256)) * 1000
LOG = Log("a/b.ulg", len(CONTENT), 5.0)


class Offer(AutopilotLogs):
    """Gives `content` at once. With `error`, that instead."""

    def __init__(self) -> None:
        self.content = CONTENT
        self.error: Exception | None = None
        self.read_sizes: list[int] = []

    def read_all(self) -> Future[list[Log]]:
        future: Future[list[Log]] = Future()
        future.set_result([Log("old", 1), LOG])
        return future

    def read(self, log_id: str, offset: int, size: int) -> Future[bytes]:
        assert log_id == LOG.id
        future: Future[bytes] = Future()
        self.read_sizes.append(size)
        if self.error is None:
            future.set_result(self.content[offset : offset + size])
        else:
            future.set_exception(self.error)
        return future


class Vehicle:
    ns, backend_name, is_watch_only = "uav_1", "made_up", True

    def __init__(self, offer: Offer | None) -> None:
        self._offer = offer

    def state(self) -> State:
        return State.FLYING_AUTO

    def offer(self, kind: type[T]) -> T | None:
        return self._offer if isinstance(self._offer, kind) else None

    def is_armed(self) -> bool | None:
        return True

    def require_lease(self, command: str, lease_id: str) -> None:
        raise AssertionError


@pytest.fixture
def offer() -> Offer:
    return Offer()


@pytest.fixture
def logs(offer: Offer) -> Logs:
    return Logs(Vehicle(offer))


def test_a_log_comes_in_pieces_with_the_hash_at_the_end(logs: Logs, offer: Offer) -> None:
    assert logs.get_all()[-1] == LOG
    chunks = list(logs.download(LOG.id))
    assert b"".join(each.data for each in chunks) == CONTENT
    assert [each.offset for each in chunks] == list(range(0, len(CONTENT), CHUNK_BYTES))
    assert [each.sha256 for each in chunks] == [*[""] * 7, hashlib.sha256(CONTENT).hexdigest()]
    assert max(offer.read_sizes) == CHUNK_BYTES


@pytest.mark.parametrize("offset", [1, CHUNK_BYTES, len(CONTENT) - 1, len(CONTENT)])
def test_a_download_goes_on_from_an_offset(logs: Logs, offset: int) -> None:
    chunks = list(logs.download(LOG.id, offset))
    assert b"".join(each.data for each in chunks) == CONTENT[offset:]
    assert chunks[-1].sha256 == hashlib.sha256(CONTENT[offset:]).hexdigest()


@pytest.mark.parametrize(
    ("log_id", "offset", "text"),
    [
        ("new", 0, "no log new; the newest are old, a/b.ulg"),
        ("", 0, "is no log"),
        ("x" * (LONGEST_ID_CHARACTERS + 1), 0, "is no log"),
        (LOG.id, -1, "is negative"),
        (LOG.id, len(CONTENT) + 1, f"has {len(CONTENT)} bytes"),
    ],
)
def test_what_cannot_be_is_refused_and_the_next_one_may_begin(logs: Logs, log_id: str, offset: int, text: str) -> None:
    with pytest.raises(InvalidArgumentError, match=text):
        list(logs.download(log_id, offset))
    assert list(logs.download(LOG.id))


def test_one_at_a_time(offer: Offer) -> None:
    logs = VehicleLogs(Vehicle(offer))
    first = logs.download(LOG.id, 0)
    assert isinstance(next(first), Future)
    with pytest.raises(ResourceExhaustedError, match=r"log a/b\.ulg of uav_1 is being downloaded: one at a time"):
        next(logs.download("old", 0))
    first.close()
    assert isinstance(next(logs.download("old", 0)), Future)


def test_a_download_of_which_nothing_is_taken_is_replaced_by_another(offer: Offer) -> None:
    now_s = 0.0
    logs = VehicleLogs(Vehicle(offer), lambda: now_s)

    def next_chunk(steps: Steps[LogChunk]) -> LogChunk:
        step: object = next(steps)
        while isinstance(step, Future):
            step = steps.send(step.result())
        assert isinstance(step, LogChunk)
        return step

    untaken = logs.download(LOG.id, 0)
    next_chunk(untaken)
    now_s = UNTAKEN_S
    with pytest.raises(ResourceExhaustedError, match="one at a time"):
        next(logs.download(LOG.id, 0))
    now_s = UNTAKEN_S + 1.0
    second = logs.download(LOG.id, 0)
    next_chunk(second)
    with pytest.raises(ResourceExhaustedError, match=f"another download began: go on at {CHUNK_BYTES}"):
        next(untaken)
    with pytest.raises(ResourceExhaustedError, match="one at a time"):  # the end of the first one does not free it
        next(logs.download(LOG.id, 0))
    assert next_chunk(second).offset == CHUNK_BYTES


def test_a_broken_link_ends_a_download_and_the_next_one_may_begin(logs: Logs, offer: Offer) -> None:
    offer.error = LinkLostError("nothing comes")
    with pytest.raises(LinkLostError):
        list(logs.download(LOG.id))
    offer.error = None
    assert len(list(logs.download(LOG.id))) == 8


def test_a_log_that_has_become_shorter_is_an_error(logs: Logs, offer: Offer) -> None:
    offer.content = CONTENT[:100_000]
    with pytest.raises(RejectedByAutopilotError, match="ends at 100000 of 256000 bytes"):
        list(logs.download(LOG.id))


def test_a_backend_without_logs_refuses_everything() -> None:
    logs = Logs(Vehicle(None))
    with pytest.raises(NotSupportedError, match="the backend made_up of uav_1 does not offer them"):
        logs.get_all()
    with pytest.raises(NotSupportedError):
        next(logs.download(LOG.id))
