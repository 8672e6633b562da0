"""Gimbals through the whole backend, over UDP sockets on loopback: managers in the autopilot, and beside it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.fakes import ack, heartbeat, packer
from tests.ual_daemon.backends.mavlink.test_backend import Autopilot, Pair, opened
from tests.waiting import LIMIT_S, until
from ual.errors import LinkLostError, RejectedByAutopilotError
from ual.geometry import Pose
from ual.gimbals import GimbalAbility, GimbalAngles, GimbalControl, GimbalReference
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.gimbals import GimbalDriver, GimbalDrivers

TURN, CONFIGURE = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
DOWN = GimbalAngles(0.0, 0.5, 0.25)
HORIZON = GimbalReference.HORIZON
NAN = math.nan
OWN = 154


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


def say_as(autopilot: Autopilot, component_id: int, *messages: Message) -> None:
    """Sends as a component, through the socket of the autopilot, which forwards what others say."""
    assert autopilot.peer is not None
    for message in messages:
        autopilot.socket.sendto(packer(1, component_id)(message), autopilot.peer)


def information(device_id: int) -> Message:
    flags = mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
    return mavlink.MAVLink_gimbal_manager_information_message(0, flags, device_id, 0.0, 0.0, -1.0, 0.5, -1.0, 1.0)


def found(backend: MavlinkBackend) -> GimbalDriver:
    offer = backend.offer(GimbalDrivers)  # type: ignore[type-abstract]
    assert offer is not None
    until(lambda: len(offer.all()) == 1, "the gimbal")
    return offer.all()[0]


@pytest.mark.parametrize("component_id", [1, OWN])
def test_it_is_found_ordered_and_observed(pair: Pair, component_id: int) -> None:
    backend, autopilot = pair
    device_id = 1 if component_id == 1 else OWN
    say_as(autopilot, component_id, information(device_id), information(device_id))
    gimbal = found(backend)
    assert gimbal.info.abilities >= {GimbalAbility.PITCH, GimbalAbility.YAW}

    ordered = gimbal.set_angles(DOWN, HORIZON)
    heard: Any = autopilot.hear("COMMAND_LONG", command=TURN, target_component=component_id)
    assert (heard.param1, heard.param2) == (pytest.approx(math.degrees(-0.5)), pytest.approx(math.degrees(-0.25)))
    say_as(autopilot, component_id, ack(TURN, mavlink.MAV_RESULT_ACCEPTED))
    ordered.result(LIMIT_S)

    ordered = gimbal.take_control()
    heard = autopilot.hear("COMMAND_LONG", command=CONFIGURE, target_component=component_id)
    assert (heard.param1, heard.param2) == (1.0, 191.0)
    say_as(autopilot, component_id, ack(CONFIGURE, mavlink.MAV_RESULT_DENIED))
    with pytest.raises(RejectedByAutopilotError, match="refused DO_GIMBAL_MANAGER_CONFIGURE: DENIED"):
        ordered.result(LIMIT_S)

    gimbal.aim(DOWN, HORIZON)
    autopilot.hear("GIMBAL_MANAGER_SET_ATTITUDE", target_component=component_id, gimbal_device_id=device_id)

    if component_id == 1:
        autopilot.hear("PARAM_REQUEST_READ", param_id="MNT_DO_STAB")
        autopilot.say(mavlink.MAVLink_param_value_message(b"MNT_DO_STAB", 0.0, mavlink.MAV_PARAM_TYPE_INT32, 1, 65535))
    half = math.radians(-30.0) / 2.0
    q = (math.cos(half), 0.0, math.sin(half), 0.0)
    in_vehicle = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
    looks = mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 0, in_vehicle, q, NAN, NAN, NAN, 0)
    controls = mavlink.MAVLink_gimbal_manager_status_message(0, 0, device_id, 1, 190, 0, 0)
    say_as(autopilot, component_id, looks, controls)
    until(lambda: gimbal.attitude() is not None, "where it looks")
    attitude = gimbal.attitude()
    assert attitude is not None
    assert attitude.orientation.to_euler()[1] == pytest.approx(math.radians(30.0))
    carried = backend._carried(device_id, Pose.at(0.0, 0.0, 5.0, yaw_rad=1.0))
    assert carried is not None
    assert carried.orientation.to_euler() == pytest.approx((0.0, math.radians(30.0), 0.0), abs=1e-6)
    assert backend._carried(99, Pose()) is None
    until(lambda: gimbal.control() == (GimbalControl.OTHER, "system 1, component 190"), "who controls it")


def test_messages_of_another_system_are_not_taken(pair: Pair) -> None:
    backend, autopilot = pair
    assert autopilot.peer is not None
    autopilot.socket.sendto(packer(2, OWN)(information(OWN)), autopilot.peer)
    say_as(autopilot, OWN, information(OWN), information(OWN))
    gimbal = found(backend)
    assert gimbal.info.name == "gimbal 154 of component 154"


def test_without_an_autopilot_there_are_none_and_an_order_is_refused() -> None:
    backend = MavlinkBackend(BackendOptions("uav_1", "udpin://127.0.0.1:9"))
    offer = backend.offer(GimbalDrivers)  # type: ignore[type-abstract]
    assert offer is not None
    assert offer.all() == []


def test_an_autopilot_that_is_lost_ends_the_orders(pair: Pair) -> None:
    backend, autopilot = pair
    autopilot.say(information(1))
    autopilot.say(information(1))
    gimbal = found(backend)
    until(lambda: not is_up(gimbal), "the loss")
    with pytest.raises(LinkLostError):
        gimbal.move_to_neutral().result(LIMIT_S)


def is_up(gimbal: GimbalDriver) -> bool:
    """Returns whether an order reaches the autopilot; it is withdrawn."""
    ordered = gimbal.move_to_neutral()
    is_refused = ordered.done() and ordered.exception() is not None
    ordered.cancel()
    return not is_refused
