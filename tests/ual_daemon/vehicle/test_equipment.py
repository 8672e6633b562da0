"""One order at a time for each device: what is refused, what replaces, and what is remembered."""

from __future__ import annotations

import threading
from concurrent.futures import Future

import pytest

from tests.conftest import LIMIT_S
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual_daemon.settings import PayloadSettings
from ual_daemon.vehicle.equipment import PayloadDevice, PayloadEquipment

CLAW = PayloadDevice("gripper", "claw")


def anybody() -> None:
    """May order."""


class Bench:
    """The orders of a test."""

    def __init__(self) -> None:
        self.equipment = PayloadEquipment(PayloadSettings())
        self.sent: list[Future[None]] = []

    def give(self, text: str, *, holds: bool = False, device: PayloadDevice = CLAW) -> Future[None]:
        return self.equipment.give(device, text, self._begin, holds=holds, require=anybody)

    def _begin(self) -> Future[None]:
        self.sent.append(Future())
        return self.sent[-1]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_what_was_acknowledged_is_remembered(bench: Bench) -> None:
    ordered = bench.give("release")
    assert bench.equipment.ordered(CLAW) == ""
    bench.sent[0].set_result(None)
    assert ordered.result(0) is None
    assert bench.equipment.ordered(CLAW) == "release"
    refused = bench.give("grip", holds=True)
    bench.sent[1].set_exception(RejectedByAutopilotError("no"))
    with pytest.raises(RejectedByAutopilotError):
        refused.result(0)
    assert bench.equipment.ordered(CLAW) == "release"


def test_what_may_let_go_waits_for_the_end_of_what_is_in_progress(bench: Bench) -> None:
    bench.give("grip", holds=True)
    with pytest.raises(WrongStateError, match="the gripper claw is busy: grip is under way"):
        bench.give("release")
    assert len(bench.sent) == 1
    bench.give("release", device=PayloadDevice("gripper", "hand"))
    bench.sent[0].set_result(None)
    bench.give("release")
    assert len(bench.sent) == 3


def test_what_holds_replaces_what_is_in_progress(bench: Bench) -> None:
    before = bench.give("release")
    after = bench.give("grip", holds=True)
    with pytest.raises(TaskAbortedError) as caught:
        before.result(0)
    assert caught.value.metadata == {"by": "grip"}
    assert bench.sent[0].cancelled()
    bench.sent[1].set_result(None)
    assert after.result(0) is None
    assert bench.equipment.ordered(CLAW) == "grip"


def test_an_order_that_is_withdrawn_leaves_the_device_free(bench: Bench) -> None:
    ordered = bench.give("release")
    ordered.cancel()
    assert bench.sent[0].cancelled()
    bench.give("release")
    assert len(bench.sent) == 2
    bench.sent[1].cancel()  # by the backend
    bench.give("release")


def test_what_may_let_go_and_waits_is_withdrawn_by_a_lease_and_what_holds_is_not(bench: Bench) -> None:
    release, grip = bench.give("release"), bench.give("grip", holds=True, device=PayloadDevice("gripper", "hand"))
    bench.equipment.withdraw("somebody has acquired the lease", {"by": "lease"})
    with pytest.raises(
        TaskAbortedError, match="release was withdrawn: somebody has acquired the lease; if it has left"
    ):
        release.result(0)
    assert [each.cancelled() for each in bench.sent] == [True, False]
    bench.sent[1].set_result(None)
    assert grip.result(0) is None


@pytest.mark.parametrize("how", ["withdrawn", "replaced"])
def test_who_waits_for_an_end_may_give_the_next_order(bench: Bench, how: str) -> None:
    """A lease that ends is told by the thread that flies: it must not wait for a lock that it has itself."""
    given: list[Future[None]] = []
    hand = PayloadDevice("gripper", "hand")

    def end() -> None:
        if how == "withdrawn":
            bench.equipment.withdraw("its lease has ended", {"by": "lease"})
        else:
            bench.give("grip", holds=True)

    bench.give("release").add_done_callback(lambda _: given.append(bench.give("grip", holds=True, device=hand)))
    ending = threading.Thread(target=end, daemon=True)
    ending.start()
    ending.join(LIMIT_S)
    assert not ending.is_alive()
    assert len(given) == 1


def test_what_cannot_begin_leaves_the_device_free(bench: Bench) -> None:
    def begin() -> Future[None]:
        raise LinkLostError("gone")

    with pytest.raises(LinkLostError):
        bench.equipment.give(CLAW, "release", begin, holds=False, require=anybody)
    bench.give("release")


def test_an_answer_to_what_was_replaced_changes_nothing(bench: Bench) -> None:
    """The backend may have begun to end it when it is replaced."""
    bench.give("release")
    bench.sent[0].set_running_or_notify_cancel()
    bench.give("grip", holds=True)
    bench.sent[0].set_result(None)
    with pytest.raises(WrongStateError, match="grip is under way"):
        bench.give("release")


def test_a_lease_that_ends_as_an_order_is_allowed_withdraws_it(bench: Bench) -> None:
    """The order was allowed, then the lease ended, and only then was it kept: a load fell in another's flight."""

    def end() -> None:
        bench.equipment.withdraw("its lease has ended", {"by": "lease"})

    ending = threading.Thread(target=end, daemon=True)
    release = bench.equipment.give(CLAW, "release", bench._begin, holds=False, require=ending.start)
    ending.join(LIMIT_S)
    assert bench.sent[0].cancelled()
    assert isinstance(release.exception(0), TaskAbortedError)
