"""Streams to a daemon: from ROS' thread to the event loop, the newest value first. It needs no ROS."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Generic, NamedTuple, Protocol, TypeAlias, TypeVar

import ual
from ual_ros2.lateness import SETPOINT_S, steady_s

_log = logging.getLogger(__name__)

T = TypeVar("T")

Setpoint: TypeAlias = ual.PoseStamped | ual.TwistStamped | ual.types.ExternalPose

STALE_S = 0.2
"""A value that waits for longer than this is dropped, because it is out of date. `ual.aio` does the same."""


class Newest(Generic[T]):
    """Hands each value to `send`, one after the other. While one is being sent, only the newest waits.

    It never repeats one: where values stop coming, the daemon's own watchdog stops the UAV.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        send: Callable[[T], Awaitable[object]],
        on_refusal: Callable[[T, ual.UalError], None],
        clock: Callable[[], float] = steady_s,
    ) -> None:
        self._loop = loop
        self._send = send
        self._on_refusal = on_refusal
        self._clock = clock
        self._newest: tuple[T, float] | None = None
        self._sending: asyncio.Task[None] | None = None

    def put(self, value: T) -> None:
        """Takes a value. Any thread may call this."""
        self._loop.call_soon_threadsafe(self._take, value, self._clock())

    def clear(self) -> None:
        """Drops what waits. Only the event loop calls this."""
        self._newest = None

    def _take(self, value: T, put_s: float) -> None:
        """Only the event loop knows the newest: so none is lost between two threads."""
        self._newest = value, put_s
        if self._sending is None:
            self._sending = self._loop.create_task(self._send_all())

    async def _send_all(self) -> None:
        try:
            while self._newest is not None:
                (value, put_s), self._newest = self._newest, None
                if self._clock() - put_s <= STALE_S:
                    await self._send_one(value)
        finally:
            self._sending = None

    async def _send_one(self, value: T) -> None:
        try:
            await self._send(value)
        except ual.UalError as error:
            self._on_refusal(value, error)
        except Exception as error:  # noqa: BLE001 (a mistake in the node: those that follow are still sent)
            _log.exception("a setpoint failed in the node")
            self._on_refusal(value, ual.UalError(f"the node failed: {error!r}"))


class TopicValue(NamedTuple):
    """Value from a topic, and its time of arrival (`steady_s`)."""

    topic: str
    value: Setpoint
    heard_s: float


class Flying(Protocol):
    """Whether setpoints may fly now."""

    @property
    def is_active(self) -> bool:
        """Whether the node is active."""
        ...

    async def require_setpoint(self) -> None:
        """Raises an error where a setpoint may not fly: a lease that is lacking, a daemon that was not heard of."""
        ...

    async def provide_frame(self, frame_id: str) -> None:
        """Gives the daemon a frame that only tf knows. It may wait for tf."""
        ...


async def send_value(
    uav: ual.aio.Uav, flying: Flying, given: TopicValue, clock: Callable[[], float] = steady_s
) -> None:
    """Sends what came on a topic, unless the node is not active any more.

    Raises:
        UalTimeoutError: It is a velocity, and has waited until it was not of the present any more.
        UalError: The daemon, or the node, refuses it.

    """
    value = given.value
    if not flying.is_active:  # it ended after ROS' thread had taken this one
        return
    if isinstance(value, ual.types.ExternalPose):
        await uav.set_external_pose(
            value.pose,
            position_std_dev_m=value.position_std_dev_m,
            orientation_std_dev_rad=value.orientation_std_dev_rad,
        )
        return
    await flying.require_setpoint()
    if value.frame_id:
        await flying.provide_frame(value.frame_id)
    if not flying.is_active:  # it ended while the daemon or the frame was waited for
        return
    if isinstance(value, ual.PoseStamped):
        await uav.set_pose(value)
    else:
        _require_present(clock() - given.heard_s)
        await uav.set_velocity(value)


def _require_present(age_s: float) -> None:
    """Requires that a velocity did not wait for too long. A pose may: it says where to be, not for how long to move."""
    if age_s > SETPOINT_S:
        raise ual.UalTimeoutError(
            f"it waited for more than {SETPOINT_S:g} s for its frame or for the daemon: it is not flown. Send it again",
            {"age_s": f"{age_s:.3f}", "limit_s": f"{SETPOINT_S:g}"},
        )
