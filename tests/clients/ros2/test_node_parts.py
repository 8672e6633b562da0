"""The parts of the node that need no ROS: its parameters, tf, times, setpoints, diagnostics and outcomes."""

from __future__ import annotations

import asyncio
import importlib
import math
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock, MagicMock

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ual
from tests.clients.ros2 import messages
from ual_ros2 import health, outcome, settings
from ual_ros2.outcome import CommandOutcome, CommandRun
from ual_ros2.ros_time import RosTime
from ual_ros2.setpoints import STALE_S, Newest, TopicValue, send_value
from ual_ros2.tf_buffer import TfBuffer


@pytest.fixture
def parameters() -> dict[str, Any]:
    return {name: default for name, (default, _) in settings.DEFAULTS.items()}


@pytest.fixture
def topics(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module of the topics, on stand-ins for the modules of ROS."""
    ros = ("diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs", "tf2_msgs", "ual_msgs")
    for name in (*ros, *(f"{each}.msg" for each in ros), "rclpy", "rclpy.qos", "rclpy.qos_overriding_options"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    yield importlib.import_module("ual_ros2.topics")
    sys.modules.pop("ual_ros2.topics")


# --- Topics -----------------------------------------------------------------------------------------------------------


def test_the_state_is_reported_when_it_changes_and_again_slowly(topics: Any) -> None:
    node = MagicMock(create_publisher=lambda *_, **__: MagicMock())
    told = topics.Topics(node, "uav_1", MagicMock(), MagicMock())
    published = told._state.publish
    for reason in ("nothing heard for 2.6 s", "nothing heard for 2.7 s", "nothing heard for 12 s"):
        told.publish(ual.Telemetry(ual.State.UNINITIALIZED, reason))
    assert published.call_count == 1
    told.publish(ual.Telemetry(ual.State.UNINITIALIZED, "not heard for 2.7 s"))
    assert published.call_count == 2
    told.publish(ual.Telemetry(ual.State.LANDED_DISARMED, "not heard for 2.7 s"))
    assert published.call_count == 3
    told.publish_slow(ual.Telemetry(ual.State.LANDED_DISARMED, "not heard for 2.7 s"), health.ConnectionReport())
    assert published.call_count == 4
    told._state.get_subscription_count.return_value = 0
    told.publish_slow(ual.Telemetry(ual.State.LANDED_DISARMED, "not heard for 2.7 s"), health.ConnectionReport())
    assert published.call_count == 4


@pytest.mark.parametrize(("subscribers_count", "published_count"), [(0, 1), (1, 10)])
def test_what_is_not_received_is_not_published_but_for_the_state(
    topics: Any, subscribers_count: int, published_count: int
) -> None:
    """The state is kept for those that subscribe later."""
    publisher = MagicMock()
    publisher.get_subscription_count.return_value = subscribers_count
    node = MagicMock()
    node.create_publisher.return_value = publisher
    told = topics.Topics(node, "uav_1", RosTime(Clock()), publisher)
    pose, twist = ual.Pose(), ual.Twist()
    odometry = ual.Odometry(pose, twist, "uav_1/odom", "uav_1/base_link", 1.0)
    battery = ual.Battery(50.0, 12.0)
    sample = ual.Telemetry(
        ual.State.LANDED_ARMED, pose=pose, velocity=twist, odometry=odometry, reference_pose=pose, battery=battery
    )
    told.publish(sample)
    told.publish_slow(sample, health.ConnectionReport())
    assert publisher.publish.call_count == published_count


# --- Parameters -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ns", "address", "uavs"),
    [
        ("", "", ()),
        ("uav_1", "", (("uav_1", ""),)),
        (["uav_1", "uav_2"], "", (("uav_1", ""), ("uav_2", ""))),
        ("", "host:50051", (("", "host:50051"),)),
        (["uav_1", "uav_2"], ["a:1", "b:2"], (("uav_1", "a:1"), ("uav_2", "b:2"))),
        (["uav_1", "uav_2"], "gateway:1", (("uav_1", "gateway:1"), ("uav_2", "gateway:1"))),
        ([""], [], ()),
    ],
)
def test_which_uavs_are_meant(parameters: dict[str, Any], ns: object, address: object, uavs: object) -> None:
    assert settings.settings_of(parameters | {"ns": ns, "address": address}).uavs == uavs


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"ns": ["uav_1", "uav_1"]}, "ns: .* twice"),
        ({"ns": ["uav_1", "uav_2", "uav_3"], "address": ["a:1", "b:1"]}, "there are 2 addresses for 3 namespaces"),
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"slow_rate_hz": float("nan")}, "slow_rate_hz"),
        ({"feedback_rate_hz": 1e9}, "feedback_rate_hz"),
        ({"transform_tolerance": 0.0}, "transform_tolerance: 0.0 is not a time above 0 s"),
        ({"transform_tolerance": float("nan")}, "transform_tolerance: nan"),
        ({"token_file": "/nowhere"}, "token_file: cannot read /nowhere"),
        ({"tls_key": "key.pem"}, "a certificate and its key are needed together"),
        ({"rate_hz": "fast"}, "rate_hz: 'fast' is not a number"),
        ({"rate_hz": True}, "rate_hz: True is not a number"),
        ({"autostart": "no"}, "autostart: 'no' is not true or false"),
        ({"ns": 5}, "ns: 5 is not text"),
        ({"ns": [1, 2]}, "ns: .* is not text"),
        ({"lease_holder": 7}, "lease_holder: 7 is not text"),
    ],
)
def test_what_is_wrong_is_named(parameters: dict[str, Any], wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(ual.InvalidArgumentError, match=text):
        settings.settings_of(parameters | wrong)


def test_a_rate_may_be_a_whole_number(parameters: dict[str, Any]) -> None:
    assert settings.settings_of(parameters | {"rate_hz": 50}).rate_hz == 50.0


def test_a_parameter_that_is_set_too_late_or_wrong_is_refused_with_what_to_do() -> None:
    late = settings.refusal({"rate_hz": 50.0, "use_sim_time": True}, is_configured=True)
    assert late.startswith("rate_hz is read when the node is configured: `ros2 lifecycle set`")
    assert settings.refusal({"rate_hz": -3.0}, is_configured=False) == "rate_hz: -3.0 is not a rate of 0 to 1000 Hz"
    assert settings.refusal({"transform_tolerance": -1}, is_configured=False).startswith(
        "transform_tolerance: -1 is not"
    )
    assert settings.refusal({"ns": 5}, is_configured=False) == "ns: 5 is not text"
    assert settings.refusal({"rate_hz": 50.0, "ns": "uav_1"}, is_configured=False) == ""
    assert settings.refusal({"use_sim_time": True, "qos_overrides./tf": 1}, is_configured=True) == ""


def test_a_parameter_that_the_node_does_not_have_is_reported_with_the_nearest() -> None:
    given = ("rate", "ns", "qos_overrides./uav_1/ual/pose.publisher.depth", "colour", "use_sim_time")
    assert settings.unknown(given, {*settings.DEFAULTS, "use_sim_time"}) == [
        "there is no parameter colour",
        "there is no parameter rate: do you mean rate_hz?",
    ]


@pytest.mark.parametrize("name", ["uav_1", "_a", "Uav22"])
def test_a_name_that_ros_can_have(name: str) -> None:
    assert settings.require_name(name) == name


@pytest.mark.parametrize("name", ["", "1uav", "uav-1", "uav 1", "uav/1", "ü"])
def test_a_name_that_ros_cannot_have_is_refused(name: str) -> None:
    with pytest.raises(ual.InvalidArgumentError, match="cannot be in a name of ROS"):
        settings.require_name(name)


def test_credentials_are_those_of_the_parameters_or_of_the_environment(
    parameters: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UAL_TOKEN", "of-the-environment")
    assert settings.settings_of(parameters).credentials.token == "of-the-environment"
    file = tmp_path / "token"
    file.write_text("of-the-file\n")
    assert settings.settings_of(parameters | {"token_file": str(file)}).credentials.token == "of-the-file"


def test_a_lease_is_requested_by_name_only_where_it_is_wanted(parameters: dict[str, Any]) -> None:
    assert settings.settings_of(parameters).lease_holder is None
    assert settings.settings_of(parameters | {"lease": True}).lease_holder == "ual_ros2"


# --- tf ---------------------------------------------------------------------------------------------------------------


def link(parent: str, child: str, x: float, yaw_rad: float = 0.0) -> ual.Transform:
    return ual.Transform(ual.Vector3(x, 0.0, 0.0), ual.Quaternion.from_yaw(yaw_rad), parent, child)


def test_a_frame_is_passed_below_the_nearest_one_that_is_known() -> None:
    tf = TfBuffer()
    for each in (link("map", "ship", 10.0), link("ship", "deck", 2.0), link("deck", "pad", 0.5)):
        tf.put(each)
    found = tf.to_known("pad", {"map", "ship"})
    assert found is not None
    assert (found.link.frame_id, found.link.child_frame_id) == ("ship", "pad")
    assert found.link.translation.x == pytest.approx(2.5)


def test_a_frame_that_is_forgotten_is_known_once_it_is_reported_again() -> None:
    tf = TfBuffer()
    tf.put(link("map", "tower", 5.0))
    for frame_id in ("tower", "tower"):
        tf.forget(frame_id)
    assert tf.to_known("tower", {"map"}) is None
    tf.put(link("map", "tower", 6.0))
    found = tf.to_known("tower", {"map"})
    assert found is not None
    assert found.link.translation.x == 6.0


def test_a_transform_that_is_reported_again_is_observed_and_one_of_others_is_not() -> None:
    tf = TfBuffer()

    def reported_count() -> int:
        found = tf.to_known("pad", {"map", "ship"})
        assert found is not None
        return found.told_count

    for each in (link("map", "ship", 10.0), link("ship", "deck", 2.0), link("deck", "pad", 0.5)):
        tf.put(each)
    before = reported_count()
    tf.put(link("map", "ship", 11.0))
    tf.put(link("map", "tower", 1.0))
    assert reported_count() == before
    tf.put(link("ship", "deck", 2.0))
    assert reported_count() == before + 1


def test_a_frame_next_to_the_known_ones_is_passed_below_map() -> None:
    tf = TfBuffer()
    tf.put(link("earth", "map", 100.0))
    tf.put(link("earth", "ship", 130.0))
    found = tf.to_known("ship", {"map"})
    assert found is not None
    assert (found.link.frame_id, found.link.child_frame_id) == ("map", "ship")
    assert found.link.translation.x == pytest.approx(30.0)


def test_what_tf_does_not_know_or_where_it_leads_round_is_none() -> None:
    tf = TfBuffer()
    assert tf.to_known("ship", {"map"}) is None
    tf.put(link("a", "b", 1.0))
    tf.put(link("b", "a", 1.0))
    assert tf.to_known("a", {"map"}) is None


def test_a_moving_frame_that_tf_refreshes_no_more_is_lost_and_a_static_one_is_not() -> None:
    now_s = 100.0
    tf = TfBuffer(1.0, lambda: now_s)
    tf.put(link("map", "ship", 10.0))
    tf.put(link("ship", "pad", 2.0), is_static=True)
    tf.put(link("map", "tower", 5.0), is_static=True)

    def require(frame_id: str) -> None:
        found = tf.to_known(frame_id, {"map"})
        assert found is not None
        tf.require_fresh(frame_id, found)

    now_s = 101.0
    require("pad")
    now_s = 101.1
    with pytest.raises(ual.FrameLostError, match=r"where pad is: ship was not on /tf for 1 s: start what") as lost:
        require("pad")
    assert lost.value.metadata["frame_id"] == "pad"
    assert lost.value.metadata["remedy"] == "start what publishes ship on /tf, or set transform_tolerance"
    tf.put(link("map", "ship", 11.0))
    require("pad")
    now_s = 1e9
    require("tower")


def test_a_moving_frame_ages_while_the_computer_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr("time.clock_gettime", lambda _: now_s)
    tf = TfBuffer(1.0)
    tf.put(link("map", "ship", 10.0))
    now_s = 3700.0
    found = tf.to_known("ship", {"map"})
    assert found is not None
    with pytest.raises(ual.FrameLostError):
        tf.require_fresh("ship", found)


def test_a_setpoint_that_waits_ages_while_the_computer_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check() -> list[int]:
        sent: list[int] = []
        now_s = 100.0
        monkeypatch.setattr("time.clock_gettime", lambda _: now_s)

        async def send(value: int) -> None:
            sent.append(value)

        newest = Newest(asyncio.get_running_loop(), send, lambda *_: None)
        newest.put(1)
        now_s = 3700.0
        await run_ready()
        return sent

    assert asyncio.run(check()) == []


def test_of_several_moving_frames_the_oldest_counts_whichever_path_tf_leads() -> None:
    now_s = 0.0
    tf = TfBuffer(1.0, lambda: now_s)
    tf.put(link("earth", "map", 100.0))
    now_s = 0.9
    tf.put(link("earth", "ship", 130.0))
    now_s = 1.5
    found = tf.to_known("ship", {"map"})
    assert found is not None
    with pytest.raises(ual.FrameLostError, match="where ship is: map was not on /tf"):
        tf.require_fresh("ship", found)


@pytest.mark.parametrize(
    "wrong",
    [
        link("map", "ship", math.nan),
        link("map", "ship", math.inf),
        link("map", "ship", 1.0, math.nan),
        link("", "ship", 1.0),
        link("ship", "ship", 1.0),
        ual.Transform(ual.Vector3(), ual.Quaternion(0.0, 0.0, 0.0, 0.0), "map", "ship"),
        ual.Transform(ual.Vector3(), ual.Quaternion(0.0, 0.0, 0.0, 1.02), "map", "ship"),
    ],
)
def test_what_is_no_transform_is_left_out_as_in_tf2(wrong: ual.Transform) -> None:
    tf = TfBuffer()
    tf.put(wrong)
    assert tf.to_known("ship", {"map"}) is None
    tf.put(link("map", "ship", 3.0))
    tf.put(wrong)
    found = tf.to_known("ship", {"map"})
    assert found is not None
    assert found.link.translation.x == 3.0


@given(st.lists(st.tuples(st.floats(-10.0, 10.0), st.floats(-3.0, 3.0)), min_size=1, max_size=8))
def test_a_chain_is_the_product_of_its_links(steps: list[tuple[float, float]]) -> None:
    tf, whole = TfBuffer(), ual.Transform(frame_id="map", child_frame_id="map")
    for i, (x, yaw_rad) in enumerate(steps):
        step = link("map" if i == 0 else f"f{i}", f"f{i + 1}", x, yaw_rad)
        tf.put(step)
        whole = whole.compose(step)
    found = tf.to_known(f"f{len(steps)}", {"map"})
    assert found is not None
    assert (found.link.translation - whole.translation).norm() < 1e-9


# --- Times ------------------------------------------------------------------------------------------------------------


class Clock:
    """A clock of ROS."""

    def __init__(self, now_s: float | None = None) -> None:
        self.ros_time_is_active = now_s is not None
        self.now_s = now_s or 0.0

    def now(self) -> SimpleNamespace:
        return SimpleNamespace(nanoseconds=round(self.now_s * 1e9))


def test_simulated_time_that_stands_is_noticed_and_real_time_never_stands() -> None:
    steady_s = [0.0]
    clock = Clock(50.0)
    time = RosTime(clock, lambda: 1000.0, lambda: steady_s[0])
    assert not time.stands()
    for steady_s[0] in (1.0, 2.0):
        assert not time.stands()
    steady_s[0] = 2.5
    assert time.stands()
    clock.now_s = 51.0
    assert not time.stands()
    real = RosTime(Clock(), lambda: 1000.0, lambda: steady_s[0])
    for steady_s[0] in (10.0, 20.0):
        assert not real.stands()


def test_times_are_those_of_utc_unless_time_is_simulated() -> None:
    time, stamp = RosTime(Clock(), lambda: 1000.0), messages.stamp()
    time.stamp(stamp, 900.5)
    assert (stamp.sec, stamp.nanosec) == (900, 500_000_000)
    assert time.utc_s(stamp) == 900.5


@pytest.mark.parametrize("utc_s", [2.0**31, 1e13, float("inf")])
def test_a_time_that_ros_cannot_express_is_its_latest(utc_s: float) -> None:
    time, stamp = RosTime(Clock(), lambda: 1000.0), messages.stamp()
    time.stamp(stamp, utc_s)
    assert (stamp.sec, stamp.nanosec) == ((1 << 31) - 1, 0)


def test_simulated_times_are_as_old_as_those_of_utc() -> None:
    clock = Clock(50.0)
    time, stamp = RosTime(clock, lambda: 1000.0), messages.stamp()
    time.stamp(stamp, 999.5)
    assert (stamp.sec, stamp.nanosec) == (49, 500_000_000)
    assert time.utc_s(stamp) == 999.5
    clock.now_s = 0.1  # it jumps back: no stamp is before its beginning
    time.stamp(stamp, 999.5)
    assert (stamp.sec, stamp.nanosec) == (0, 0)


def test_an_empty_stamp_means_now() -> None:
    assert RosTime(Clock(50.0), lambda: 1000.0).utc_s(messages.stamp()) == 0.0


def test_a_stamp_of_a_request_is_made_utc_and_an_empty_one_stays_so() -> None:
    simulated, given, empty = RosTime(Clock(50.0), lambda: 1000.0), messages.stamp(49, 500_000_000), messages.stamp()
    simulated.make_utc(given)
    simulated.make_utc(empty)
    assert (given.sec, given.nanosec) == (999, 500_000_000)
    assert (empty.sec, empty.nanosec) == (0, 0)


# --- Setpoints --------------------------------------------------------------------------------------------------------


async def run_ready() -> None:
    """Lets the event loop do all that it can do now."""
    for _ in range(10):
        await asyncio.sleep(0)


def test_while_one_is_sent_only_the_newest_waits() -> None:
    async def check() -> None:
        sent: list[int] = []
        may_go_on = asyncio.Event()

        async def send(value: int) -> None:
            sent.append(value)
            await may_go_on.wait()

        newest = Newest(asyncio.get_running_loop(), send, lambda *_: None, clock=lambda: 0.0)
        newest.put(1)
        await run_ready()
        for value in (2, 3, 4):
            newest.put(value)
        may_go_on.set()
        await run_ready()
        assert sent == [1, 4]

    asyncio.run(check())


def test_a_value_of_another_thread_is_taken_by_the_event_loop_alone() -> None:
    """So none is lost where one is put while another is taken to be sent."""

    async def check() -> None:
        sent: list[int] = []

        async def send(value: int) -> None:
            sent.append(value)

        newest = Newest(asyncio.get_running_loop(), send, lambda *_: None, clock=lambda: 0.0)
        putting = threading.Thread(target=newest.put, args=(1,))
        putting.start()
        putting.join()
        newest.clear()  # of what the loop knew until now
        await run_ready()
        assert sent == [1]

    asyncio.run(check())


def test_what_is_out_of_date_is_dropped() -> None:
    async def check() -> None:
        sent: list[int] = []
        now_s = 0.0

        async def send(value: int) -> None:
            nonlocal now_s
            sent.append(value)
            newest.put(2)
            now_s += STALE_S * 2

        newest = Newest(asyncio.get_running_loop(), send, lambda *_: None, clock=lambda: now_s)
        newest.put(1)
        await run_ready()
        assert sent == [1]

    asyncio.run(check())


def test_a_refusal_is_reported_and_the_next_one_is_sent() -> None:
    async def check() -> None:
        refusals: list[tuple[int, str]] = []

        def on_refusal(value: int, error: ual.UalError) -> None:
            refusals.append((value, error.message))

        async def send(value: int) -> None:
            raise ual.WrongStateError(f"not {value}")

        newest = Newest(asyncio.get_running_loop(), send, on_refusal, clock=lambda: 0.0)
        for value in (1, 2):
            newest.put(value)
            await run_ready()
        assert refusals == [(1, "not 1"), (2, "not 2")]

    asyncio.run(check())


def test_a_mistake_of_the_node_is_reported_and_those_that_follow_are_sent() -> None:
    async def main() -> None:
        sent: list[int] = []
        refusals: list[tuple[int, str]] = []

        async def send(value: int) -> None:
            if value == 1:
                raise ZeroDivisionError("a mistake")
            sent.append(value)

        newest = Newest(
            asyncio.get_running_loop(), send, lambda value, error: refusals.append((value, error.message)), lambda: 0.0
        )
        for value in (1, 2):
            newest.put(value)
            await run_ready()
        assert refusals == [(1, "the node failed: ZeroDivisionError('a mistake')")]
        assert sent == [2]

    asyncio.run(main())


class Flying:
    """A node that may be deactivated while a setpoint waits."""

    is_active = True

    def __init__(self, ends_in: str = "") -> None:
        self._ends_in = ends_in

    async def require_setpoint(self) -> None:
        self._end_in("require_setpoint")

    async def provide_frame(self, frame_id: str) -> None:
        assert frame_id == "deck"
        self._end_in("provide_frame")

    def _end_in(self, where: str) -> None:
        self.is_active = self.is_active and self._ends_in != where


@pytest.mark.parametrize(("ends_in", "is_sent"), [("", True), ("require_setpoint", False), ("provide_frame", False)])
def test_a_setpoint_that_waits_while_the_node_is_deactivated_is_not_sent(ends_in: str, is_sent: bool) -> None:
    uav: Any = SimpleNamespace(set_pose=AsyncMock(), set_velocity=AsyncMock())
    for value in (
        ual.PoseStamped(ual.Pose.at(1.0, 2.0, 3.0), "deck"),
        ual.TwistStamped(ual.Twist(ual.Vector3(1.0)), "deck"),
    ):
        asyncio.run(send_value(uav, Flying(ends_in), TopicValue("set_pose", value, 0.0), lambda: 0.5))
    assert (uav.set_pose.await_count, uav.set_velocity.await_count) == (is_sent, is_sent)


def test_a_velocity_that_waited_too_long_for_its_frame_is_not_executed_and_a_pose_is() -> None:
    uav: Any = SimpleNamespace(set_pose=AsyncMock(), set_velocity=AsyncMock())
    pose = ual.PoseStamped(ual.Pose.at(1.0, 2.0, 3.0), "deck")
    velocity = ual.TwistStamped(ual.Twist(ual.Vector3(1.0)), "deck")
    asyncio.run(send_value(uav, Flying(), TopicValue("set_pose", pose, 7.0), lambda: 8.0))
    with pytest.raises(ual.UalTimeoutError, match=r"waited for more than 0\.5 s .* it is not flown"):
        asyncio.run(send_value(uav, Flying(), TopicValue("set_velocity", velocity, 7.0), lambda: 7.6))
    assert (uav.set_pose.await_count, uav.set_velocity.await_count) == (1, 0)


# --- Outcomes ---------------------------------------------------------------------------------------------------------


async def _done() -> Mapping[str, object]:
    return {}


async def _read() -> Mapping[str, object]:
    return {"parameter": 1}


async def _refused() -> Mapping[str, object]:
    raise ual.GeofenceError("too far", {"setting": "radius"})


async def _broken() -> Mapping[str, object]:
    raise ZeroDivisionError("oh")


async def _for_ever() -> Mapping[str, object]:
    await asyncio.Event().wait()
    return {}


@pytest.mark.parametrize(
    ("begin", "ended"),
    [
        (_done, CommandOutcome()),
        (_read, CommandOutcome(told={"parameter": 1})),
        (_refused, CommandOutcome("GEOFENCE", "too far", {"setting": "radius"})),
        (_broken, CommandOutcome("INTERNAL", "the node failed: ZeroDivisionError('oh')")),
    ],
)
def test_how_a_command_ends(begin: Any, ended: CommandOutcome) -> None:
    async def check() -> CommandOutcome:
        return await CommandRun(begin).task

    assert asyncio.run(check()) == ended


def test_who_has_cancelled_is_reported() -> None:
    async def check() -> CommandOutcome:
        run = CommandRun(_for_ever)
        await run_ready()
        run.cancel("the ROS client")
        return await run.task

    assert asyncio.run(check()) == CommandOutcome("TASK_ABORTED", "cancelled: the ROS client", {"by": "the ROS client"})


def test_one_that_is_cancelled_before_it_begins_never_begins() -> None:
    async def check() -> CommandOutcome:
        run = CommandRun(lambda: pytest.fail("it has begun"))
        run.cancel("the ROS client")
        return await run.task

    assert asyncio.run(check()) == CommandOutcome("TASK_ABORTED", "cancelled: the ROS client", {"by": "the ROS client"})


@pytest.mark.parametrize("is_refused", [False, True])
def test_one_that_the_daemon_aborts_says_by_what_and_one_that_it_does_not_goes_on(is_refused: bool) -> None:
    async def check() -> CommandOutcome:
        flown: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        async def fly() -> Mapping[str, object]:
            await flown
            return {}

        async def abort() -> None:
            if is_refused:
                flown.set_result(None)
                raise ual.WrongStateError("it has landed")
            flown.set_exception(ual.TaskAbortedError("replaced by abort", {"by": "abort"}))

        run = CommandRun(fly)
        await run_ready()
        await run.abort("the ROS client", abort)
        return await run.task

    cancelled = CommandOutcome("TASK_ABORTED", "cancelled: the ROS client", {"by": "the ROS client"})
    assert asyncio.run(check()) == (CommandOutcome() if is_refused else cancelled)


PLACE = SimpleNamespace(latitude=0.0, altitude=0.0)
GEO = SimpleNamespace(waypoint=PLACE)
ASKED = SimpleNamespace(
    height=0.0, waypoint=PLACE, geo_waypoints=[GEO], holds=[1.0], pwm_us=0, path=[], pitch=0.0, zoom=0.0
)


@pytest.mark.parametrize(
    ("field", "named"),
    [
        ("height_m", "height"),
        ("latitude_deg", "waypoint.latitude"),
        ("geo_waypoints[1].altitude_m", "geo_waypoints[1].waypoint.altitude"),
        ("pitch_rad_s", "pitch"),
        ("percent", "zoom"),
        ("holds_s[0]", "holds[0]"),
        ("pwm_us", "pwm_us"),
        ("path[0].altitude_m", "path[0].altitude_m"),
        ("rate_hz", "rate_hz"),
        ("height_m[0].x", "height_m[0].x"),
    ],
)
def test_a_refusal_names_the_field_of_the_request(field: str, named: str) -> None:
    async def refused() -> Mapping[str, object]:
        raise ual.InvalidArgumentError(f"{field}: -1 is negative (my_{field})", {"field": field})

    async def check() -> CommandOutcome:
        return await CommandRun(refused, ASKED).task

    refusal = CommandOutcome("INVALID_ARGUMENT", f"{named}: -1 is negative (my_{field})", {"field": named})
    assert asyncio.run(check()) == refusal


def test_the_log_names_a_command_once() -> None:
    told = CommandOutcome("TASK_ABORTED", "go_to_waypoint: cancelled")
    assert told.text_of("go_to_waypoint") == "go_to_waypoint: TASK_ABORTED: cancelled"
    assert CommandOutcome("WRONG_STATE", "land needs it").text_of("land") == "land: WRONG_STATE: land needs it"


def test_answers_have_reason_words_and_metadata() -> None:
    refused = CommandOutcome("GEOFENCE", "too far", {"setting": "radius"})
    filled = outcome.fill(SimpleNamespace(), refused, lambda **fields: fields)
    assert (filled.success, filled.reason, filled.message) == (False, "GEOFENCE", "too far")
    assert filled.metadata == [{"key": "setting", "value": "radius"}]
    assert outcome.fill(SimpleNamespace(), CommandOutcome(told={"parameter": 1}), dict).parameter == 1
    assert outcome.fill_trigger(SimpleNamespace(), refused).message == 'GEOFENCE: too far\n{"setting": "radius"}'
    assert outcome.fill_trigger(SimpleNamespace(), CommandOutcome("GEOFENCE", "too far")).message == "GEOFENCE: too far"
    assert outcome.fill_trigger(SimpleNamespace(), CommandOutcome()) == SimpleNamespace(success=True, message="")


# --- Diagnostics ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sample", "refused", "level", "message"),
    [
        (ual.Telemetry(ual.State.FLYING_AUTO), "", health.OK, "FLYING_AUTO"),
        (ual.Telemetry(ual.State.UNINITIALIZED, "no GPS"), "GEOFENCE: far", health.ERROR, "no GPS"),
        (ual.Telemetry(ual.State.FLYING_AUTO, frame_lost="rebooted"), "", health.ERROR, "rebooted"),
        (ual.Telemetry(ual.State.FLYING_AUTO), "GEOFENCE: far", health.WARN, "refused: GEOFENCE: far"),
        (
            ual.Telemetry(ual.State.FLYING_MANUAL, health=ual.types.Health(failsafe="rc failsafe")),
            "",
            health.ERROR,
            "failsafe: rc failsafe",
        ),
        (
            ual.Telemetry(ual.State.LANDED_DISARMED, health=ual.types.Health(failing_checks=("Compass", "GPS"))),
            "",
            health.WARN,
            "Compass; GPS",
        ),
    ],
)
def test_the_worst_that_is_known_comes_first(sample: ual.Telemetry, refused: str, level: int, message: str) -> None:
    status = health.of(sample, health.ConnectionReport(refused=refused))
    assert (status.level, status.message) == (level, message)
    assert status.values["state"] == sample.state.name


@pytest.mark.parametrize(
    ("said", "level", "text"),
    [
        (health.ConnectionReport(lease="held"), health.OK, "FLYING_AUTO"),
        (health.ConnectionReport(lease="lost: not kept for 2 s"), health.WARN, "lease lost: not kept for 2 s"),
        (health.ConnectionReport(lease="not held: base holds it"), health.WARN, "lease not held: base holds it"),
        (health.ConnectionReport(other_nodes=1), health.WARN, "1 more node(s) offer this UAV"),
        (health.ConnectionReport(velocity_senders=("/a", "/b")), health.WARN, "2 nodes publish velocities: /a, /b."),
        (health.ConnectionReport(velocity_senders=("/a",)), health.OK, "FLYING_AUTO"),
        (health.ConnectionReport(clock="simulated time stands"), health.WARN, "simulated time stands"),
    ],
)
def test_what_the_node_lacks_is_a_warning(said: health.ConnectionReport, level: int, text: str) -> None:
    status = health.of(ual.Telemetry(ual.State.FLYING_AUTO), said)
    assert status.level == level
    assert status.message.startswith(text)
    assert status.values["other_nodes"] == str(said.other_nodes)


def test_silence_is_an_error() -> None:
    status = health.silent("the daemon tells nothing", health.ConnectionReport(address="host:1", lease="held"))
    assert (status.level, status.message) == (health.ERROR, "the daemon tells nothing")
    assert (status.values["address"], status.values["lease"]) == ("host:1", "held")
