"""The backend as a whole, over real UDP sockets on loopback."""

import contextlib
import itertools
import logging
import os
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import open_terminal
from tests.ports import free_port
from tests.simulators.codec import AutopilotCodec
from tests.ual_daemon.backends.mavlink.fakes import ack, attitude, heartbeat, packer, position
from tests.ual_daemon.backends.mavlink.traces import load, replay_stepped
from tests.waiting import LIMIT_S, until
from ual.errors import LinkLostError, NotSupportedError
from ual.geometry import Vector3
from ual.types import Limits, State
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.wire.frames import split
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import PositionSetpoint, Snapshot, VelocitySetpoint
from ual_daemon.flight.state import estimate

Pair = tuple[MavlinkBackend, "Autopilot"]
SETPOINT = VelocitySetpoint(Vector3(1.0, 0.0, 0.0))


class Autopilot:
    """The other end of the link: sends what it is told, and what it got can be looked at."""

    def __init__(self, port: int | None = None) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(LIMIT_S)
        self.peer = None if port is None else ("127.0.0.1", port)
        self.pack = packer()

    @property
    def port(self) -> int:
        return int(self.socket.getsockname()[1])

    def say(self, *messages: Message) -> None:
        assert self.peer is not None
        for message in messages:
            self.socket.sendto(self.pack(message), self.peer)

    def hear(self, kind: str, **fields: object) -> Any:
        """The next message of a kind with such fields."""
        while True:
            data, self.peer = self.socket.recvfrom(4096)
            for frame in split(data)[0]:
                message = AutopilotCodec(1).decode(frame)
                if message.get_type() == kind and all(getattr(message, n) == v for n, v in fields.items()):
                    return message

    def hears_nothing_of(self, kind: str, for_s: float) -> bool:
        deadline_s = time.monotonic() + for_s
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            self.socket.settimeout(left_s)
            with contextlib.suppress(TimeoutError):
                data, _ = self.socket.recvfrom(4096)
                if any(AutopilotCodec(1).decode(frame).get_type() == kind for frame in split(data)[0]):
                    return False
        self.socket.settimeout(LIMIT_S)
        return True

    def close(self) -> None:
        self.socket.close()


@contextlib.contextmanager
def opened(url: str, on_update: UpdateCallback = lambda _: None, **settings: object) -> Iterator[MavlinkBackend]:
    backend = MavlinkBackend(BackendOptions("uav_1", url, settings))
    backend.open(on_update)
    try:
        yield backend
    finally:
        backend.close()


@pytest.fixture
def pair() -> Iterator[Pair]:
    """A backend and an autopilot that have met."""
    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}") as backend:

        def meets() -> bool:
            autopilot.say(heartbeat())
            return backend.info().autopilot == "PX4"

        until(meets, "the autopilot")
        yield backend, autopilot


class ReplayedClock(MonotonicClock):
    """The time of what is replayed: it stands still while this computer is busy."""

    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def let_pass(self, passed_s: float) -> None:
        self.time_s += passed_s
        time.sleep(0.0)  # lets the backend's thread run


def test_a_recorded_take_off_replayed_over_udp_shows_its_states() -> None:
    port, clock = free_port(), ReplayedClock()
    states: list[State] = []
    heights_m: list[float] = []

    def on_update(snapshot: Snapshot) -> None:
        found = estimate(snapshot, MavlinkBackend.freshness).state
        if states[-1:] != [found]:
            states.append(found)
        if snapshot.motion.pose is not None:
            heights_m.append(snapshot.motion.pose.value.position.z)

    def let_pass(passed_s: float) -> bool:
        clock.let_pass(passed_s)
        return states[-1] is not State.FLYING_MANUAL

    backend = MavlinkBackend(BackendOptions("uav_1", f"udpin://127.0.0.1:{port}", {}))
    backend.clock = clock
    backend.open(on_update)
    with contextlib.closing(backend):
        until(lambda: states, "the first update", between=lambda: clock.let_pass(0.01))
        replay_stepped(load("px4_auto_takeoff_loiter_rtl"), port, let_pass)
    assert states == [
        State.UNINITIALIZED,
        State.LANDED_DISARMED,
        State.LANDED_ARMED,
        State.TAKING_OFF,
        State.FLYING_MANUAL,
    ]
    assert max(heights_m) > 2.0


def test_updates_come_at_each_pose_and_without_any() -> None:
    seen: list[Snapshot] = []
    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}", seen.append):
        until(lambda: len(seen) > 5, "updates of silence")
        assert seen[-1].heard_s is None
        autopilot.say(heartbeat(), attitude(), position(0.0))
        until(lambda: any(norths(seen)), "the first pose")
        autopilot.say(attitude(), position(0.02, north=5.0))
        until(lambda: 5.0 in norths(seen), "the next")
        assert [north for north, _ in itertools.groupby(norths(seen))] == [1.0, 5.0]


def norths(seen: list[Snapshot]) -> list[float]:
    return [snapshot.motion.pose.value.position.y for snapshot in seen if snapshot.motion.pose is not None]


def test_an_update_that_fails_does_not_end_the_updates(caplog: pytest.LogCaptureFixture) -> None:
    count = 0

    def fail(_: Snapshot) -> None:
        nonlocal count
        count += 1
        raise ValueError("a defect above")

    with caplog.at_level(logging.CRITICAL), opened(f"udpin://127.0.0.1:{free_port()}", fail):
        until(lambda: count > 3, "more updates")


def test_a_setpoint_has_left_when_send_returns(pair: Pair) -> None:
    backend, autopilot = pair
    backend.send(SETPOINT)
    sent = autopilot.hear("SET_POSITION_TARGET_LOCAL_NED")
    assert (sent.vx, sent.vy, sent.target_system) == (0.0, 1.0, 1)
    backend.send(PositionSetpoint(Vector3(1.0, 2.0, 3.0), 0.0))
    assert autopilot.hear("SET_POSITION_TARGET_LOCAL_NED").z == -3.0


def test_no_setpoint_and_no_command_goes_out_before_an_autopilot_is_received() -> None:
    with opened(f"udpin://127.0.0.1:{free_port()}") as backend:
        backend.send(SETPOINT)
        for command in (
            backend.arm,
            lambda: backend.land(Limits()),
            backend.hold,
            backend.take_control,
            backend.disarm,
        ):
            assert isinstance(command().exception(LIMIT_S), LinkLostError)
        error = backend.take_off(3.0, Limits()).exception(LIMIT_S)
        assert str(error) == f"cannot take off: no autopilot is heard at {backend.url}"


@contextlib.contextmanager
def speaking(autopilot: Autopilot) -> Iterator[None]:
    """The autopilot says all the time that it is there: nothing is commanded into a silence."""
    is_over = threading.Event()

    def speak() -> None:
        while not is_over.wait(0.02):
            autopilot.say(heartbeat())

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        yield
    finally:
        is_over.set()
        speaker.join()


def test_no_setpoint_goes_out_while_the_link_is_down(pair: Pair) -> None:
    backend, autopilot = pair
    assert backend._discovery is not None
    backend._discovery.watch.lost_s = -1.0
    backend.send(SETPOINT)
    assert autopilot.hears_nothing_of("SET_POSITION_TARGET_LOCAL_NED", 0.2)
    assert isinstance(backend.arm().exception(LIMIT_S), LinkLostError)


def test_a_command_ends_with_the_autopilots_acknowledgement(pair: Pair) -> None:
    backend, autopilot = pair
    with speaking(autopilot):
        future = backend.arm()
        autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    autopilot.say(ack(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_RESULT_ACCEPTED))
    assert future.result(LIMIT_S) is None
    # and a heartbeat is asked for, so that the state follows at once
    autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_REQUEST_MESSAGE, param1=0.0)


def test_a_stream_of_setpoints_opens_the_path_to_take_control(pair: Pair) -> None:
    backend, autopilot = pair
    future = backend.take_control()
    stop = threading.Event()

    def stream() -> None:
        while not stop.wait(0.02):
            backend.send(SETPOINT)
            autopilot.say(heartbeat())  # the link stays up

    sender = threading.Thread(target=stream)
    sender.start()
    try:
        asked = autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_DO_SET_MODE)
        assert (asked.param2, asked.param3) == (6.0, 0.0)
        for _ in range(2):
            autopilot.say(ack(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_ACCEPTED))
        assert future.result(LIMIT_S) is None
    finally:
        stop.set()
        sender.join()


def test_flying_an_unknown_autopilot_is_not_supported() -> None:
    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}") as backend:

        def meets() -> bool:
            autopilot.say(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_GENERIC))
            return backend.snapshot().control.armed is not None

        until(meets, "the autopilot")
        assert isinstance(backend.arm().exception(LIMIT_S), NotSupportedError)
        with pytest.raises(NotSupportedError):
            backend.send(SETPOINT)


def test_udpout_calls_the_autopilot() -> None:
    with contextlib.closing(Autopilot()) as autopilot, opened(f"udpout://127.0.0.1:{autopilot.port}") as backend:
        autopilot.hear("HEARTBEAT", type=mavlink.MAV_TYPE_ONBOARD_CONTROLLER)
        autopilot.say(heartbeat())
        until(lambda: backend.snapshot().control.armed, "the autopilot's answer")


def test_a_taken_port_is_reported_and_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ual_daemon.backends.mavlink.links.connection.FIRST_RECONNECT_PAUSE_S", 0.02)
    port = free_port()
    with contextlib.ExitStack() as stack:
        other = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        other.bind(("127.0.0.1", port))
        backend = stack.enter_context(opened(f"udpin://127.0.0.1:{port}"))
        text = until(lambda: backend.snapshot().link.trouble, "the trouble")
        assert text == (
            f"cannot listen at UDP 127.0.0.1:{port}: Address already in use; "
            "trying again (does another program use this port?)"
        )
        other.close()
        waiting = f"nothing comes to udpin://127.0.0.1:{port}"
        until(lambda: backend.snapshot().link.trouble == waiting, "the port")
        autopilot = stack.enter_context(contextlib.closing(Autopilot(port)))
        autopilot.say(heartbeat())
        until(lambda: backend.snapshot().control.armed is not None, "the autopilot")
        until(lambda: not backend.snapshot().link.trouble, "the end of the trouble")


def test_a_serial_link_that_is_pulled_out_is_in_the_reason_of_the_state(tmp_path: Path) -> None:
    device, theirs = open_terminal()
    line = tmp_path / "ttyACM0"
    line.symlink_to(os.ttyname(theirs))
    os.close(theirs)
    with opened(f"serial://{line}:57600") as backend:
        pack = packer()

        def why() -> str:
            return estimate(backend.snapshot(), backend.freshness).why

        def meets() -> bool:
            os.write(device, pack(heartbeat()))
            return backend.snapshot().control.armed is not None

        until(meets, "the autopilot")
        os.close(device)
        line.unlink()
        until(
            lambda: why().endswith(f"cannot open {line}: there is no such device (is it plugged in?); trying again"),
            "why",
        )
        assert why().startswith("nothing heard from the autopilot for ")


def test_where_nothing_can_be_sent_to_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    """The broadcast address of a net, which no URL shows to be one."""
    with opened("udpout://127.255.255.255:14999") as backend:
        text = "cannot send to 127.255.255.255: it is a broadcast address"
        until(lambda: backend.snapshot().link.trouble == text, "the trouble")
    assert caplog.messages.count(text) == 1


def test_what_waited_while_the_thread_was_not_scheduled_is_not_taken_for_the_present(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ual_daemon.backends.engine.limits.READER_PAUSE_S", 0.3)
    resume, paused = threading.Event(), threading.Event()
    seen: list[Snapshot] = []

    def on_update(snapshot: Snapshot) -> None:
        seen.append(snapshot)
        if snapshot.control.armed is not None and not paused.is_set():
            paused.set()
            assert resume.wait(LIMIT_S)

    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}", on_update):
        until(lambda: seen, "an update")
        autopilot.say(heartbeat())
        assert paused.wait(LIMIT_S)
        old = len(seen)
        for _ in range(100):
            autopilot.say(heartbeat(armed=True))
        time.sleep(0.4)  # the pause itself
        resume.set()
        until(lambda: len(seen) > old + 3, "updates after the pause")
        assert [snapshot.control.armed for snapshot in seen[old:]] == [None] * len(seen[old:])
        autopilot.say(heartbeat())
        until(lambda: seen[-1].control.armed is not None and not seen[-1].control.armed.value, "the present")


def test_a_defect_in_the_receiving_thread_is_logged_and_the_link_opened_anew(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    failures = [ZeroDivisionError()] * 3
    tick = Discovery.tick

    def failing(self: Discovery, now_s: float) -> None:
        if self.session is not None and failures:
            raise failures.pop()
        tick(self, now_s)

    monkeypatch.setattr(Discovery, "tick", failing)
    port = free_port()
    seen: list[Snapshot] = []
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}", seen.append):

        def meets() -> bool:
            autopilot.say(heartbeat(armed=True))
            return not failures

        until(meets, "the defects")
        told = [record for record in caplog.records if record.exc_info and record.exc_info[0] is ZeroDivisionError]
        assert len(told) == 1
        old = len(seen)

        def is_received() -> bool:
            autopilot.say(heartbeat(armed=True))
            return len(seen) > old and seen[-1].control.armed is not None

        until(is_received, "what is said afterwards")


def test_closing_ends_the_updates_the_thread_and_the_socket() -> None:
    port = free_port()
    seen: list[Snapshot] = []
    before = threading.active_count()
    for _ in range(3):
        with opened(f"udpin://127.0.0.1:{port}", seen.append):
            until(lambda: len(seen) > 2, "updates")
        assert threading.active_count() == before
        seen.clear()


def test_closing_from_an_update_does_not_wait_for_itself() -> None:
    closed: Future[None] = Future()
    backend = MavlinkBackend(BackendOptions("uav_1", f"udpin://127.0.0.1:{free_port()}"))

    def close(_: Snapshot) -> None:
        backend.close()
        if not closed.done():
            closed.set_result(None)

    backend.open(close)
    closed.result(LIMIT_S)
    backend.close()


def test_a_backend_never_opened_can_be_queried_and_closed() -> None:
    backend = MavlinkBackend(BackendOptions("uav_1"))
    assert backend.snapshot().motion.pose is None
    assert backend.info().autopilot == ""
    assert isinstance(backend.land(Limits()).exception(LIMIT_S), LinkLostError)
    backend.send(SETPOINT)
    backend.close()


def test_an_update_with_a_pose_finds_known_what_the_autopilot_can_do() -> None:
    port = free_port()
    found: list[tuple[bool, str]] = []
    backends: list[MavlinkBackend] = []

    def on_update(snapshot: Snapshot) -> None:
        if snapshot.motion.pose is not None:
            found.append((bool(backends[0].info().capabilities), backends[0].info().autopilot))

    with contextlib.closing(Autopilot(port)) as autopilot:
        backend = MavlinkBackend(BackendOptions("uav_1", f"udpin://127.0.0.1:{port}"))
        backends.append(backend)
        backend.open(on_update)
        try:

            def says_where_it_is() -> bool:
                autopilot.say(heartbeat(), attitude(), position(1.0))
                return bool(found)

            until(says_where_it_is, "an update with a pose")
        finally:
            backend.close()
    assert found[0] == (True, "PX4")
