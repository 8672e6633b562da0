"""The client against a real daemon."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.ual import fake_daemon
from tests.waiting import until
from ual import TaskStatus, _calls, _target, errors
from ual._target import CHANNEL_OPTIONS
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.types import (
    FollowPathRequest,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    State,
    Telemetry,
)
from ual.v1 import ual_pb2 as pb


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS"):
        monkeypatch.delenv(name, raising=False)
    # A shell lets what it starts in the background ignore SIGINT.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def wait_until(uav: ual.Uav, condition: Callable[[Telemetry], bool]) -> Telemetry:
    """The first sample that fulfils a condition."""
    found: list[Telemetry] = []
    there = threading.Event()

    def poll_once(telemetry: Telemetry) -> None:
        if not there.is_set() and condition(telemetry):
            found.append(telemetry)
            there.set()

    with uav.subscribe(poll_once):
        assert there.wait(LIMIT_S)
    return found[0]


def take_off(uav: ual.Uav, height_m: float = 3.0) -> None:
    wait_until(uav, lambda sample: sample.state is State.LANDED_ARMED)
    uav.take_off(height_m)


def test_a_speed_of_zero_is_not_taken_for_none() -> None:
    calls: list[Callable[[], object]] = [
        lambda: _calls.begin_task(GoToWaypointRequest(PoseStamped(Pose()), 0.0)),
        lambda: _calls.begin_task(GoToWaypointGeoRequest(GeoWaypoint(0.0, 0.0, 3.0), 0.0)),
        lambda: _calls.begin_task(FollowPathRequest([PoseStamped(Pose())], 0.0, 0.0)),
    ]
    for call in calls:
        with pytest.raises(errors.InvalidArgumentError) as refused:
            call()
        assert refused.value.metadata["field"] == "max_speed_m_s"


def test_a_dry_run_is_a_question_only(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as uav:
        take_off(uav)
        task = uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), blocking=False)
        assert uav.dry_run.go_to_waypoint(Pose.at(0.0, 0.0, 3.0), max_speed_m_s=0.1).duration_s is not None
        assert uav.dry_run.set_velocity(Twist(Vector3(1.0))) == ual.Plan()
        assert not task.done()
        with pytest.raises(errors.InvalidArgumentError, match="leg_speeds_m_s"):
            uav.dry_run.follow_path([Pose()], leg_speeds_m_s=[1.0, 1.0])
        with pytest.raises(errors.InvalidArgumentError, match="point_of_interest"):
            uav.dry_run.follow_path([Pose()], point_of_interest=Vector3())
        task.cancel()


def test_a_daemon_that_knows_no_dry_runs_is_not_taken_for_one_that_moved_nothing() -> None:
    with (
        fake_daemon.running() as daemon,
        ual.Uav("uav_1", address=daemon.address) as uav,
        pytest.raises(errors.NotSupportedError, match="too old for dry runs"),
    ):
        uav.dry_run.set_velocity(Twist(Vector3(1.0)))  # answered without a plan


# --- Finding a daemon -------------------------------------------------------------------------------------------------


def test_it_finds_a_daemon_by_its_namespace(start_daemon: StartDaemon) -> None:
    for ns in ("uav_1", "uav_2"):
        start_daemon(ns=ns).wait_for("listening")
    with ual.Uav("uav_2") as second, ual.Uav("uav_1") as first:
        assert (first.ns, second.ns) == ("uav_1", "uav_2")
        assert second.info().namespace == "uav_2"


def test_alone_it_needs_no_name(daemon: DaemonProcess) -> None:
    with ual.Uav() as uav:
        assert uav.state() in (State.LANDED_DISARMED, State.LANDED_ARMED)
        assert uav.ns == daemon.ns


def test_by_address_it_asks_for_the_namespace(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as uav:
        assert uav.ns == "uav_1"


def test_the_daemon_of_another_uav_is_refused(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_2", address=daemon.address) as uav, pytest.raises(errors.InvalidArgumentError) as caught:
        uav.state()
    assert "this daemon flies uav_1, not uav_2" in caught.value.message


def test_without_a_daemon_the_first_call_says_what_to_do() -> None:
    with ual.Uav("uav_3") as uav, pytest.raises(errors.DaemonUnreachableError) as caught:
        uav.state()
    for part in ("uav_3", "127.0.0.1:50053", "ual-daemon --ns uav_3"):
        assert part in caught.value.message


def test_it_survives_a_daemon_that_is_restarted_elsewhere(start_daemon: StartDaemon) -> None:
    first = start_daemon()
    first.wait_for("listening")
    samples: list[Telemetry] = []
    received = threading.Condition()

    def take(telemetry: Telemetry) -> None:
        with received:
            samples.append(telemetry)
            received.notify_all()

    with ual.Uav("uav_1") as uav, uav.subscribe(take):
        assert uav.is_ready()
        old_address = uav.address
        first.process.kill()
        first.wait()
        with pytest.raises(errors.DaemonUnreachableError):
            uav.state()
        second = start_daemon()
        second.wait_for("listening")
        assert uav.info().namespace == "uav_1"
        assert uav.address == second.address != old_address
        with received:
            samples.clear()
            assert received.wait_for(lambda: samples, LIMIT_S), "the subscription did not come back"


def test_it_survives_a_daemon_that_is_restarted_in_position(start_daemon: StartDaemon) -> None:
    first = start_daemon()
    address = first.address
    with ual.Uav("uav_1", address=address) as uav:
        assert uav.is_ready()
        first.process.kill()
        first.wait()
        start_daemon(listen=address).wait_for("listening")
        assert uav.info().namespace == "uav_1"


def test_where_the_daemon_moved_the_calls_that_run_go_on_until_they_end(monkeypatch: pytest.MonkeyPatch) -> None:
    is_called, may_answer = threading.Event(), threading.Event()
    failures: list[BaseException] = []
    setpoints: queue.Queue[pb.StreamSetpointsRequest | None] = queue.Queue()

    def set_home() -> None:
        is_called.set()
        assert may_answer.wait(LIMIT_S)

    def call() -> None:
        try:
            uav.set_home()
        except errors.UalError as error:
            failures.append(error)

    with (
        fake_daemon.running() as first,
        fake_daemon.running() as second,
        ual.Uav("uav_1", address=first.address) as uav,
    ):
        first.set_home = set_home
        calling = threading.Thread(target=call)
        calling.start()
        stream = uav._connection.stream("StreamSetpoints", iter(setpoints.get, None))
        assert is_called.wait(LIMIT_S)
        monkeypatch.setattr(uav._connection.target, "_fixed_address", second.address)
        for _ in range(2):
            uav.set_home()
        may_answer.set()
        calling.join(LIMIT_S)
        assert failures == []
        setpoints.put(_calls.setpoint(TwistStamped(Twist()), "velocity"))
        first.wait_for_streamed(1)
        setpoints.put(None)
        stream.result(LIMIT_S)
        # gRPC may not have told yet that it ended.
        until(lambda: uav._connection._retired == [], "the end of the old channel", between=uav.set_home)


def test_a_call_that_waits_for_the_daemon_finds_it_at_another_address(monkeypatch: pytest.MonkeyPatch) -> None:
    with fake_daemon.running() as daemon, ual.Uav("uav_1", address=daemon.address) as uav:
        uav.set_home()
        addresses = iter(["127.0.0.1:1"] * 3)  # of the call and of the waiting
        monkeypatch.setattr(uav._connection.target, "address", lambda: next(addresses, daemon.address))
        uav.set_home()


def test_a_call_that_a_closed_client_ends_says_so(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        flying, failures = ual.Uav("uav_1"), []

        def go() -> None:
            try:
                flying.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0))
            except errors.UalError as error:
                failures.append(error.message)

        going = threading.Thread(target=go)
        going.start()
        wait_until(uav, lambda sample: sample.task is not None)
        flying.close()
        going.join(LIMIT_S)
        assert failures == ["this client is closed"]
    daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_a_stuck_daemon_ends_in_a_timeout_not_in_a_hang(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        assert uav.is_ready()
        with daemon.frozen(), pytest.raises(errors.UalTimeoutError, match=r"Arm did not end within 0\.2 s"):
            uav.arm(timeout_s=0.2)
        assert uav.is_ready()


# --- Tasks ------------------------------------------------------------------------------------------------------------


def test_a_whole_flight(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        task = uav.go_to_waypoint(Pose.at(4.0, 2.0, 3.0, 1.57))
        assert task.done()
        assert task.wait().status is TaskStatus.SUCCEEDED
        assert (uav.pose().pose.position - Vector3(4.0, 2.0, 3.0)).norm() < 0.3
        assert uav.land().info().status is TaskStatus.SUCCEEDED
        assert uav.state() in (State.LANDED_ARMED, State.LANDED_DISARMED)
    assert daemon.process.poll() is None


def test_when_the_time_is_over_the_task_is_cancelled(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        take_off(uav)

        def go_to(limit_s: float) -> None:
            with pytest.raises(errors.UalTimeoutError, match="if it reached the UAV it is cancelled and the UAV holds"):
                uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), timeout_s=limit_s)

        daemon.give_up_begun("go_to_waypoint", go_to)
        wait_until(uav, lambda sample: sample.task is None)
        daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_a_client_that_waits_for_long_may_poll_after_its_daemon(
    daemon: DaemonProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    del daemon
    # Often enough that a daemon which takes it for abuse would say so within these seconds.
    often = (("grpc.keepalive_time_ms", 1100), *(each for each in CHANNEL_OPTIONS if "keepalive_time" not in each[0]))
    monkeypatch.setattr(_target, "CHANNEL_OPTIONS", often)
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        with pytest.raises(errors.UalTimeoutError):
            uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), timeout_s=7.0)


def test_a_task_can_be_waited_for_no_longer_than_wanted(daemon: DaemonProcess) -> None:
    del daemon
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        task = uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), blocking=False)
        with pytest.raises(errors.UalTimeoutError, match=r"has not ended after 0\.1 s; it goes on"):
            task.wait(timeout_s=0.1)
        assert not task.done()
        other = uav.task(task.id)
        other.cancel()
        with pytest.raises(errors.TaskAbortedError):
            task.wait()
        assert "ABORTED" in repr(task)


def test_a_command_that_got_no_answer_is_not_reported_to_go_on(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        assert uav.is_ready()
        words = "if it reached the UAV it goes on: ask for the state"
        with daemon.frozen(), pytest.raises(errors.UalTimeoutError, match=words):
            uav.land(timeout_s=0.2)


@pytest.mark.parametrize("timeout_s", [-1.0, float("nan"), "3"])
def test_times_that_nobody_can_wait_are_refused(daemon: DaemonProcess, timeout_s: float) -> None:
    del daemon
    with ual.Uav("uav_1") as uav:
        with pytest.raises(errors.InvalidArgumentError, match="timeout_s"):
            uav.land(timeout_s=timeout_s)
        take_off(uav)
        task = uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0), blocking=False)
        with pytest.raises(errors.InvalidArgumentError, match="timeout_s"):
            task.wait(timeout_s=timeout_s)


@pytest.mark.parametrize("timeout_s", [float("inf"), 1e10, pytest.param(10**400, id="huge")])
def test_times_longer_than_anybody_waits_are_no_limit(daemon: DaemonProcess, timeout_s: float) -> None:
    del daemon
    with ual.Uav("uav_1") as uav:
        wait_until(uav, lambda sample: sample.state is State.LANDED_ARMED)
        uav.take_off(3.0, timeout_s=timeout_s)
        task = uav.go_to_waypoint(Pose.at(2.0, 0.0, 3.0), blocking=False)
        assert task.wait(timeout_s=timeout_s).status is TaskStatus.SUCCEEDED


@pytest.mark.parametrize("ending", ["interrupt", "close"])
def test_a_waiting_call_ends_with_its_program(daemon: DaemonProcess, ending: str) -> None:
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        is_flying = threading.Event()

        def end() -> None:
            is_flying.wait(LIMIT_S)
            if ending == "interrupt":
                os.kill(os.getpid(), signal.SIGINT)
            else:
                flying.close()

        def poll_once(sample: Telemetry) -> None:
            if sample.task is not None:
                is_flying.set()

        with ual.Uav("uav_1") as flying, uav.subscribe(poll_once):
            ender = threading.Thread(target=end)
            ender.start()
            expected = KeyboardInterrupt if ending == "interrupt" else errors.UalError
            with pytest.raises(expected):
                flying.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0))
            ender.join()
        daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_an_interrupt_while_a_call_begins_ends_it(daemon: DaemonProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C came when gRPC had sent the call, and before anybody could cancel it: the UAV flew on to its goal."""
    method_of, kept = _target.Stubs.method, []

    class Interrupted:
        def __init__(self, method: Any) -> None:
            self._method = method

        def future(self, *arguments: object, **options: object) -> object:
            kept.append(self._method.future(*arguments, **options))  # amid gRPC's steps nobody would free it either
            daemon.wait_for("command", command="go_to_waypoint")
            signal.raise_signal(signal.SIGINT)
            return kept[-1]

    with ual.Uav("uav_1") as uav:
        take_off(uav)
        monkeypatch.setattr(_target.Stubs, "method", lambda stubs, call: Interrupted(method_of(stubs, call)))
        with pytest.raises(KeyboardInterrupt):
            uav.go_to_waypoint(Pose.at(1000.0, 0.0, 3.0))
    daemon.wait_for("task_ended", task="go_to_waypoint", reason="TASK_ABORTED")


def test_the_traceback_of_a_refusal_names_the_program_and_the_reason_and_nothing_of_grpc(daemon: DaemonProcess) -> None:
    del daemon
    with ual.Uav("uav_1") as uav, ual.Uav("uav_3") as nobody:
        for refused, reason in ((uav.land, "needs the state FLYING_AUTO"), (nobody.land, "no UAL daemon of uav_3")):
            with pytest.raises(errors.UalError) as caught:
                refused()
            shown = "".join(traceback.format_exception(caught.value))
            assert reason in shown
            assert "grpc." not in shown


# --- Setpoints --------------------------------------------------------------------------------------------------------


def test_a_velocity_on_the_ground_is_refused_at_once(daemon: DaemonProcess) -> None:
    del daemon
    with ual.Uav("uav_1") as uav, pytest.raises(errors.WrongStateError, match="FLYING_AUTO"):
        uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))


def test_when_the_pilot_takes_over_a_streamed_velocity_raises(daemon: DaemonProcess) -> None:
    del daemon
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
        uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
        uav.simulation.pilot_take_over()
        with pytest.raises(errors.WrongStateError) as caught:
            keep_flying(uav)
        assert caught.value.state == "FLYING_MANUAL"


def keep_flying(uav: ual.Uav) -> None:
    pause = threading.Event()
    for _ in range(1000):
        uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
        pause.wait(0.02)


def test_setpoints_do_not_pile_up_before_a_daemon_that_does_not_read(daemon: DaemonProcess) -> None:
    with ual.Uav("uav_1") as uav:
        take_off(uav)
        waiting = [
            _calls.setpoint(TwistStamped(Twist(Vector3(0.01 * number, 0.0, 0.0))), "velocity") for number in range(200)
        ]
        sent: list[float] = []

        def setpoints() -> Iterator[pb.StreamSetpointsRequest]:
            for setpoint in waiting:
                sent.append(setpoint.velocity.twist.linear.x)
                yield setpoint

        with daemon.frozen():
            stream = uav._connection.stream("StreamSetpoints", setpoints())
            time.sleep(1.0)  # nothing tells that no more can be sent
            assert len(sent) < 50
        assert stream.result(LIMIT_S).accepted_count == 200


FLIES_UNTIL_KILLED = """
import sys, time, ual
uav = ual.Uav("uav_1")
print("flying", flush=True)
while True:
    uav.set_velocity(ual.Twist(ual.Vector3(1.0, 0.0, 0.0)))
    time.sleep(0.02)
"""


def test_the_uav_holds_when_its_client_is_killed(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--auto-arm")
    daemon.wait_for("listening")
    with ual.Uav("uav_1") as uav:
        take_off(uav, 1.0)
        with subprocess.Popen([sys.executable, "-c", FLIES_UNTIL_KILLED], stdout=subprocess.PIPE) as client:
            wait_until(uav, lambda sample: sample.velocity is not None and sample.velocity.linear.x > 0.9)
            client.kill()
            client.wait()
        killed = uav.pose().pose.position
        stopped = wait_until(uav, lambda each: each.velocity is not None and each.velocity.linear.x < 0.01)
        # The way, which a busy machine sees as long as any other: the watchdog's time and braking from 1 m/s, with a
        # margin for the light UAV's lag.
        braking_m = 0.5 / uav.info().limits.horizontal_acceleration_m_s2
        assert stopped.pose is not None
        assert (stopped.pose.position - killed).norm() <= 0.5 + braking_m + 0.5
        assert stopped.state is State.FLYING_AUTO


# --- What is left behind ----------------------------------------------------------------------------------------------


def test_a_closed_client_leaves_nothing(daemon: DaemonProcess) -> None:
    del daemon
    use_everything()  # what gRPC keeps for good is there from now on
    threads, sockets = threading.active_count(), count_sockets()
    for _ in range(3):
        use_everything()
    until(lambda: threading.active_count() <= threads, seen=threading.enumerate)
    until(lambda: count_sockets() <= sockets, seen=count_sockets)


def use_everything() -> None:
    with ual.Uav("uav_1") as uav:
        wait_until(uav, lambda sample: sample.state in (State.LANDED_ARMED, State.FLYING_AUTO))
        if uav.state() is State.LANDED_ARMED:
            uav.take_off(2.0)
        uav.subscribe(lambda _: None)
        for _ in range(3):
            uav.set_velocity(Twist())
        task = uav.go_to_waypoint(Pose.at(100.0, 0.0, 2.0), blocking=False)
        next(iter(task.watch()))
        task.cancel()
        uav.simulation.faults()


def count_sockets() -> int:
    links = []
    for entry in Path("/proc/self/fd").iterdir():
        try:
            links.append(entry.readlink().name)
        except OSError:
            continue
    return sum(link.startswith("socket:") for link in links)


def test_members_can_be_called_from_many_threads(daemon: DaemonProcess) -> None:
    del daemon
    failures: list[BaseException] = []

    def work(uav: ual.Uav) -> None:
        try:
            for _ in range(20):
                uav.telemetry()
                uav.transform()
                with uav.subscribe(lambda _: None):
                    pass
                try:
                    uav.set_velocity(Twist())
                except errors.WrongStateError:
                    uav.frames()
        except BaseException as error:  # noqa: BLE001  whatever it is, the test tells it
            failures.append(error)

    with ual.Uav("uav_1") as uav:
        workers = [threading.Thread(target=work, args=(uav,)) for _ in range(12)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join(LIMIT_S * 2)
    assert failures == []


def test_it_waits_for_a_state(daemon: DaemonProcess) -> None:
    del daemon
    with ual.Uav("uav_1") as uav:
        assert uav.wait_for(State.LANDED_ARMED, State.FLYING_AUTO, timeout_s=LIMIT_S) is State.LANDED_ARMED
        uav.take_off(3.0, blocking=False)
        assert uav.wait_for(State.FLYING_AUTO, timeout_s=LIMIT_S) is State.FLYING_AUTO
        with pytest.raises(errors.UalTimeoutError, match=r"not LANDING after 0\.01 s, but FLYING_AUTO"):
            uav.wait_for(State.LANDING, timeout_s=0.01)
        wrongs: list[Any] = [(), ("FLYING_AUTO",), (State.LANDING, 5)]
        for wrong in wrongs:
            with pytest.raises(errors.InvalidArgumentError, match="LANDED_ARMED"):
                uav.wait_for(*wrong)
