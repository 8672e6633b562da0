"""The lease by itself: who has it, how it ends, and what is refused meanwhile."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import LeaseHeldError, LeaseLostError
from ual_daemon.flight.policy import lease
from ual_daemon.flight.policy.lease import EXPIRES_AFTER_S, Lease, carried


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def held(clock: Clock) -> Iterator[Lease]:
    """One that nobody holds yet."""
    token = carried.set(lease.NOBODY)
    yield Lease(clock)
    carried.reset(token)


def test_without_a_lease_every_command_may_begin(held: Lease) -> None:
    assert held.info is None
    assert carried.get() == held.id
    assert held.refusal("land") is None


def test_while_it_is_held_only_its_holder_may_command(held: Lease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    refusal = held.refusal("land")
    assert isinstance(refusal, LeaseHeldError)
    assert (refusal.metadata["holder"], refusal.metadata["identity"]) == ("survey", "laptop")
    assert "survey (laptop) holds the lease since 20" in refusal.message
    carried.set(lease_id)
    assert held.refusal("land") is None
    assert held.info is not None


def test_another_one_gets_it_only_by_taking_it(held: Lease) -> None:
    first = held.acquire("survey", "laptop", take=False)
    with pytest.raises(LeaseHeldError):
        held.acquire("film", "tablet", take=False)
    second = held.acquire("film", "tablet", take=True)
    assert second != first
    carried.set(first)
    refusal = held.refusal("land")
    assert isinstance(refusal, LeaseLostError)
    assert "taken by film (tablet)" in refusal.message


def test_its_holder_gets_the_same_again(held: Lease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    carried.set(lease_id)
    assert held.acquire("survey", "laptop", take=False) == lease_id
    assert held.acquire("survey", "laptop", take=True) == lease_id


def test_it_lasts_as_long_as_it_is_kept(held: Lease, clock: Clock) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    for _ in range(10):
        clock.now_s += EXPIRES_AFTER_S - 0.1
        held.keep(lease_id)
        assert held.expire() is None
    clock.now_s += EXPIRES_AFTER_S + 0.1
    ended = held.expire()
    assert ended is not None
    assert ended.holder == "survey"
    assert held.expire() is None  # once
    assert held.info is None


def test_it_cannot_be_kept_once_it_was_not(held: Lease, clock: Clock) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    clock.now_s += EXPIRES_AFTER_S + 0.1
    with pytest.raises(LeaseLostError, match="it was not kept for 2 s"):
        held.keep(lease_id)
    assert held.expire() is not None
    carried.set(lease_id)
    with pytest.raises(LeaseLostError):
        held.acquire("survey", "laptop", take=False)


@pytest.mark.parametrize("wrong", ["", "what nobody ever had"])
def test_one_that_never_was_cannot_be_kept_or_released(held: Lease, wrong: str) -> None:
    with pytest.raises(LeaseLostError):
        held.keep(wrong)
    assert not held.release(wrong)
    mine = held.acquire("survey", "laptop", take=False)
    with pytest.raises(LeaseLostError):
        held.keep(wrong)
    assert not held.release(wrong)
    held.keep(mine)


def test_once_released_its_identifier_commands_nothing(held: Lease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    assert held.release(lease_id)
    assert not held.release(lease_id)
    assert held.refusal("land") is None
    carried.set(lease_id)
    assert isinstance(held.refusal("land"), LeaseLostError)


@given(st.lists(st.tuples(st.sampled_from("aktrw"), st.integers(0, 2)), max_size=60))
def test_never_two_at_once(steps: list[tuple[str, int]]) -> None:
    clock = Clock()
    held, ids = Lease(clock), [lease.NOBODY] * 3

    def may_command(program: int) -> bool:
        carried.set(ids[program])
        return held.refusal("go_to") is None

    for action, program in steps:
        carried.set(lease.NOBODY)
        if action in "at":
            try:
                ids[program] = held.acquire(str(program), "", take=action == "t")
            except LeaseHeldError:
                assert held.info is not None
        elif action == "k" and ids[program]:
            try:
                held.keep(ids[program])
            except LeaseLostError:
                ids[program] = lease.NOBODY
        elif action == "r":
            held.release(ids[program])
            ids[program] = lease.NOBODY
        else:
            clock.now_s += 0.9
            held.expire()
        with_lease = [program for program in range(3) if ids[program] and may_command(program)]
        assert len(with_lease) <= 1
        if held.info is not None:
            assert not any(may_command(program) for program in range(3) if program not in with_lease)
    carried.set(lease.NOBODY)
