"""The grippers, winches, servos and relays of a MAVLink autopilot: orders by commands, states by messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, UalError
from ual.gripper import GripperState, WinchStatus
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.gripper_codec import GRIPPER, GripperCodec, PayloadOrder, ordered
from ual_daemon.backends.firmwares.gripper_orders import OrderedGripper
from ual_daemon.backends.mavlink.dialects.command_long import command_of, request_message
from ual_daemon.backends.mavlink.offers.protocol_access import Orders
from ual_daemon.backends.mavlink.wire.messages import mavlink
from ual_daemon.backends.payload import PayloadMessage

T = TypeVar("T")

_N_PER_KG = 9.80665
_NO_TEMPERATURE_CODE = 32767
_CHANNELS_COUNT = 16
"""Of one SERVO_OUTPUT_RAW."""


class MavlinkGripper(OrderedGripper):
    """Payload devices of one backend's autopilot."""

    def __init__(self, orders: Orders) -> None:
        self._access, self._command, self._messages = orders

    @override
    def gripper_state(self, instance: int) -> Future[GripperState]:
        name = self._name()
        if not self._codec().texts:
            raise NotSupportedError(f"{name} does not say in which state its gripper is")

        def begin(state: GripperState, future: Future[GripperState]) -> None:
            if state is GripperState.UNKNOWN:
                futures.fail(future, UalError(f"{name} has not said it since the last order, boot or silence"))
            else:
                futures.finish(future, state)

        return self._access.run_on_loop(
            "ask for its gripper", lambda protocols, future: begin(protocols.gripper.state, future)
        )

    @override
    def winch_status(self, instance: int) -> Future[WinchStatus]:
        self._require_reported("its winch", is_reported=self._codec().tells_winches)
        return self._read("the state of its winch", mavlink.MAVLINK_MSG_ID_WINCH_STATUS, _winch_status)

    @override
    def servo_pwm_us(self, channel: int) -> Future[int]:
        self._require_reported("its servos", is_reported=self._codec().tells_servos)

        def read(message: PayloadMessage) -> int | None:
            return _pulse_us(message, channel)

        return self._read(f"the pulse of servo {channel}", mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, read)

    @override
    def relay_is_on(self, number: int) -> Future[bool]:
        self._require_reported("its relays", is_reported=self._codec().tells_relays)

        def read(message: PayloadMessage) -> bool | None:
            bit = 1 << (number - 1)
            if not message.fields["present"] & bit:
                raise NotSupportedError(f"the autopilot has no relay {number}")
            return bool(message.fields["on"] & bit)

        return self._read(f"the state of relay {number}", mavlink.MAVLINK_MSG_ID_RELAY_STATUS, read)

    @override
    def _order(self, order: PayloadOrder) -> Future[None]:
        command = ordered(command_of(order.id, order.params, order.what, group=order.device), order)
        if order.id == GRIPPER:
            self._access.post(lambda discovery: discovery.protocols.gripper.forget_state())
        result = self._command(order.what, command)
        self._access.post(lambda discovery: discovery.protocols.gripper.await_order(result, order.what))
        return result

    def _read(self, what: str, message_id: int, read: Callable[[PayloadMessage], T | None]) -> Future[T]:
        """Asks for a message, and returns what is read of it. One that is of something else (None) does not count."""
        future: Future[T] = self._access.run_on_loop(
            f"ask for {what}", lambda protocols, waiting: protocols.gripper.await_answer(waiting, what)
        )

        def on_message(message: PayloadMessage) -> None:
            if future.done():
                return
            try:
                found = read(message)
            except UalError as error:
                futures.fail(future, error)
            else:
                if found is not None:
                    futures.finish(future, found)

        stop_listening = self._messages.add(message_id, on_message)
        future.add_done_callback(lambda _: stop_listening())
        requested = self._command(f"ask for {what}", request_message(message_id))
        requested.add_done_callback(lambda ended: _refuse(future, ended))
        future.add_done_callback(lambda _: requested.cancel())
        return future

    def _require_reported(self, what: str, *, is_reported: bool) -> None:
        if not is_reported:
            raise NotSupportedError(f"{self._name()} says nothing of {what}")

    def _name(self) -> str:
        session = self._access.session()
        return "the autopilot" if session is None else session.dialect.name

    @override
    def _codec(self) -> GripperCodec:
        session = self._access.session()
        if session is None:
            raise LinkLostError("no autopilot is heard")
        if session.dialect.gripper is None:
            raise NotSupportedError(f"UAL moves nothing that {session.dialect.name} carries")
        return session.dialect.gripper


def make_driver(orders: Orders) -> MavlinkGripper:
    """Makes that of one backend."""
    return MavlinkGripper(orders)


def _refuse(future: Future[T], requested: Future[None]) -> None:
    error = None if requested.cancelled() else requested.exception()
    if error is not None and not future.done():
        futures.fail(future, error)


def _pulse_us(message: PayloadMessage, channel: int) -> int | None:
    """Returns the pulse width at a channel; None where the message is of others. Raises `UalError`: there is none."""
    port, index = divmod(channel - 1, _CHANNELS_COUNT)
    if message.fields["port"] != port:
        return None
    pulse_us = int(message.fields[f"servo{index + 1}_raw"])
    if not pulse_us:
        raise UalError(f"the autopilot puts out nothing at channel {channel}")
    return pulse_us


def _winch_status(message: PayloadMessage) -> WinchStatus:
    fields, flags = message.fields, message.fields["status"]
    tension_kg = _known(fields["tension"])
    return WinchStatus(
        _known(fields["line_length"]),
        _known(fields["speed"]),
        None if tension_kg is None else tension_kg * _N_PER_KG,
        _known(fields["voltage"]),
        _known(fields["current"]),
        None if fields["temperature"] == _NO_TEMPERATURE_CODE else float(fields["temperature"]),
        bool(flags & mavlink.MAV_WINCH_STATUS_HEALTHY),
        bool(flags & mavlink.MAV_WINCH_STATUS_FULLY_RETRACTED),
        bool(flags & mavlink.MAV_WINCH_STATUS_MOVING),
        bool(flags & mavlink.MAV_WINCH_STATUS_CLUTCH_ENGAGED),
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
