"""Allowed orders to the payload of a UAV, with a backend and a UAV that are made up."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import pytest

from tests.ual_daemon.services.limits import limit
from ual.errors import (
    InvalidArgumentError,
    LeaseHeldError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    UalError,
    UalTimeoutError,
    WrongStateError,
)
from ual.gripper import Equipment, GripperInfo, GripperState, RelayInfo, ServoInfo, WinchAction, WinchInfo, WinchStatus
from ual.types import State
from ual_daemon.backends import futures
from ual_daemon.backends.chain import done
from ual_daemon.backends.offers.gripper import GripperDriver, ServoOrder, WinchOrder
from ual_daemon.services._derived import Gripper
from ual_daemon.services.gripper import VehicleGripper
from ual_daemon.settings import GripperSettings, PayloadSettings, RelaySettings, ServoSettings, WinchSettings
from ual_daemon.vehicle import equipment

T = TypeVar("T")

PAYLOAD = PayloadSettings(
    grippers=(GripperSettings(name="claw"),),
    winches=(WinchSettings(name="hook", instance=2, longest_m=20.0, fastest_m_s=1.5),),
    servos=(
        ServoSettings(
            name="door", channel=9, min_pwm_us=1000, max_pwm_us=2000, positions={"open": 1100, "closed": 1900}
        ),
        ServoSettings(name="vent", channel=10, min_pwm_us=1400, max_pwm_us=1600),
    ),
    relays=(RelaySettings(name="lamp", number=3, on_name="lit", off_name="dark"),),
)


class MadeUp(GripperDriver):
    """An autopilot that obeys, and says what a test has set."""

    def __init__(self) -> None:
        self.orders: list[object] = []
        self.answer: Callable[[], Future[None]] = lambda: done(None)
        self.unknown: UalError | None = None

    def grip(self, instance: int) -> Future[None]:
        return self._order(("grip", instance))

    def release(self, instance: int) -> Future[None]:
        return self._order(("release", instance))

    def gripper_state(self, instance: int) -> Future[GripperState]:
        return self._status_text(GripperState.CLOSED)

    def order_winch(self, instance: int, order: WinchOrder) -> Future[None]:
        return self._order((instance, order))

    def winch_status(self, instance: int) -> Future[WinchStatus]:
        return self._status_text(WinchStatus(length_m=3.0))

    def set_servo(self, order: ServoOrder) -> Future[None]:
        return self._order(order)

    def servo_pwm_us(self, channel: int) -> Future[int]:
        return self._status_text({9: 1900, 10: 1500}[channel])

    def set_relay(self, number: int, *, is_on: bool) -> Future[None]:
        return self._order((number, is_on))

    def relay_is_on(self, number: int) -> Future[bool]:
        return self._status_text(True)

    def _order(self, order: object) -> Future[None]:
        self.orders.append(order)
        return self.answer()

    def _status_text(self, value: T) -> Future[T]:
        if self.unknown is None:
            return done(value)
        failed: Future[T] = Future()
        futures.fail(failed, self.unknown)
        return failed


class Vehicle:
    """A UAV that carries something."""

    ns, backend_name = "uav_1", "made_up"

    def __init__(self, offer: MadeUp | None, payload: PayloadSettings = PAYLOAD) -> None:
        self._offer = offer
        self.equipment = equipment.PayloadEquipment(payload)
        self.is_watch_only = False
        self.leases: list[tuple[str, str]] = []
        self.is_leased = False

    def state(self) -> State:
        return State.FLYING_AUTO

    def offer(self, kind: type[T]) -> T | None:
        return self._offer if isinstance(self._offer, kind) else None

    def is_armed(self) -> bool | None:
        return True

    def require_lease(self, command: str, lease_id: str) -> None:
        self.leases.append((command, lease_id))
        if self.is_leased:
            raise LeaseHeldError("another flies")


@pytest.fixture
def autopilot() -> MadeUp:
    return MadeUp()


@pytest.fixture
def vehicle(autopilot: MadeUp) -> Vehicle:
    return Vehicle(autopilot)


@pytest.fixture
def carried(vehicle: Vehicle) -> Gripper:
    return Gripper(vehicle, lambda: "mine")


def test_orders_get_to_the_autopilot_by_their_numbers(carried: Gripper, autopilot: MadeUp, vehicle: Vehicle) -> None:
    carried.grip()
    carried.release("claw")
    carried.order_winch(WinchAction.LENGTH, length_m=-20.0, rate_m_s=1.5)
    carried.order_winch(WinchAction.RATE, winch="hook", rate_m_s=-1.5)
    carried.order_winch(WinchAction.HOLD)
    carried.set_servo("open", servo="door")
    carried.set_servo(servo="vent", pwm_us=1600)
    carried.set_relay("lit")
    carried.set_relay("dark", relay="lamp")
    assert autopilot.orders == [
        ("grip", 1),
        ("release", 1),
        (2, WinchOrder(WinchAction.LENGTH, -20.0, 1.5)),
        (2, WinchOrder(WinchAction.RATE, None, -1.5)),
        (2, WinchOrder(WinchAction.HOLD)),
        ServoOrder(9, 1100, 1000, 2000),
        ServoOrder(10, 1600, 1400, 1600),
        (3, True),
        (3, False),
    ]
    assert vehicle.leases[0] == ("order the gripper claw", "mine")
    assert len(vehicle.leases) == 9


@pytest.mark.parametrize(
    ("order", "field", "words"),
    [
        (lambda it: it.grip("hand"), "gripper", "no gripper 'hand' is configured; there are: claw"),
        (lambda it: it.release(3), "gripper", "not of type str"),
        (lambda it: it.set_servo("open"), "servo", "say which: door, vent"),
        (lambda it: it.set_servo(servo="door"), "position", "give either the name of a position, or a pwm_us"),
        (lambda it: it.set_servo("open", servo="door", pwm_us=1100), "position", "give either"),
        (lambda it: it.set_servo("open", servo="vent"), "position", "the servo vent has no 'open'; it has: none"),
        (lambda it: it.set_servo(servo="door", pwm_us=2001), "pwm_us", "2001 is not from 1000 to 2000"),
        (lambda it: it.set_servo(servo="door", pwm_us=999), "pwm_us", "999 is not from 1000 to 2000"),
        (lambda it: it.set_servo(servo="door", pwm_us=1500.5), "pwm_us", "not of type int"),
        (lambda it: it.set_relay("on"), "state", "the relay lamp has no state 'on': it has lit, dark"),
        (lambda it: it.order_winch("hold"), "action", "not of type WinchAction"),
        (lambda it: it.order_winch(WinchAction.LENGTH), "length_m", "LENGTH needs it"),
        (lambda it: it.order_winch(WinchAction.LENGTH, length_m=0), "length_m", "order HOLD to stop"),
        (lambda it: it.order_winch(WinchAction.LENGTH, length_m=20.1), "length_m", "20.1"),
        (lambda it: it.order_winch(WinchAction.LENGTH, length_m=float("nan")), "length_m", "not a finite number"),
        (lambda it: it.order_winch(WinchAction.LENGTH, length_m=1, rate_m_s=-1), "rate_m_s", "-1"),
        (lambda it: it.order_winch(WinchAction.RATE), "rate_m_s", "RATE needs it"),
        (lambda it: it.order_winch(WinchAction.RATE, rate_m_s=1.6), "rate_m_s", "1.6"),
        (lambda it: it.order_winch(WinchAction.RATE, rate_m_s=1, length_m=1), "length_m", "only LENGTH has a length"),
        (lambda it: it.order_winch(WinchAction.RETRACT, rate_m_s=1), "rate_m_s", "only RATE and LENGTH have a rate"),
    ],
)
def test_what_cannot_be_meant_moves_nothing(
    carried: Gripper, autopilot: MadeUp, order: Callable[[Any], None], field: str, words: str
) -> None:
    with pytest.raises(InvalidArgumentError) as caught:
        order(carried)
    assert caught.value.metadata["field"] == field
    assert words in caught.value.message
    assert autopilot.orders == []


def test_what_is_not_configured_is_never_moved(autopilot: MadeUp) -> None:
    bare = Gripper(Vehicle(autopilot, PayloadSettings()), lambda: "")
    orders: list[Callable[[], None]] = [
        bare.grip,
        bare.release,
        lambda: bare.order_winch(WinchAction.HOLD),
        lambda: bare.set_servo(pwm_us=1500),
        lambda: bare.set_relay("on"),
    ]
    for order in orders:
        with pytest.raises(InvalidArgumentError, match=r"is configured: name it in the daemon's settings, payload\."):
            order()
    assert autopilot.orders == []
    assert bare.get_all() == Equipment()


def test_without_the_lease_or_only_watching_nothing_is_ordered(vehicle: Vehicle, autopilot: MadeUp) -> None:
    carried = Gripper(vehicle, lambda: "")
    vehicle.is_leased = True
    with pytest.raises(LeaseHeldError):
        carried.release()
    vehicle.is_watch_only = True
    with pytest.raises(PermissionDeniedError):
        carried.set_relay("lit")
    assert autopilot.orders == []
    assert carried.get_all().relays[0].is_on is True


def test_without_an_offer_nothing_is_there() -> None:
    carried = Gripper(Vehicle(None), lambda: "")
    with pytest.raises(NotSupportedError):
        carried.get_all()
    with pytest.raises(NotSupportedError):
        carried.release()


def test_what_is_and_what_was_ordered_are_distinguished(carried: Gripper) -> None:
    carried.release()
    carried.set_servo(servo="vent", pwm_us=1450)
    carried.order_winch(WinchAction.LENGTH, length_m=2.5)
    assert carried.get_all() == Equipment(
        (GripperInfo("claw", GripperState.CLOSED, "release"),),
        (WinchInfo("hook", WinchStatus(length_m=3.0), "length 2.5 m"),),
        (
            ServoInfo("door", 1000, 2000, (("open", 1100), ("closed", 1900)), 1900, "closed"),
            ServoInfo("vent", 1400, 1600, (), 1500, "", "1450 us"),
        ),
        (RelayInfo("lamp", "lit", "dark", True),),
    )


def test_what_the_autopilot_does_not_say_is_unknown_with_the_reason(carried: Gripper, autopilot: MadeUp) -> None:
    autopilot.unknown = LinkLostError("no autopilot is heard")
    found = carried.get_all()
    assert found.grippers == (GripperInfo("claw", GripperState.UNKNOWN, "", "no autopilot is heard"),)
    assert found.winches[0].status is None
    assert (found.servos[0].pwm_us, found.servos[0].position) == (None, "")
    assert (found.relays[0].is_on, found.relays[0].note) == (None, "no autopilot is heard")


def test_an_order_in_progress_keeps_its_device(vehicle: Vehicle, autopilot: MadeUp) -> None:
    waiting: list[Future[None]] = []

    def answer() -> Future[None]:
        waiting.append(Future())
        return waiting[-1]

    autopilot.answer = answer
    of_vehicle = VehicleGripper(vehicle)
    first = of_vehicle.set_servo("open", "door", None, "")
    with pytest.raises(WrongStateError):
        of_vehicle.set_servo("closed", "door", None, "")
    of_vehicle.set_servo("", "vent", 1500, "")
    waiting[0].set_result(None)
    assert first.result(0) is None
    of_vehicle.set_servo("closed", "door", None, "")
    assert len(autopilot.orders) == 3


def test_an_order_that_never_ends_is_abandoned(
    carried: Gripper, autopilot: MadeUp, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit(monkeypatch, "Release", 0.0)
    never: Future[None] = Future()
    autopilot.answer = lambda: never
    with pytest.raises(UalTimeoutError):
        carried.release()
    assert never.cancelled()
