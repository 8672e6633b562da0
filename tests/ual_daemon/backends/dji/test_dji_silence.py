"""An aircraft that is not heard, because its wrapper stalls or has died."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

import pytest

from tests.simulators.dji import RC, Psdk
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from tests.simulators.rosbridge import Answer, Message, Service
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, record_states, wait
from tests.waiting import LIMIT_S, until
from ual.errors import LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Pose
from ual.types import State

T = TypeVar("T")

KINDS = (LockstepPsdk, LockstepOsdk, LockstepOsdkVehicle)


class LogsOn:
    """Another node, which logs five times a second: rosbridge itself does."""

    topics: Mapping[str, str] = {}  # /rosout is there always
    subscriptions: Mapping[str, tuple[str, Callable[[Message], None]]] = {}
    services: Mapping[str, Service] = {}

    def __init__(self, ros: int) -> None:
        self._ros = ros
        self._due_s = 0.0

    def step(self, now_s: float) -> Iterator[tuple[str, Message]]:
        if now_s >= self._due_s:
            self._due_s = now_s + 0.2
            stamp = {"sec": int(now_s), "nanosec": 0}
            stamped: Message = {"stamp": stamp} if self._ros == 2 else {"header": {"stamp": stamp}}
            yield "/rosout", {**stamped, "level": 20 if self._ros == 2 else 2, "name": "rosbridge", "msg": "[Client 1]"}


def silence(backend: LockstepDji, *, is_silent: bool = True) -> None:
    """Lets the wrapper stall, or go on."""
    with backend.lock:
        for topic in backend.bridge.nodes[0].topics:
            (set.add if is_silent else set.discard)(backend.bridge.faults.silent_topics, topic)


class LockstepSlow(LockstepPsdk):
    """It publishes its state once a second, as the wrapper does by default."""

    front = partial(Psdk, state_rate_hz=1.0)


def test_the_log_of_another_node_hides_no_silence() -> None:
    with ready(LockstepSlow) as (uav, backend):
        fly(uav)
        backend.bridge.nodes.append(LogsOn(backend.ros))
        for n, east in enumerate((30.0, -30.0, 30.0, -30.0)):
            uav.go_to_waypoint(Pose.at(east, 0.0, 5.0), blocking=False)
            wait(backend, 2.0 + 0.13 * n)
            silence(backend)
            wait(backend, 0.1)
            with backend.lock:
                backend.aircraft.pilot_takes_over()
            wait(backend, 1.2)
            silence(backend, is_silent=False)
            back_s = backend.aircraft.now_s
            until(lambda: uav.state() is State.FLYING_MANUAL)
            assert not [time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > back_s]
            uav.recover_from_manual()


@pytest.mark.parametrize("kind", KINDS)
def test_a_node_that_has_died_while_another_logs_is_a_lost_link(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        fly(uav)
        task = uav.go_to_waypoint(Pose.at(30.0, 0.0, 5.0), blocking=False)
        wait(backend, 1.0)
        with backend.lock:
            backend.bridge.nodes[:] = [LogsOn(backend.ros)]
        until(lambda: uav.state() is State.UNINITIALIZED)
        with pytest.raises(LinkLostError):
            task.wait(LIMIT_S)
        with pytest.raises(LinkLostError):
            uav.land()
        assert "nothing heard" in uav.telemetry().state_reason


def in_silence(backend: LockstepDji, after_s: float, command: Callable[[LockstepDji], Future[None]]) -> Future[None]:
    """Lets the wrapper stall, and commands something so long after it, in the thread that steps the aircraft."""
    with backend.lock:
        silence(backend)
        answers = in_its_thread(backend, after_s, lambda: command(backend))
    until(lambda: answers)
    return answers[0]


def in_its_thread(backend: LockstepDji, after_s: float, work: Callable[[], T]) -> list[T]:
    """Works so much later, in the thread that steps the aircraft: it is never late. The list gets the result."""
    results: list[T] = []
    begun_s, pace_wait = backend.bridge.now_s, backend._pace.wait

    def wait_and_work() -> None:
        pace_wait()
        if not results and backend.bridge.now_s >= begun_s + after_s:
            results.append(work())

    backend._pace.wait = wait_and_work  # type: ignore[method-assign]
    return results


def called(backend: LockstepDji) -> list[str]:
    """The services that are called from now on, but those of rosapi, of cameras, and velocities."""
    names: list[str] = []
    call = backend.bridge.call

    def note(name: str, arguments: Message) -> Answer:
        if not name.startswith(("/rosapi", "/psdk_ros2/camera_")) and name != "/joystick_action":
            names.append(name)
        return call(name, arguments)

    backend.bridge.call = note  # type: ignore[method-assign]
    return names


@pytest.mark.parametrize("kind", [LockstepOsdk, LockstepOsdkVehicle])
def test_authority_that_the_pilot_took_back_unseen_is_not_ours(kind: type[LockstepDji]) -> None:
    """These wrappers do not publish it, and P_GPS shows with it, before the first setpoint, and without it."""
    with ready(kind) as (uav, backend):
        fly(uav)
        backend.simulation().pilot_take_over()
        until(lambda: uav.state() is State.FLYING_MANUAL)
        told = record_states(uav, backend)

        def give_and_lose() -> None:
            obtain()
            silence(backend)
            backend.aircraft.pilot_takes_over()
            in_its_thread(backend, 0.5, lambda: silence(backend, is_silent=False))

        obtain = backend.aircraft.obtain
        backend.aircraft.obtain = give_and_lose  # type: ignore[method-assign]
        answer = uav.vehicle.commands.recover_from_manual().begin()
        with pytest.raises(RejectedByAutopilotError, match="accepted to take our references, but has not"):
            answer.result(LIMIT_S)
        assert {state for _, state in told} == {State.FLYING_MANUAL}


@pytest.mark.parametrize("kind", KINDS)
def test_the_authority_is_abandoned_in_a_silence_too(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        fly(uav)
        in_silence(backend, 0.7, lambda backend: backend.hold()).result(LIMIT_S)
        assert backend.aircraft.device == RC


@pytest.mark.parametrize("kind", KINDS)
def test_what_follows_an_answer_from_before_a_silence_is_not_called(kind: type[LockstepDji]) -> None:
    with ready(kind) as (_, backend):
        names = called(backend)
        telemetry = backend._session.telemetry
        assert telemetry is not None
        obtain = f"/{telemetry.wrapper.obtain[0].service}"
        backend.bridge.faults.slow_services[obtain] = 0.9
        answer = in_silence(backend, 0.1, lambda backend: backend.arm())
        with pytest.raises(UalTimeoutError, match="was not sent: nothing was heard"):
            answer.result(LIMIT_S)
        wait(backend, 0.2)
        assert len(names) == 2  # obtained, and given up again
        assert backend.aircraft.device == RC
        assert not backend.aircraft.has_motors


def test_a_call_into_a_beginning_silence_may_still_be_executed() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.bridge.faults.dead_services.add("/psdk_ros2/obtain_ctrl_authority")
        answer = in_silence(backend, 0.1, lambda backend: backend.take_control())
        wait(backend, 0.7)
        answer.cancel()
        wait(backend, 0.1)
        text = "obtain_ctrl_authority was not answered: it may still be executed"
        assert text in backend.snapshot().condition.status_text


def test_a_call_that_is_never_answered_may_still_be_executed() -> None:
    with ready() as (_, backend):
        backend.bridge.faults.dead_services.add("/psdk_ros2/turn_on_motors")
        backend.arm()
        until(lambda: "turn_on_motors was not answered: it may still" in backend.snapshot().condition.status_text)


def test_a_call_whose_effect_showed_first_is_no_open_one() -> None:
    with ready() as (uav, backend):
        backend.bridge.faults.slow_services["/psdk_ros2/turn_on_motors"] = 0.5
        uav.arm()
        wait(backend, 1.0)
        assert backend.snapshot().condition.status_text == ""


def test_a_confirmation_that_waits_is_withdrawn_when_the_pilot_takes_over() -> None:
    with ready(LockstepPsdk, 5.0) as (uav, backend):
        fly(uav)
        uav.land(blocking=False)
        until(lambda: backend.aircraft.height_m < 1.5)
        backend.is_socket_full = True
        until(lambda: backend._session.runner.is_any_pending)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
        until(lambda: uav.state() is State.FLYING_MANUAL)
        wait(backend, 0.1)
        backend.is_socket_full = False
        wait(backend, 0.5)
        assert backend.aircraft.confirmations_count == 0
