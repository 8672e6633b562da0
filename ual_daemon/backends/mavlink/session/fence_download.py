"""Downloads the items of the autopilot's own fence by the mission protocol, again whenever they may have changed.

https://mavlink.io/en/services/mission.html. The list is requested, then each item, one at a time. PX4 ends the transfer
when it is asked for any other than the next one or the last again (handle_mission_request_both in its
mavlink_mission.cpp). The end is acknowledged, without which PX4 lets no ground station transfer anything for 5 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ual_daemon.backends.firmwares.fence_zones import FenceItem, FoundZones, find_zones
from ual_daemon.backends.mavlink.session.conversions import degrees
from ual_daemon.backends.mavlink.wire.frames import Source
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

RETRY_S = 0.6
"""After so long without an answer a request is sent again, ..."""
TRIES_COUNT = 10
"""... up to so many times: on a link that loses 30 % each way, one step in a thousand then has no answer."""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 5.0, 160.0
"""The time from a download that failed to the next one. It doubles each time: an autopilot need not answer at all."""
POLL_S = 30.0
"""How often it is downloaded anew while the autopilot is disarmed: a ground station may upload another one. In flight
the link is left to what flies; ArduPilot tells of another one by itself (`Autopilot.zones_parameter`)."""
MAX_ITEMS = 500
"""More items are not read: the geometry of so many circles takes 0.25 s. ArduPilot keeps 84 on a Pixhawk
(AC_PolyFence_loader::max_items), PX4 64 (DM_KEY_FENCE_POINTS_MAX)."""

_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_ACCEPTED, _CANCELLED = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_OPERATION_CANCELLED
_COUNT = -1


class FenceDownload:
    """Belongs to the thread that receives, and never blocks.

    Args:
        target: The autopilot.
        own_ids: Our system and component: only messages to these count.
        send: Sends a message.
        on_found: Takes what the items mean, whenever they have been downloaded, the same as before too.
        on_failed: Called when they could not be downloaded, with the reason. What was found before stays.

    """

    def __init__(
        self,
        target: Source,
        own_ids: tuple[int, int],
        send: Callable[[Message], object],
        on_found: Callable[[FoundZones], None],
        on_failed: Callable[[str], None],
    ) -> None:
        self._target = target
        self._own_ids = own_ids
        self._send = send
        self._on_found = on_found
        self._on_failed = on_failed
        self._awaited: int | None = None
        """The number of the item that is awaited, or `_COUNT`; None while nothing is."""
        self._items: list[FenceItem] = []
        self._count = 0
        self._tries_count = 0
        self._next_s = -math.inf
        """When the request is sent again, or the next download begins."""
        self._pause_s = FIRST_PAUSE_S
        self._is_wanted = True
        self._was_armed: bool | None = None

    def want(self) -> None:
        """Downloads it anew, at the next tick: what is under way may be of the fence before."""
        self._is_wanted = True
        self._pause_s = FIRST_PAUSE_S

    def tick(self, now_s: float, *, is_armed: bool | None) -> None:
        """Sends what is due; to be called often. `is_armed` is None while that is not known."""
        if is_armed and self._was_armed is False:
            self.want()
        self._was_armed = is_armed
        if self._is_wanted:
            self._begin(now_s)
        elif now_s < self._next_s:
            return
        elif self._awaited is None:
            if self._needs_poll(is_armed):
                self._begin(now_s)
        elif self._tries_count >= TRIES_COUNT:
            if self._awaited != _COUNT:
                self._acknowledge(_CANCELLED)
            self._fail("it does not answer", now_s)
        else:
            self._request(now_s)

    def on_count(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_COUNT."""
        if not self._is_ours(message) or self._awaited is None:
            return
        if self._awaited != _COUNT:
            if message.count != self._count:  # it has changed meanwhile; the same number is a repeated answer
                self._begin(now_s)
            return
        if message.count > MAX_ITEMS:
            self._end(_CANCELLED, now_s, FoundZones(why=f"it has {message.count} items, more than {MAX_ITEMS}"))
            return
        self._count = message.count
        self._items.clear()
        self._go_on(now_s)

    def on_item(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_ITEM_INT."""
        if self._is_ours(message) and message.seq == self._awaited:
            place = degrees(message.x), degrees(message.y)
            self._items.append(FenceItem(message.command, message.frame, message.param1, *place))
            self._go_on(now_s)

    def on_ack(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_ACK: the autopilot refuses a request."""
        if self._is_ours(message) and self._awaited is not None and message.type != _ACCEPTED:
            entry = mavlink.enums["MAV_MISSION_RESULT"].get(message.type)
            # Not acknowledged in turn: PX4 tells the ground station of an acknowledgement that it does not expect.
            self._fail(f"it answers {message.type if entry is None else entry.name}", now_s)

    def _is_ours(self, message: Message) -> bool:
        target = message.target_system, message.target_component
        return target == self._own_ids and message.mission_type == _FENCE

    def _needs_poll(self, is_armed: bool | None) -> bool:
        """Whether a pause has ended by a new download: while disarmed, or because the last one failed."""
        return not is_armed or self._pause_s > FIRST_PAUSE_S

    def _begin(self, now_s: float) -> None:
        self._is_wanted = False
        self._await(_COUNT, now_s)

    def _go_on(self, now_s: float) -> None:
        if len(self._items) < self._count:
            self._await(len(self._items), now_s)
            return
        self._end(_ACCEPTED, now_s, find_zones(self._items))

    def _end(self, result: int, now_s: float, found: FoundZones) -> None:
        self._acknowledge(result)
        self._awaited, self._next_s, self._pause_s = None, now_s + POLL_S, FIRST_PAUSE_S
        self._on_found(found)

    def _fail(self, why: str, now_s: float) -> None:
        self._awaited, self._next_s = None, now_s + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
        self._on_failed(why)

    def _acknowledge(self, result: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(*self._target, result, _FENCE))

    def _await(self, awaited: int, now_s: float) -> None:
        self._awaited, self._tries_count = awaited, 0
        self._request(now_s)

    def _request(self, now_s: float) -> None:
        self._tries_count += 1
        self._next_s = now_s + RETRY_S
        if self._awaited == _COUNT:
            self._send(mavlink.MAVLink_mission_request_list_message(*self._target, _FENCE))
        else:
            self._send(mavlink.MAVLink_mission_request_int_message(*self._target, self._awaited, _FENCE))
