"""The camera that the autopilot triggers: what is ordered, what is reported, and how waiting ends."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import received
from ual.cameras import CameraAbility
from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Pose
from ual_daemon.backends.engine.command import Repeat
from ual_daemon.backends.firmwares.trigger_camera import TriggerCamera
from ual_daemon.backends.firmwares.triggered_photos import REPORT_S
from ual_daemon.backends.futures import OpenFutures
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.offers.cameras import trigger_order
from ual_daemon.backends.mavlink.protocols.camera_trigger import AutopilotCameraTrigger
from ual_daemon.backends.offers.cameras import TakenPhoto, Viewpoint

ORDER = mavlink.MAV_CMD_DO_DIGICAM_CONTROL
DISTANCE = mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST


class Bench:
    """A camera of the autopilot, and what it was ordered."""

    def __init__(self) -> None:
        self.trigger = AutopilotCameraTrigger()
        self.trigger.look = lambda: Viewpoint(Pose.at(1.0, 2.0, 3.0), 4)
        self.trigger.utc_s = lambda: 1.9e9
        self.ordered: list[LongCommand] = []
        self.answers: list[Future[None]] = []
        self.camera = TriggerCamera(
            0, lambda: self.trigger, self.order, lambda act: act(), OpenFutures().give, lambda: True
        )

    def order(self, what: str, command_id: int, params: tuple[float, ...]) -> Future[None]:
        self.ordered.append(trigger_order(what, command_id, params))
        self.answers.append(Future())
        return self.answers[-1]

    def feedback(self, number: int, lat: int = 474_000_000, time_us: int = 1_800_000_000_000_000) -> None:
        places = (lat, 85_000_000, 500.0, 20.0)
        message = mavlink.MAVLink_camera_feedback_message(time_us, 1, 0, number, *places, 0.0, 0.0, 0.0, 0.0, 0, 0)
        self.trigger.handlers[message.id](received(message), 1.0)

    def triggered(self, number: int) -> None:
        message = mavlink.MAVLink_camera_trigger_message(5_000_000, number)
        self.trigger.handlers[message.id](received(message), 1.0)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_report_that_comes_twice_counts_once_also_after_the_next_one(bench: Bench) -> None:
    """Two ways to one vehicle double its messages. The second 5 was another picture, and then the 6 a lost one."""
    for number in (5, 6, 5, 7):
        bench.feedback(number, time_us=1_800_000_000_000_000 + number)
    assert (bench.trigger.photos.count, bench.trigger.missed_count) == (3, 0)


def test_a_picture_is_ordered_once_and_ends_with_its_report(bench: Bench) -> None:
    future = bench.camera.take_photo()
    [order] = bench.ordered
    assert (order.request.id, order.request.params[4]) == (ORDER, 1.0)
    assert order.repeat == Repeat()
    bench.answers[0].set_result(None)
    assert not future.done()
    bench.feedback(7)
    taken = future.result(0)
    assert (taken.number, taken.stamp_s, taken.viewpoint.body) == (0, 1.8e9, Pose.at(1.0, 2.0, 3.0))
    assert taken.viewpoint.position_geo is not None
    assert taken.viewpoint.position_geo.latitude_deg == pytest.approx(47.4)
    assert bench.camera.photos(0) == [taken]


def test_a_report_that_comes_before_the_answer_counts(bench: Bench) -> None:
    future = bench.camera.take_photo()
    bench.triggered(3)
    taken = future.result(0)
    assert (taken.stamp_s, taken.viewpoint.position_geo) == (1.9e9, None)
    assert bench.answers[0].cancelled()


def test_a_refusal_is_reported_and_silence_is_not_waited_for_without_end(bench: Bench) -> None:
    refused, silent, late = (bench.camera.take_photo() for _ in range(3))
    bench.answers[0].set_exception(RejectedByAutopilotError("no camera"))
    assert isinstance(refused.exception(0), RejectedByAutopilotError)
    bench.trigger.tick(1.0)
    bench.answers[1].set_result(None)
    bench.trigger.tick(1.0 + REPORT_S)
    for each in (silent, late):
        with pytest.raises(UalTimeoutError, match="it is not known whether it took one"):
            each.result(0)
    dropped: Future[TakenPhoto] = bench.camera.take_photo()
    bench.trigger.drop(LinkLostError("the autopilot has booted"))
    assert isinstance(dropped.exception(0), LinkLostError)


def test_each_report_counts_once_and_those_that_are_left_out_are_missed(bench: Bench) -> None:
    for number in (5, 5, 6, 9):
        bench.feedback(number)
    bench.triggered(0)  # the same pictures by another message
    assert len(bench.camera.photos(0)) == 3
    assert bench.camera.status().result(0).missed_count == 2
    bench.feedback(0)  # it has booted
    bench.feedback(60_000)
    assert bench.camera.status().result(0).missed_count == 2


def test_by_distance_the_autopilot_counts(bench: Bench) -> None:
    bench.camera.start_distance(5.0)
    assert bench.ordered[0].request.params[:3] == (5.0, 0.0, 1.0)
    assert bench.camera.status().result(0).distance_m is None
    bench.answers[0].set_result(None)
    assert bench.camera.status().result(0).distance_m == 5.0
    bench.camera.stop_photos()
    assert bench.ordered[1].request.id == DISTANCE
    assert bench.ordered[1].request.params[:3] == (0.0, 0.0, 0.0)
    assert all(order.is_told_by_answer for order in bench.ordered)  # their answers are alike
    bench.answers[1].set_result(None)
    assert not bench.camera.status().result(0).is_taking_photos


def test_what_it_cannot_do_is_reported(bench: Bench) -> None:
    assert bench.camera.info.abilities == {CameraAbility.PHOTO}
    with pytest.raises(NotSupportedError, match="takes no pictures by time"):
        bench.camera.start_interval(1.0, 0).result(0)
    orders: list[Callable[[], Any]] = [bench.camera.start_video, bench.camera.streams]
    for order in orders:
        with pytest.raises(NotImplementedError):
            order()
