from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

import ual
from tests.ual import fake_daemon
from tests.ual.fake_daemon import FakeDaemon
from tests.waiting import LIMIT_S
from ual import _calls, _direct, _setpoints
from ual._connection import Connection
from ual._setpoints import STALE_SETPOINT_S, Setpoints, _Stream
from ual._target import DaemonTarget
from ual.errors import InvalidArgumentError, WrongStateError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.v1 import ual_pb2 as pb


class HandClock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    with fake_daemon.running() as running:
        yield running


@pytest.fixture
def clock() -> HandClock:
    return HandClock()


@pytest.fixture(params=["direct", "by iterator"])
def setpoints(
    daemon: FakeDaemon, clock: HandClock, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Setpoints]:
    if request.param == "by iterator":  # a gRPC that lets us not
        monkeypatch.setattr(_direct, "sender", lambda _: None)
    connection = Connection(DaemonTarget("uav_1", daemon.address, None))
    setpoints = Setpoints(connection, clock)
    yield setpoints
    setpoints.settle()
    connection.close()


def forward(speed_m_s: float) -> pb.StreamSetpointsRequest:
    return _calls.setpoint(TwistStamped(Twist(Vector3(speed_m_s, 0.0, 0.0))), "velocity")


def speeds(daemon: FakeDaemon) -> list[float]:
    return [request.velocity.twist.linear.x for request in daemon.streamed]


# --- Which calls are answered, and which are streamed -----------------------------------------------------------------


def test_the_first_is_answered_and_those_that_follow_are_streamed(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    setpoints.send(forward(1.0))
    assert len(daemon.answered) == 1
    for number in range(2, 5):
        setpoints.send(forward(number))
        daemon.wait_for_streamed(number - 1)
    assert speeds(daemon) == [2.0, 3.0, 4.0]
    assert len(daemon.answered) == 1


def test_after_a_pause_the_next_is_answered_again(daemon: FakeDaemon, setpoints: Setpoints, clock: HandClock) -> None:
    setpoints.send(forward(1.0))
    clock.now_s += 0.6
    setpoints.send(forward(2.0))
    assert len(daemon.answered) == 2
    assert daemon.streamed == []


def test_poses_and_velocities_share_a_stream(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    setpoints.send(_calls.setpoint(PoseStamped(Pose.at(1.0, 2.0, 3.0)), "pose"))
    setpoints.send(forward(1.0))
    daemon.wait_for_streamed(1)
    setpoints.send(_calls.setpoint(PoseStamped(Pose.at(4.0, 5.0, 6.0)), "pose"))
    daemon.wait_for_streamed(2)
    assert isinstance(daemon.answered[0], pb.SetPoseRequest)
    assert [request.WhichOneof("setpoint") for request in daemon.streamed] == ["velocity", "pose"]


# --- Refusals ---------------------------------------------------------------------------------------------------------


def test_a_refusal_of_the_first_is_raised_by_it(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    daemon.refusal = WrongStateError("it stands on the ground", {"state": "LANDED_ARMED"})
    for _ in range(2):
        with pytest.raises(WrongStateError, match="ground"):
            setpoints.send(forward(1.0))
    assert daemon.streamed == []


def test_a_refusal_in_the_stream_is_raised_by_the_next_call(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    setpoints.send(forward(1.0))
    setpoints.send(forward(2.0))
    daemon.wait_for_streamed(1)
    daemon.refusal = WrongStateError("the pilot flies", {"state": "FLYING_MANUAL"})
    with pytest.raises(WrongStateError, match="the pilot flies") as caught:
        send_until_refused(setpoints)
    assert caught.value.state == "FLYING_MANUAL"
    daemon.refusal = None
    setpoints.send(forward(3.0))
    assert len(daemon.answered) == 2, "the one after a refusal is answered"
    setpoints.send(forward(4.0))
    daemon.wait_for_streamed(2)
    assert speeds(daemon) == [2.0, 4.0]


def test_a_refusal_that_no_call_can_raise_is_logged(
    daemon: FakeDaemon, setpoints: Setpoints, caplog: pytest.LogCaptureFixture
) -> None:
    setpoints.send(forward(1.0))
    setpoints.send(forward(2.0))
    daemon.wait_for_streamed(1)
    daemon.refusal = WrongStateError("the pilot flies")
    setpoints.send(forward(3.0))
    with caplog.at_level(logging.WARNING):
        assert not setpoints.settle()
    assert "the last setpoints were refused: WRONG_STATE: the pilot flies" in caplog.text


def test_what_the_daemon_does_not_take_before_the_stream_must_end_is_reported(
    daemon: FakeDaemon, setpoints: Setpoints, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_setpoints, "CLOSE_TIMEOUT_S", 0.2)
    setpoints.send(forward(1.0))
    setpoints.send(forward(2.0))
    assert setpoints.settle()
    assert caplog.text == ""
    daemon.is_thawed.clear()
    setpoints.send(forward(1.0))
    setpoints.send(forward(0.0))
    assert not setpoints.settle()
    assert "the daemon did not take the last setpoints within 0.2 s" in caplog.text
    daemon.is_thawed.set()


def test_closing_sends_what_waits(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    setpoints.send(forward(1.0))
    setpoints.send(forward(0.0))
    setpoints.settle()
    assert speeds(daemon) == [0.0]


def test_a_value_that_is_no_number_is_refused_before_it_leaves(daemon: FakeDaemon) -> None:
    said = r"velocity\.twist\.linear\.x: 'fast' is not a number"
    with ual.Uav(address=daemon.address) as uav, pytest.raises(InvalidArgumentError, match=said):
        uav.set_velocity(Twist(Vector3("fast", 0.0, 0.0)))  # type: ignore[call-overload]
    assert daemon.answered == []


def send_until_refused(setpoints: Setpoints) -> None:
    pause = threading.Event()
    for _ in range(3000):
        setpoints.send(forward(2.0))
        pause.wait(0.01)


# --- Ctrl-C -----------------------------------------------------------------------------------------------------------


def interrupting(function: Callable[..., object]) -> Callable[..., object]:
    """Returns the function; Ctrl-C comes when it is called for the first time, and nothing is done then."""
    left = [KeyboardInterrupt()]

    def interrupted(*args: object) -> object:  # (a function, to be a method)
        if left:
            raise left.pop()
        return function(*args)

    return interrupted


@pytest.mark.parametrize("where", ["stream", "open", "put"])
def test_after_ctrl_c_amid_a_setpoint_those_that_follow_arrive(
    daemon: FakeDaemon, setpoints: Setpoints, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    setpoints.send(forward(1.0))
    if where == "put":
        setpoints.send(forward(2.0))
        daemon.wait_for_streamed(1)
    owner = Connection if where == "stream" else _Stream
    monkeypatch.setattr(owner, where, interrupting(getattr(owner, where)))
    with pytest.raises(KeyboardInterrupt):
        setpoints.send(forward(9.0))
    streamed_count = len(daemon.streamed)
    setpoints.send(forward(3.0))
    setpoints.send(forward(4.0))
    daemon.wait_for_streamed(streamed_count + 1)
    assert setpoints.settle()
    assert len(daemon.answered) == 2, "the first after it is answered"
    assert 9.0 not in speeds(daemon)


def test_after_ctrl_c_within_grpc_a_call_goes_over_a_new_channel(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    connection = Connection(DaemonTarget("uav_1", daemon.address, None))
    connection.run(_calls.single_setpoint(forward(1.0)))
    first = connection._route
    assert first is not None

    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        connection._use(interrupted)
    connection.run(_calls.single_setpoint(forward(2.0)))
    assert connection._route is not first
    closed: list[object] = []
    monkeypatch.setattr(first.channel, "close", lambda: closed.append(first))
    connection.close()
    assert closed == [], "to close one that is locked would wait forever"


# --- What waits to be sent --------------------------------------------------------------------------------------------


class State:
    """Notes of gRPC's call about itself."""

    def __init__(self) -> None:
        self.condition = threading.Condition()
        self.due = {"receive_status_on_client"}
        self.code: object = None
        self.cancelled = False


class Call:
    """gRPC's call: what is sent in it, and when it is out."""

    def __init__(self) -> None:
        self.sent: list[float] = []
        self.is_out: list[Callable[[object], bool]] = []
        self.is_over = False
        self._call = self
        self._state = State()

    def operate(self, operations: tuple[object], tag: Callable[[object], bool]) -> bool:
        (operation,) = operations
        assert isinstance(operation, bytes)
        self.sent.append(pb.StreamSetpointsRequest.FromString(operation).velocity.twist.linear.x)
        self.is_out.append(tag)
        return not self.is_over

    def add_done_callback(self, _: object) -> None:
        pass

    def cancel(self) -> None:
        pass


class IteratedCall(Call):
    """One of a gRPC that has no direct way."""

    def __init__(self) -> None:
        super().__init__()
        del self._call


def opened(clock: HandClock, call: Call, monkeypatch: pytest.MonkeyPatch) -> _Stream:
    monkeypatch.setattr("grpc._cython.cygrpc.SendMessageOperation", lambda message, _: message)
    connection = Connection(DaemonTarget("uav_1", "127.0.0.1:1", None))
    monkeypatch.setattr(connection, "stream", lambda *_: call)
    stream = _Stream(connection, lambda _, __: None, clock)
    stream.open()
    return stream


def test_one_is_sent_at_once_and_of_those_that_follow_meanwhile_the_newest(
    clock: HandClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    call = Call()
    stream = opened(clock, call, monkeypatch)
    for number in range(5):
        stream.put(forward(number))
    assert call.sent == [0.0]
    assert call.is_out[0](None) is False, "the call goes on"
    assert call.sent == [0.0, 4.0]
    call.is_out[1](None)
    stream.put(forward(9.0))
    assert call.sent == [0.0, 4.0, 9.0]


def test_what_is_put_before_it_is_open_is_sent_then(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()
    monkeypatch.setattr(_Stream, "_send_next", lambda _: None)
    stream = opened(clock, call, monkeypatch)
    monkeypatch.undo()
    monkeypatch.setattr("grpc._cython.cygrpc.SendMessageOperation", lambda message, _: message)
    stream.put(forward(1.0))
    stream.put(forward(2.0))
    assert call.sent == []
    stream._send_next()
    assert call.sent == [2.0]


def test_what_could_not_be_sent_in_time_is_never_sent(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()
    stream = opened(clock, call, monkeypatch)
    stream.put(forward(1.0))
    stream.put(forward(2.0))
    clock.now_s += STALE_SETPOINT_S + 0.01
    call.is_out[0](None)
    stream.close(0.0)
    assert call.sent == [1.0]
    assert list(stream) == []


def test_it_ends_when_what_waits_is_out(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()
    stream = opened(clock, call, monkeypatch)
    stream.put(forward(1.0))
    stream.put(forward(2.0))
    stream.close(0.0)
    call.is_out[0](None)
    assert call.sent == [1.0, 2.0]
    call.is_out[1](None)
    assert list(stream) == []


def test_nothing_is_sent_in_a_call_that_is_over(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()
    call.is_over = True
    stream = opened(clock, call, monkeypatch)
    for number in range(3):
        stream.put(forward(number))
    assert call.sent == [0.0], "the first found out"


def test_without_a_direct_path_a_slow_reader_gets_the_newest(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = opened(clock, IteratedCall(), monkeypatch)
    stream.put(forward(1.0))
    assert next(stream).velocity.twist.linear.x == 1.0
    stream.put(forward(2.0))
    stream.put(forward(3.0))
    assert next(stream).velocity.twist.linear.x == 3.0
    stream.close(0.0)
    assert list(stream) == []


def test_what_is_in_progress_stands_in_what_grpc_waits_for(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()
    stream = opened(clock, call, monkeypatch)
    stream.put(forward(1.0))
    assert len(call._state.due) == 2
    call._state.due.discard("receive_status_on_client")  # the status came first
    assert call.is_out[0](None) is True, "that was the call's last"
    assert not call._state.due


def test_what_ctrl_c_kept_from_being_sent_is_not_waited_for(clock: HandClock, monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call()

    def operate(*_: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(call, "operate", operate)
    stream = opened(clock, call, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        stream.put(forward(1.0))
    assert call._state.due == {"receive_status_on_client"}


@pytest.mark.parametrize("how", ["status", "cancelled"])
def test_nothing_is_begun_in_a_call_that_has_ended(clock: HandClock, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    call = Call()
    stream = opened(clock, call, monkeypatch)
    if how == "status":
        call._state.code = "ABORTED"
    else:
        call._state.cancelled = True
    stream.put(forward(1.0))
    assert call.sent == []
    assert call._state.due == {"receive_status_on_client"}


def test_streams_that_end_while_setpoints_are_sent_do_not_hold_up_the_end_of_the_client(daemon: FakeDaemon) -> None:
    for _ in range(30):
        connection = Connection(DaemonTarget("uav_1", daemon.address, None))
        setpoints = Setpoints(connection)
        daemon.refusal = None
        setpoints.send(forward(1.0))
        setpoints.send(forward(2.0))
        daemon.refusal = WrongStateError("the pilot flies")
        with suppress(WrongStateError):
            for _ in range(200):
                setpoints.send(forward(2.0))
        closing = threading.Thread(target=connection.close, daemon=True)
        closing.start()
        closing.join(LIMIT_S)
        assert not closing.is_alive()
