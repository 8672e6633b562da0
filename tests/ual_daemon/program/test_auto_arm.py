"""The simulated safety pilot's patience and end, with hand-made updates."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from typing import cast

import pytest

from ual.errors import PermissionDeniedError, RejectedByAutopilotError
from ual.types import State
from ual_daemon.program.auto_arm import auto_arm
from ual_daemon.server.telemetry_stream import Updates

STEP_S = 0.125


class EntranceStub:
    """A vehicle, its clock, its updates and its pilot in one; ends when the script of states does."""

    def __init__(self, states: list[State], *, real_from: int | None = None, refuses: bool = False) -> None:
        self._states = states
        self._real_from = real_from
        self._refuses = refuses
        self.count = 0
        self.armed_at: list[int] = []

    def now_s(self) -> float:
        return self.count * STEP_S

    @property
    def state(self) -> State:
        return self._states[self.count]

    async def change(self, timeout_s: float | None = None) -> None:
        before = self.state
        while True:
            self.count += 1
            if self.count == len(self._states):
                raise asyncio.CancelledError
            if timeout_s is not None or self.state is not before:
                return

    def may_arm(self) -> bool:
        if self._real_from is not None and self.count >= self._real_from:
            raise PermissionDeniedError("it is a flight controller")
        return True

    def arm(self) -> None:
        self.armed_at.append(self.count)
        if self._refuses:
            raise RejectedByAutopilotError("no GPS")

    def run(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(auto_arm(self, self, cast("Updates", self)))


STANDS, FLIES = State.LANDED_DISARMED, State.FLYING_AUTO


def test_he_arms_when_it_has_stood_a_while_and_again_after_each_landing() -> None:
    desk = EntranceStub([STANDS] * 12 + [FLIES] * 20 + [STANDS] * 12)
    desk.run()
    assert desk.armed_at == [8, 40]


def test_he_does_not_arm_what_does_not_stand() -> None:
    desk = EntranceStub([FLIES] * 30 + [State.UNINITIALIZED] * 30 + [STANDS] * 8)
    desk.run()
    assert desk.armed_at == []


def test_he_leaves_for_good_when_it_turns_out_to_be_real_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    desk = EntranceStub([STANDS] * 60, real_from=5)
    with caplog.at_level(logging.ERROR):
        desk.run()
    assert desk.armed_at == []
    assert desk.count == 5
    assert [vars(record).get("ual_event") for record in caplog.records] == ["auto_arm_ended"]


def test_a_refusal_is_reported_once_and_he_tries_again(caplog: pytest.LogCaptureFixture) -> None:
    desk = EntranceStub([STANDS] * 60, refuses=True)
    with caplog.at_level(logging.WARNING):
        desk.run()
    assert len(desk.armed_at) > 3
    assert [vars(record).get("ual_event") for record in caplog.records] == ["auto_arm_refused"]
