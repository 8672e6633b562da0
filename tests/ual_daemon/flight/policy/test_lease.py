"""The lease by itself: its holder, how it ends, and what is refused meanwhile."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import LeaseHeldError, LeaseLostError
from ual_daemon.flight.policy.lease import EXPIRES_AFTER_S, NOBODY, FlightLease


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
def held(clock: Clock) -> FlightLease:
    """One that nobody holds yet."""
    return FlightLease(clock)


def test_without_a_lease_every_command_may_begin(held: FlightLease) -> None:
    assert held.info is None
    assert held.id == NOBODY
    assert held.refusal("land", NOBODY) is None


def test_while_it_is_held_only_its_holder_may_command(held: FlightLease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    refusal = held.refusal("land", NOBODY)
    assert isinstance(refusal, LeaseHeldError)
    assert (refusal.metadata["holder"], refusal.metadata["identity"]) == ("survey", "laptop")
    assert "survey (laptop) holds the lease since 20" in refusal.message
    assert held.refusal("land", lease_id) is None
    assert held.info is not None


def test_another_one_gets_it_only_by_taking_it(held: FlightLease) -> None:
    first = held.acquire("survey", "laptop", take=False)
    with pytest.raises(LeaseHeldError):
        held.acquire("film", "tablet", take=False)
    second = held.acquire("film", "tablet", take=True)
    assert second != first
    refusal = held.refusal("land", first)
    assert isinstance(refusal, LeaseLostError)
    assert "taken by film (tablet)" in refusal.message


def test_its_holder_gets_the_same_again(held: FlightLease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    assert held.acquire("survey", "laptop", take=False, lease_id=lease_id) == lease_id
    assert held.acquire("survey", "laptop", take=True, lease_id=lease_id) == lease_id


def test_it_lasts_as_long_as_it_is_kept(held: FlightLease, clock: Clock) -> None:
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


def test_it_cannot_be_kept_once_it_was_not(held: FlightLease, clock: Clock) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    clock.now_s += EXPIRES_AFTER_S + 0.1
    with pytest.raises(LeaseLostError, match="it was not kept for 2 s"):
        held.keep(lease_id)
    assert held.expire() is not None
    with pytest.raises(LeaseLostError):
        held.acquire("survey", "laptop", take=False, lease_id=lease_id)


@pytest.mark.parametrize("wrong", ["", "what nobody ever had"])
def test_one_that_never_was_cannot_be_kept_or_released(held: FlightLease, wrong: str) -> None:
    with pytest.raises(LeaseLostError):
        held.keep(wrong)
    assert not held.release(wrong)
    mine = held.acquire("survey", "laptop", take=False)
    with pytest.raises(LeaseLostError):
        held.keep(wrong)
    assert not held.release(wrong)
    held.keep(mine)


def test_once_released_its_identifier_commands_nothing(held: FlightLease) -> None:
    lease_id = held.acquire("survey", "laptop", take=False)
    assert held.release(lease_id)
    assert not held.release(lease_id)
    assert held.refusal("land", NOBODY) is None
    assert isinstance(held.refusal("land", lease_id), LeaseLostError)


@given(st.lists(st.tuples(st.sampled_from("aktrw"), st.integers(0, 2)), max_size=60))
def test_never_two_at_once(steps: list[tuple[str, int]]) -> None:
    clock = Clock()
    held, ids = FlightLease(clock), [NOBODY] * 3

    def may_command(program: int) -> bool:
        return held.refusal("go_to", ids[program]) is None

    for action, program in steps:
        if action in "at":
            try:
                ids[program] = held.acquire(str(program), "", take=action == "t")
            except LeaseHeldError:
                assert held.info is not None
        elif action == "k" and ids[program]:
            try:
                held.keep(ids[program])
            except LeaseLostError:
                ids[program] = NOBODY
        elif action == "r":
            held.release(ids[program])
            ids[program] = NOBODY
        else:
            clock.now_s += 0.9
            held.expire()
        with_lease = [program for program in range(3) if ids[program] and may_command(program)]
        assert len(with_lease) <= 1
        if held.info is not None:
            assert not any(may_command(program) for program in range(3) if program not in with_lease)
