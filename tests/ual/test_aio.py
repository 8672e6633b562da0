"""The asyncio client against a real daemon, and its setpoints against a scripted one."""

from __future__ import annotations

import asyncio
import gc
import inspect
import logging
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar

import grpc
import grpc.aio
import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual import fake_daemon
from ual import TaskStatus, aio, errors, interface
from ual.geometry import Pose, Twist, Vector3
from ual.types import Plan, State, Telemetry

T = TypeVar("T")


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS"):
        monkeypatch.delenv(name, raising=False)


def run(program: Callable[[aio.Uav], Awaitable[T]], **where: Any) -> T:
    """Runs a program with a UAV, in a loop that has nothing left to do when it ends."""

    async def main() -> T:
        async with aio.Uav(**where) as uav:
            result = await asyncio.wait_for(program(uav), LIMIT_S)
        left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        if left:  # gRPC's own, which end by themselves
            _, unfinished = await asyncio.wait(left, timeout=LIMIT_S)
            assert not unfinished
        return result

    return asyncio.run(main())


async def wait_until(uav: aio.Uav, condition: Callable[[Telemetry], bool]) -> Telemetry:
    async with uav.subscribe() as samples:
        async for sample in samples:
            if condition(sample):
                return sample
    raise AssertionError("the samples ended")


async def take_off(uav: aio.Uav) -> None:
    await wait_until(uav, lambda sample: sample.state is State.LANDED_ARMED)
    await uav.take_off(3.0)


def test_it_has_the_members_of_the_interface() -> None:
    for protocol, kind in (
        (interface.Uav, aio.Uav),
        (interface.Simulation, aio.Simulation),
        (interface.Task, aio.Task),
    ):
        for name, member in inspect.getmembers(protocol, inspect.isfunction):
            if name.startswith("_") or (protocol is interface.Uav and name in ("subscribe", "lease", "extension")):
                continue
            ours = getattr(kind, name)
            is_command = hasattr(interface.TaskCommands, name)  # the same function for both, of what `_begin` returns
            is_coroutine = inspect.iscoroutinefunction(aio.Uav._begin if is_command else ours)
            assert is_coroutine or inspect.isasyncgenfunction(ours), name
            assert list(inspect.signature(ours).parameters) == list(inspect.signature(member).parameters), name


def test_its_commands_and_dry_runs_are_coroutines() -> None:
    async def ask() -> None:
        uav = aio.Uav(address="127.0.0.1:1")
        for called in (uav.take_off(3.0), uav.land(), uav.dry_run.take_off(3.0), uav.dry_run.recover_from_manual()):
            assert inspect.iscoroutine(called)
            called.close()
        await uav.close()

    asyncio.run(ask())


def test_a_whole_flight(daemon: DaemonProcess) -> None:
    async def fly(uav: aio.Uav) -> None:
        assert uav.ns == "uav_1"
        assert (await uav.info()).backend == "light"
        await take_off(uav)
        task = await uav.go_to_waypoint(Pose.at(4.0, 2.0, 3.0, 1.57), blocking=False)
        seen = [info async for info in task.watch()]
        assert seen[-1].status is TaskStatus.SUCCEEDED
        assert await task.done()
        assert (await task.wait()).id == task.id
        assert ((await uav.pose()).pose.position - Vector3(4.0, 2.0, 3.0)).norm() < 0.3
        assert await uav.is_ready()
        assert await uav.wait_for(State.LANDING, State.FLYING_AUTO, timeout_s=LIMIT_S) is State.FLYING_AUTO
        with pytest.raises(errors.UalTimeoutError, match="not LANDING"):
            await uav.wait_for(State.LANDING, timeout_s=0.01)
        assert await uav.is_idle()
        assert await uav.reference_pose() is not None
        assert (await uav.transform()).child_frame_id == "uav_1/base_link"
        await uav.land()
        assert await uav.state() in (State.LANDED_ARMED, State.LANDED_DISARMED)

    run(fly, ns="uav_1")
    assert daemon.process.poll() is None


def test_a_return_home_with_a_pause(daemon: DaemonProcess) -> None:
    async def fly(uav: aio.Uav) -> None:
        await take_off(uav)
        await uav.go_to_waypoint(Pose.at(4.0, 2.0, 3.0))
        assert (await uav.dry_run.return_to_launch(4.0)).length_m == pytest.approx(1.0 + 20**0.5, abs=0.3)
        await uav.simulation.set_speed_factor(0.1)  # the return lasts
        task = await uav.return_to_launch(4.0, blocking=False)
        await uav.pause()
        assert (await task.info()).is_paused
        await task.resume()
        with pytest.raises(errors.WrongStateError, match="is not paused"):
            await uav.resume()
        await task.pause()
        await uav.resume()
        await uav.simulation.set_speed_factor(10.0)
        assert (await task.wait()).status is TaskStatus.SUCCEEDED
        await uav.take_off(3.0)  # waits for the automatic arming
        assert await uav.state() is State.FLYING_AUTO

    run(fly, ns="uav_1")
    assert daemon.process.poll() is None


def test_a_dry_run_moves_nothing(daemon: DaemonProcess) -> None:
    async def fly(uav: aio.Uav) -> None:
        await wait_until(uav, lambda sample: sample.state is State.LANDED_ARMED)
        assert (await uav.dry_run.take_off(3.0)).length_m == pytest.approx(3.0)
        assert await uav.state() is State.LANDED_ARMED
        await uav.take_off(3.0)
        dry = uav.dry_run
        assert (await dry.go_to_waypoint(Pose.at(3.0, 4.0, 3.0))).length_m == pytest.approx(5.0, abs=0.3)
        slow = await dry.follow_path([Pose.at(3.0, 4.0, 3.0)], max_speed_m_s=0.1)
        assert slow.duration_s is not None
        assert slow.duration_s > 40.0
        assert await dry.set_velocity(Twist(Vector3(1.0))) == Plan()
        assert await dry.set_pose(Pose.at(1.0, 1.0, 3.0)) == await dry.land() == Plan()
        with pytest.raises(errors.WrongStateError):
            await dry.recover_from_manual()
        with pytest.raises(errors.InvalidArgumentError):
            await dry.go_to_waypoint_geo(91.0, 0.0, 3.0)
        sample = await uav.telemetry()
        assert sample.state is State.FLYING_AUTO
        assert sample.task is None

    run(fly, address=daemon.address)


def test_refusals_are_the_same_errors(daemon: DaemonProcess) -> None:
    async def fly(uav: aio.Uav) -> None:
        with pytest.raises(errors.WrongStateError):
            await uav.land()
        with pytest.raises(errors.InvalidArgumentError):
            await uav.take_off(-1.0)
        with pytest.raises(errors.UnknownFrameError):
            await uav.transform("nowhere")
        with pytest.raises(errors.InvalidArgumentError, match="rate_hz"):
            async for _ in uav.subscribe(rate_hz=-1.0):
                pass

    run(fly, address=daemon.address)


def test_a_cancelled_coroutine_cancels_its_task(daemon: DaemonProcess) -> None:
    async def fly(uav: aio.Uav) -> None:
        await take_off(uav)
        flying = asyncio.create_task(uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0)))
        await wait_until(uav, lambda sample: sample.task is not None)
        flying.cancel()
        await asyncio.wait((flying,))
        assert flying.cancelled()
        await wait_until(uav, lambda sample: sample.task is None)

    run(fly, ns="uav_1")
    daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_a_task_can_be_waited_for_no_longer_than_wanted(daemon: DaemonProcess) -> None:
    del daemon

    async def fly(uav: aio.Uav) -> None:
        await take_off(uav)
        task = await uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), blocking=False)
        with pytest.raises(errors.UalTimeoutError, match="it goes on"):
            await task.wait(timeout_s=0.1)
        await (await uav.task(task.id)).cancel()
        with pytest.raises(errors.TaskAbortedError):
            await task.wait()
        await task.cancel()

    run(fly, ns="uav_1")


def test_times_to_wait_for_a_task_are_checked(daemon: DaemonProcess) -> None:
    del daemon

    async def fly(uav: aio.Uav) -> None:
        await take_off(uav)
        task = await uav.go_to_waypoint(Pose.at(2.0, 0.0, 3.0), blocking=False)
        for timeout_s in (-1.0, float("nan")):
            with pytest.raises(errors.InvalidArgumentError, match="timeout_s"):
                await task.wait(timeout_s=timeout_s)
        assert (await task.wait(timeout_s=float("inf"))).status is TaskStatus.SUCCEEDED

    run(fly, ns="uav_1")


def test_setpoints_fly_and_the_pilot_ends_them(daemon: DaemonProcess) -> None:
    del daemon

    async def fly(uav: aio.Uav) -> None:
        await take_off(uav)
        async for sample in uav.subscribe(rate_hz=50.0):
            await uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
            if sample.velocity is not None and sample.velocity.linear.x > 0.4:
                break
        await uav.simulation.pilot_take_over()
        with pytest.raises(errors.WrongStateError) as caught:
            await keep_flying(uav)
        assert caught.value.state == "FLYING_MANUAL"
        await uav.recover_from_manual()

    run(fly, ns="uav_1")


async def keep_flying(uav: aio.Uav) -> None:
    for _ in range(1000):
        await uav.set_velocity(Twist())
        await asyncio.sleep(0.02)  # at a pilot's rate


def test_without_a_daemon_it_says_what_to_do() -> None:
    async def fly(uav: aio.Uav) -> None:
        with pytest.raises(errors.DaemonUnreachableError, match="ual-daemon --ns uav_3"):
            await uav.state()
        with pytest.raises(errors.DaemonUnreachableError):
            async for _ in uav.subscribe():
                pass

    run(fly, ns="uav_3")


def test_it_survives_a_daemon_that_is_restarted_elsewhere(start_daemon: StartDaemon) -> None:
    first = start_daemon()
    first.wait_for("listening")

    async def fly(uav: aio.Uav) -> None:
        samples = uav.subscribe()
        await samples.__anext__()
        await uav.telemetry()
        first.process.kill()
        await asyncio.to_thread(first.wait)
        with pytest.raises(errors.DaemonUnreachableError):
            await uav.state()
        second = start_daemon()
        await asyncio.to_thread(second.wait_for, "listening")
        assert (await uav.info()).namespace == "uav_1"
        assert uav.address == second.address
        newest = await samples.__anext__()
        while newest.sequence > (await uav.telemetry()).sequence:  # one of the first daemon's was left
            newest = await samples.__anext__()

    run(fly, ns="uav_1")


def test_it_survives_a_daemon_that_is_restarted_in_position(start_daemon: StartDaemon) -> None:
    first = start_daemon()
    address = first.address

    async def fly(uav: aio.Uav) -> None:
        await uav.telemetry()
        first.process.kill()
        await asyncio.to_thread(first.wait)
        again = start_daemon(listen=address)
        await asyncio.to_thread(again.wait_for, "listening")
        assert (await uav.info()).namespace == "uav_1"

    run(fly, address=address)


def test_a_closed_client_refuses(daemon: DaemonProcess) -> None:
    async def main() -> None:
        uav = aio.Uav(address=daemon.address)
        samples = uav.subscribe()
        await samples.__anext__()
        await uav.close()
        with pytest.raises(errors.UalError, match="closed"):
            await uav.state()
        with pytest.raises(StopAsyncIteration):
            await samples.__anext__()

    asyncio.run(main())
    gc.collect()


def test_closing_the_client_ends_a_running_call_with_an_error_not_as_cancelled(daemon: DaemonProcess) -> None:
    async def main() -> None:
        async with aio.Uav(address=daemon.address) as uav, aio.Uav(address=daemon.address) as flying:
            await take_off(uav)
            going = asyncio.create_task(flying.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0)))
            await wait_until(uav, lambda sample: sample.task is not None)
            await flying.close()
            with pytest.raises(errors.UalError, match="this client is closed"):
                await going

    asyncio.run(main())
    daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_a_subscription_that_begins_while_the_client_is_closed_ends(daemon: DaemonProcess) -> None:
    async def main() -> None:
        uav = aio.Uav(address=daemon.address)
        first, second = uav.subscribe(), uav.subscribe()
        await first.__anext__()
        await second.__anext__()
        uav._subscriptions.remove(second)  # as one that another task opened since
        await uav.close()
        with pytest.raises(errors.UalError, match="this client is closed"):
            await asyncio.wait_for(read(second), LIMIT_S)

    async def read(samples: aio.Subscription) -> None:
        async for _ in samples:
            pass

    asyncio.run(main())


def test_whatever_ends_the_reading_of_a_subscription_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object, __: float) -> None:
        raise ZeroDivisionError("a defect")

    async def fly(uav: aio.Uav) -> None:
        with pytest.raises(ZeroDivisionError, match="a defect"):
            await uav.subscribe().__anext__()

    monkeypatch.setattr("ual.aio._connection.Connection.stream_telemetry", fail)
    run(fly, address="127.0.0.1:1")


def test_where_the_daemon_moved_the_calls_that_run_go_on_until_they_end(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fly(uav: aio.Uav) -> None:
        async with uav.subscribe() as samples:
            assert (await samples.__anext__()).sequence == 1
            monkeypatch.setattr(uav._connection.target, "_fixed_address", second.address)
            await uav.set_velocity(Twist())
            source.put(fake_daemon.sample(2))
            assert (await samples.__anext__()).sequence == 2
        assert len(second.answered) == 1
        assert uav._connection._retired == [], "the old channel is closed"

    with fake_daemon.running() as first, fake_daemon.running() as second:
        source = first.script()
        source.put(fake_daemon.sample(1))
        run(fly, address=first.address)


def test_a_call_that_waits_for_the_daemon_finds_it_at_another_address(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fly(uav: aio.Uav) -> None:
        await uav.set_velocity(Twist())
        addresses = iter(["127.0.0.1:1", "127.0.0.1:1"])  # of the call and of the waiting
        monkeypatch.setattr(uav._connection.target, "address", lambda: next(addresses, daemon.address))
        await uav.set_home()

    with fake_daemon.running() as daemon:
        run(fly, address=daemon.address)


# --- Setpoints, scripted ----------------------------------------------------------------------------------------------


def test_the_first_setpoint_is_answered_and_those_that_follow_are_streamed() -> None:
    async def fly(uav: aio.Uav) -> None:
        for number in range(1, 4):
            await uav.set_velocity(Twist(Vector3(number, 0.0, 0.0)))
            if number > 1:
                await asyncio.to_thread(daemon.wait_for_streamed, number - 1)
        await uav.set_pose(Pose.at(1.0, 2.0, 3.0))

    with fake_daemon.running() as daemon:
        run(fly, address=daemon.address)
        assert len(daemon.answered) == 1
        kinds = [request.WhichOneof("setpoint") for request in daemon.streamed]
        assert kinds == ["velocity", "velocity", "pose"], "closing sends what waits"


def test_a_refused_setpoint_is_raised_by_the_next_call_or_logged(caplog: pytest.LogCaptureFixture) -> None:
    async def fly(uav: aio.Uav) -> None:
        await uav.set_velocity(Twist())
        await uav.set_velocity(Twist())
        await asyncio.to_thread(daemon.wait_for_streamed, 1)
        daemon.refusal = ual.WrongStateError("the pilot flies")
        with pytest.raises(ual.WrongStateError, match="the pilot flies"):
            await keep_flying(uav)
        with pytest.raises(ual.WrongStateError, match="the pilot flies"):
            await uav.set_velocity(Twist())
        daemon.refusal = None
        await uav.set_velocity(Twist())
        await uav.set_velocity(Twist())
        await asyncio.to_thread(daemon.wait_for_streamed, 2)
        daemon.refusal = ual.WrongStateError("the pilot flies again")
        await uav.set_velocity(Twist())

    with fake_daemon.running() as daemon, caplog.at_level(logging.WARNING):
        run(fly, address=daemon.address)
    assert "the last setpoints were refused: WRONG_STATE: the pilot flies again" in caplog.text


def test_a_refusal_that_grpc_has_lost_is_requested_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stream that the daemon ended during a write was told as INTERNAL, whatever had been refused."""

    async def lose_status(*_: object) -> None:
        raise grpc.aio.AioRpcError(
            grpc.StatusCode.INTERNAL, grpc.aio.Metadata(), grpc.aio.Metadata(), "Internal error from Core"
        )

    async def stream_on(uav: aio.Uav) -> None:
        while True:
            await uav.set_velocity(Twist())
            await asyncio.sleep(0.01)  # at a pilot's rate

    async def fly(uav: aio.Uav) -> None:
        await uav.set_velocity(Twist())
        daemon.refusal = ual.WrongStateError("the pilot flies")
        with pytest.raises(ual.WrongStateError, match="the pilot flies"):
            await stream_on(uav)

    monkeypatch.setattr("ual.aio._setpoints._Stream._write_newest", lose_status)
    monkeypatch.setattr("ual.aio._setpoints.STREAM_S", LIMIT_S)
    with fake_daemon.running() as daemon:
        run(fly, address=daemon.address)


def test_a_refusal_that_grpc_has_lost_is_not_reported_as_taken(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def lose_status(*_: object) -> None:
        raise grpc.aio.AioRpcError(
            grpc.StatusCode.INTERNAL, grpc.aio.Metadata(), grpc.aio.Metadata(), "Internal error from Core"
        )

    async def fly(uav: aio.Uav) -> None:
        for _ in range(2):
            await uav.set_velocity(Twist())

    monkeypatch.setattr("ual.aio._setpoints._Stream._write_newest", lose_status)
    monkeypatch.setattr("ual.aio._setpoints.STREAM_S", LIMIT_S)
    with fake_daemon.running() as daemon:
        run(fly, address=daemon.address)
    assert "the last setpoints were refused: DAEMON_UNREACHABLE: the daemon ended the stream" in caplog.text


def test_setpoints_that_the_daemon_does_not_take_are_reported(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fly(uav: aio.Uav) -> None:
        await uav.set_velocity(Twist())
        await uav.set_velocity(Twist())
        await uav.set_home()
        daemon.is_thawed.set()

    monkeypatch.setattr("ual.aio._setpoints.STREAM_S", LIMIT_S)
    monkeypatch.setattr("ual.aio._setpoints.CLOSE_TIMEOUT_S", 0.2)
    with fake_daemon.running() as daemon:
        daemon.is_thawed.clear()
        run(fly, address=daemon.address)
    assert "the daemon did not take the last setpoints" in caplog.text


def test_after_a_command_that_was_cancelled_setpoints_share_a_stream_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fly(uav: aio.Uav) -> None:
        await uav.set_velocity(Twist())
        daemon.is_thawed.clear()
        await uav.set_velocity(Twist())
        await asyncio.to_thread(daemon.wait_for_streams, 1)
        abort = asyncio.create_task(uav.abort())
        await asyncio.sleep(0)  # it waits for the setpoints
        abort.cancel()
        await asyncio.wait((abort,))
        assert abort.cancelled()
        daemon.is_thawed.set()
        for number in range(1, 6):
            await uav.set_velocity(Twist(Vector3(number)))
            await asyncio.to_thread(daemon.wait_for_streamed, number)
        assert daemon.stream_count == 2

    monkeypatch.setattr("ual.aio._setpoints.STREAM_S", LIMIT_S)
    monkeypatch.setattr("ual.aio._setpoints.STALE_SETPOINT_S", LIMIT_S)
    with fake_daemon.running() as daemon:
        run(fly, address=daemon.address)


def test_a_wait_that_is_cancelled_as_its_state_comes_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fly(uav: aio.Uav) -> None:
        loop = asyncio.get_running_loop()
        state: asyncio.Future[State] = loop.create_future()
        has_begun = asyncio.Event()

        async def first_of(_: object) -> State:
            has_begun.set()
            return await state

        monkeypatch.setattr(uav, "_first_of", first_of)
        waiting = asyncio.create_task(uav.wait_for(State.FLYING_AUTO))
        await has_begun.wait()
        state.set_result(State.FLYING_AUTO)
        loop.call_soon(waiting.cancel)  # after the state has come, and before the wait is told
        await asyncio.wait((waiting,))
        assert waiting.cancelled()

    run(fly, address="127.0.0.1:1")
