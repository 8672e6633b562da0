"""The parameters of a simulated Crazyflie through the class, and their exchanges packet by packet."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any

import pytest

from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.waiting import until
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
    WrongStateError,
)
from ual.parameters import Parameter, ParameterType
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.crazyflie.packets import PARAMETER, READ_CHANNEL, WRITE_CHANNEL, CrtpPacket
from ual_daemon.backends.crazyflie.parameter_exchanges import (
    LIMIT_S,
    MOST_WAITING_EXCHANGES,
    REQUESTS_AT_ONCE,
    ParameterExchanges,
)
from ual_daemon.backends.crazyflie.requests import CrtpRequests
from ual_daemon.backends.crazyflie.toc import Variable

GAIN, SPEED = "pid_attitude.yaw_kp", "posCtlPid.xVelMax"


@pytest.fixture
def backend() -> LockstepCrazyflie:
    return LockstepCrazyflie(BackendOptions("uav_1"))


@pytest.fixture
def uav(backend: LockstepCrazyflie) -> Iterator[UAL]:
    with UAL(backend, allow_arming=True) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        yield uav


def test_all_are_listed_in_the_order_of_the_firmware_with_their_types(uav: UAL, backend: LockstepCrazyflie) -> None:
    listed = uav.parameters.get_all()
    assert [each.name for each in listed] == list(backend.crazyflie.parameters)
    assert {each.name: each.value for each in listed} == {
        name: value for name, (_, value, _) in backend.crazyflie.parameters.items()
    }
    types = {each.name: each.type for each in listed}
    assert (types["deck.bcFlow2"], types[SPEED]) == (ParameterType.UINT8, ParameterType.REAL32)
    assert {each.name for each in listed if each.is_relied_on} >= {SPEED, GAIN, "stabilizer.controller"}


def test_one_is_written_and_read_back_and_what_ual_flies_by_follows(uav: UAL, backend: LockstepCrazyflie) -> None:
    assert uav.parameters.set("activemarker.MODE", 2) == Parameter("activeMarker.mode", 2, ParameterType.UINT8)
    assert backend.crazyflie.parameters["activeMarker.mode"][1] == 2
    for axis in "xy":
        uav.parameters.set(f"posCtlPid.{axis}VelMax", 0.5)
    before_m_s = backend.info().limits.climb_speed_m_s
    until(lambda: backend.info().limits.horizontal_speed_m_s < 0.51, "the new limit", seen=backend.info)
    assert backend.info().limits.climb_speed_m_s == before_m_s


def test_what_it_does_not_have_or_keeps_is_an_error(uav: UAL) -> None:
    with pytest.raises(InvalidArgumentError, match=r"has no parameter pid\.none"):
        uav.parameters.get("pid.none")
    with pytest.raises(RejectedByAutopilotError, match="can only be read"):
        uav.parameters.set("deck.bcFlow2", 1)
    with pytest.raises(InvalidArgumentError, match="is out of range"):
        uav.parameters.set("activeMarker.mode", 300)


def test_none_on_which_a_flight_relies_is_written_while_armed_however_it_is_typed(uav: UAL) -> None:
    uav.arm()
    with pytest.raises(WrongStateError, match="the UAV is armed"):
        uav.parameters.set("activeMarker.mode", 1)
    assert uav.parameters.set("activeMarker.mode", 1, force=True).value == 1
    for name in (SPEED, SPEED.upper()):
        with pytest.raises(WrongStateError, match=f"a flight relies on {SPEED}|a flight relies on {SPEED.upper()}"):
            uav.parameters.set(name, 0.3, force=True)
    assert uav.parameters.get(SPEED).value == 1.0
    uav.disarm()


class Bench:
    """The exchanges of a firmware with some parameters, and what is sent to it."""

    def __init__(self, count: int = 10) -> None:
        self.sent: list[CrtpPacket] = []
        self.now_s = 100.0
        self.is_connected = True
        self.written: list[Parameter] = []
        self.table = {f"a.p{number}": Variable(number, "f", is_read_only=False) for number in range(count)}
        self.table["a.wide"] = Variable(count, "Q", is_read_only=False)
        self.requests = CrtpRequests(self.sent.append)
        self.exchanges = ParameterExchanges(self.requests, lambda: self.table, self.written.append)

    def tick(self, passed_s: float = 0.0) -> list[tuple[int, int]]:
        """Returns what is sent: channels and numbers."""
        self.now_s += passed_s
        self.exchanges.tick(self.now_s, is_connected=self.is_connected)
        self.requests.step(self.now_s)
        sent, self.sent[:] = [(each.channel, int.from_bytes(each.data[:2], "little")) for each in self.sent], []
        return sent

    def answer(self, channel: int, ident: int, value: float) -> None:
        head = struct.pack("<H", ident) + (b"\0" if channel == READ_CHANNEL else b"")
        self.requests.on_packet(CrtpPacket(PARAMETER, channel, head + struct.pack("<f", value)))


def error_of(future: Future[Any]) -> UalError:
    error = future.exception(timeout=0)
    assert isinstance(error, UalError)
    return error


def test_a_list_leaves_room_for_commands_and_asks_again_for_what_is_lost() -> None:
    bench, future = Bench(), Future[list[Parameter]]()
    bench.exchanges.read_all(future)
    assert bench.tick() == [(READ_CHANNEL, number) for number in range(REQUESTS_AT_ONCE)]
    bench.answer(READ_CHANNEL, 2, 2.5)
    assert bench.tick() == [(READ_CHANNEL, REQUESTS_AT_ONCE)]
    assert set(bench.tick(0.15)) == {(READ_CHANNEL, number) for number in (0, 1, 3, 4)}
    for number in range(10):
        bench.answer(READ_CHANNEL, number, number + 0.5)
        bench.tick()
        bench.answer(READ_CHANNEL, number, number + 0.5)
        bench.tick()
    assert [each.value for each in future.result(timeout=0)] == [number + 0.5 for number in range(10)]
    assert bench.requests.is_empty


def test_each_ends_where_nothing_answers_or_the_link_is_lost() -> None:
    bench = Bench()
    one, two, all_of_them = Future[Parameter](), Future[Parameter](), Future[list[Parameter]]()
    bench.exchanges.read("a.p1", one)
    bench.exchanges.read("a.p2", two)
    bench.exchanges.read_all(all_of_them)
    bench.tick()
    bench.tick(LIMIT_S + 1.0)
    assert isinstance(error_of(one), UalTimeoutError)
    bench.is_connected = False
    for _ in range(3):
        bench.tick()
    assert isinstance(error_of(two), LinkLostError)
    assert isinstance(error_of(all_of_them), LinkLostError)
    assert bench.requests.is_empty


def test_a_value_that_is_not_kept_is_an_error_with_what_is() -> None:
    bench, future = Bench(), Future[Parameter]()
    bench.exchanges.write(Parameter("a.p3", 0.25, ParameterType.REAL32), lambda: None, future)
    assert bench.tick() == [(WRITE_CHANNEL, 3)]
    bench.answer(WRITE_CHANNEL, 3, 0.25)
    assert bench.tick() == [(READ_CHANNEL, 3)]
    bench.answer(READ_CHANNEL, 3, 1.0)
    assert error_of(future).metadata["kept"] == "1"
    assert bench.written == [Parameter("a.p3", 1.0, ParameterType.REAL32)]


def test_what_may_not_be_written_any_more_is_not_sent_again() -> None:
    bench, future = Bench(), Future[Parameter]()
    armed: list[UalError] = []
    wanted = Parameter("a.p3", 0.25, ParameterType.REAL32)
    bench.exchanges.write(wanted, lambda: armed[0] if armed else None, future)
    assert bench.tick() == [(WRITE_CHANNEL, 3)]
    armed.append(WrongStateError("it is armed"))
    assert bench.tick(0.2) == []
    assert error_of(future) is armed[0]
    assert bench.tick(1.0) == []


def test_a_defect_of_one_exchange_ends_that_one_only() -> None:
    """It reached the thread that flies, whose setpoints stop then, and a Crazyflie falls without them."""

    def fail() -> UalError | None:
        raise ZeroDivisionError

    bench, failed, read = Bench(), Future[Parameter](), Future[Parameter]()
    bench.exchanges.write(Parameter("a.p3", 0.25, ParameterType.REAL32), fail, failed)
    bench.exchanges.read("a.p1", read)
    assert bench.tick() == []
    assert "a defect of UAL: ZeroDivisionError" in str(error_of(failed))
    assert bench.tick() == [(READ_CHANNEL, 1)]


def test_there_are_limits() -> None:
    bench = Bench()
    futures = [Future[Parameter]() for _ in range(MOST_WAITING_EXCHANGES + 1)]
    for each in futures:
        bench.exchanges.read("a.p1", each)
    assert isinstance(error_of(futures[-1]), ResourceExhaustedError)
    wide = Future[Parameter]()
    bench.exchanges.read("a.wide", wide)
    assert isinstance(error_of(wide), NotSupportedError)
