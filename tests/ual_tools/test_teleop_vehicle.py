"""One UAV of `ual teleop`, with a daemon that answers when the test says so."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, cast

from tests.waiting import LIMIT_S, until
from ual.errors import DaemonUnreachableError, UalError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import Uav
from ual.types import Info, Setpoint
from ual_tools.teleop.vehicle import DROPPED, STALE_SETPOINT_S, TeleopVehicle

FORWARD = TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)))
LEFT = TwistStamped(Twist(Vector3(0.0, 1.0, 0.0)))
STEP = PoseStamped(Pose.at(1.0, 0.0, 2.0))


class HeldLease:
    lost: UalError | None = None


class FakeUav:
    """Takes all; a lease as `answer` does."""

    def __init__(self, answer: Callable[[], object]) -> None:
        self.taken: list[Setpoint] = []
        self.leases: list[bool] = []
        self._answer = answer

    def info(self) -> Info:
        return Info("uav_1", "light")

    def subscribe(self, *_: object) -> None:
        pass

    def lease(self, holder: str, *, take: bool) -> HeldLease:
        self.leases.append(take)
        self._answer()
        return HeldLease()

    def set_velocity(self, velocity: TwistStamped) -> None:
        self.taken.append(velocity)

    set_pose: Any = set_velocity

    def abort(self) -> None:
        pass

    def close(self) -> None:
        pass


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s

    def advance(self, duration_s: float) -> None:
        self.now_s += duration_s


@contextmanager
def opened(uav: FakeUav, clock: Clock, *, takes_lease: bool = False) -> Iterator[TeleopVehicle]:
    vehicle = TeleopVehicle(cast("Uav", uav), "uav_1", clock, takes_lease=takes_lease)
    vehicle.open()
    try:
        yield vehicle
    finally:
        vehicle.close()


def test_a_velocity_that_is_old_once_the_lease_is_there_is_not_sent() -> None:
    """The stick was released while the daemon did not answer."""
    clock = Clock()
    uav = FakeUav(lambda: clock.advance(STALE_SETPOINT_S + 4.0))
    with opened(uav, clock) as vehicle:
        vehicle.send(FORWARD)
        until(lambda: uav.leases)
        vehicle.command("stop", lambda uav: uav.abort()).join(LIMIT_S)  # comes after it
        vehicle.send(LEFT)
        until(lambda: uav.taken)
    assert uav.taken == [LEFT]


def test_a_step_that_is_old_once_the_lease_is_there_is_dropped_and_reported() -> None:
    clock = Clock()
    uav = FakeUav(lambda: clock.advance(STALE_SETPOINT_S + 4.0))
    with opened(uav, clock) as vehicle:
        vehicle.send(STEP)
        until(lambda: vehicle.refusal.text)
        assert vehicle.refusal.text == DROPPED
        assert vehicle.was_refused()
    assert not uav.taken


def test_a_lease_that_is_to_be_taken_is_taken_once_the_daemon_answers_again() -> None:
    answers: list[UalError] = [DaemonUnreachableError("no answer")]
    uav = FakeUav(lambda: raising(answers))
    with opened(uav, Clock(), takes_lease=True) as vehicle:
        vehicle.command("land", lambda uav: uav.abort()).join(LIMIT_S)
        assert "no answer" in vehicle.refusal.text
        vehicle.command("land", lambda uav: uav.abort()).join(LIMIT_S)
    assert uav.leases == [True, True]


def raising(errors: list[UalError]) -> None:
    if errors:
        raise errors.pop()
