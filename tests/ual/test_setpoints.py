from __future__ import annotations

import logging
import threading
from collections.abc import Iterator

import pytest

import ual
from tests.ual import fake_daemon
from tests.ual.fake_daemon import FakeDaemon
from ual import _calls
from ual._connection import Connection
from ual._setpoints import STALE_S, Setpoints, _Stream
from ual._target import Target
from ual.errors import InvalidArgumentError, WrongStateError
from ual.geometry import Pose, Twist, Vector3
from ual.v1 import ual_pb2 as pb

LIMIT_S = 30.0


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


@pytest.fixture
def setpoints(daemon: FakeDaemon, clock: HandClock) -> Iterator[Setpoints]:
    connection = Connection(Target("uav_1", daemon.address, None))
    setpoints = Setpoints(connection, clock)
    yield setpoints
    setpoints.settle()
    connection.close()


def forward(speed_m_s: float) -> pb.StreamSetpointsRequest:
    return _calls.velocity_setpoint(Twist(Vector3(speed_m_s, 0.0, 0.0)))


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
    setpoints.send(_calls.pose_setpoint(Pose.at(1.0, 2.0, 3.0)))
    setpoints.send(forward(1.0))
    daemon.wait_for_streamed(1)
    setpoints.send(_calls.pose_setpoint(Pose.at(4.0, 5.0, 6.0)))
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
        setpoints.settle()
    assert "the last setpoints were refused: WRONG_STATE: the pilot flies" in caplog.text


def test_closing_sends_what_waits(daemon: FakeDaemon, setpoints: Setpoints) -> None:
    setpoints.send(forward(1.0))
    setpoints.send(forward(0.0))
    setpoints.settle()
    assert speeds(daemon) == [0.0]


def test_a_value_that_is_no_number_is_refused_before_it_leaves(daemon: FakeDaemon) -> None:
    with ual.Uav(address=daemon.address) as uav, pytest.raises(InvalidArgumentError, match="velocity: "):
        uav.set_velocity(Twist(Vector3("fast", 0.0, 0.0)))  # type: ignore[arg-type]
    assert daemon.answered == []


def send_until_refused(setpoints: Setpoints) -> None:
    pause = threading.Event()
    for _ in range(3000):
        setpoints.send(forward(2.0))
        pause.wait(0.01)


# --- What waits to be sent --------------------------------------------------------------------------------------------


def stream(clock: HandClock) -> _Stream:
    return _Stream(Connection(Target("uav_1", "127.0.0.1:1", None)), lambda _, __: None, clock)


def test_only_the_newest_waits(clock: HandClock) -> None:
    waiting = stream(clock)
    for number in range(5):
        waiting.put(forward(number))
    waiting.close(0.0)
    assert [request.velocity.twist.linear.x for request in waiting] == [4.0]


def test_what_could_not_be_sent_in_time_is_never_sent(clock: HandClock) -> None:
    waiting = stream(clock)
    waiting.put(forward(1.0))
    clock.now_s += STALE_S + 0.01
    waiting.close(0.0)
    assert list(waiting) == []


def test_a_slow_reader_gets_the_newest_when_it_comes_back(clock: HandClock) -> None:
    waiting = stream(clock)
    waiting.put(forward(1.0))
    assert next(waiting).velocity.twist.linear.x == 1.0
    waiting.put(forward(2.0))
    clock.now_s += 1.0
    waiting.put(forward(3.0))
    assert next(waiting).velocity.twist.linear.x == 3.0
