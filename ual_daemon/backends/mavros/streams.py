"""Messages that the autopilot is asked to stream: MAVROS requests none by itself, and ArduPilot sends none unasked."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.parameters import Call
from ual_daemon.backends.rosbridge import Message

ROUND_S = 2.0
"""Seconds between two looks at the topics that come; one call is made for each missing topic."""
ASKS_COUNT = 3
"""Requests for a stream before it is given up, since its topic does not show: the autopilot may not know it."""
FLOWS_SHARE = 0.25
"""A topic flows if at least this part of the requested rate comes."""
NEEDED = frozenset(
    (topics.STATE, topics.EXTENDED_STATE, topics.POSE, topics.IMU, topics.SYS_STATUS, topics.ESTIMATOR_STATUS)
)
"""Without these the state is not known: only these are requested in flight, and only once they have stopped. With ROS 2
MAVROS executes no ``set_mode`` while it waits for the acknowledgement of such a request.
"""
CALL_S = 6.0
"""MAVROS waits for the autopilot's acknowledgement for 5 s."""
_HEARTBEAT, _SYS_STATUS, _GPS_RAW_INT, _ATTITUDE_QUATERNION, _LOCAL_POSITION_NED = 0, 1, 24, 31, 32
_GLOBAL_POSITION_INT, _GPS_GLOBAL_ORIGIN, _RC_CHANNELS, _VFR_HUD, _TARGET = 33, 49, 65, 74, 85
_MISSION_CURRENT, _GPS_RTK, _GPS2_RTK, _GIMBAL_DEVICE_ATTITUDE_STATUS = 42, 127, 128, 285
_SERVO_OUTPUT_RAW, _BATTERY_STATUS, _ESTIMATOR_STATUS, _HOME_POSITION, _EXTENDED_SYS_STATE = 36, 147, 230, 242, 245


class TopicStream(NamedTuple):
    """A MAVLink message that makes MAVROS publish a topic, and its rate.

    `is_counted`: the topic shows whether it comes. Else the answer of the autopilot counts.
    """

    topic: str
    message_id: int
    rate_hz: float
    is_counted: bool = True


def streams_of(autopilot: Autopilot, pose_rate_hz: float) -> tuple[TopicStream, ...]:
    """Returns the streams that are needed, the most important ones first."""
    return (
        *(() if autopilot.takes_feed_forward else (TopicStream(topics.STATE, _HEARTBEAT, 10.0),)),
        TopicStream(topics.EXTENDED_STATE, _EXTENDED_SYS_STATE, 10.0),
        TopicStream(topics.POSE, _LOCAL_POSITION_NED, pose_rate_hz),
        TopicStream(topics.IMU, _ATTITUDE_QUATERNION, pose_rate_hz),
        TopicStream(topics.SYS_STATUS, _SYS_STATUS, 5.0),
        *((TopicStream(topics.ESTIMATOR_STATUS, _ESTIMATOR_STATUS, 5.0),) if autopilot.takes_feed_forward else ()),
        TopicStream(topics.ORIGIN, _GPS_GLOBAL_ORIGIN, 1.0),
        TopicStream(topics.HOME, _HOME_POSITION, 1.0),
        TopicStream(topics.GLOBAL, _GLOBAL_POSITION_INT, 5.0),
        TopicStream(topics.FIX, _GPS_RAW_INT, 2.0),
        TopicStream(topics.VFR_HUD, _VFR_HUD, 2.0),
        TopicStream(topics.TARGET, _TARGET, 10.0),
        TopicStream(topics.RC_IN, _RC_CHANNELS, 5.0),
        *((TopicStream(topics.RC_OUT, _SERVO_OUTPUT_RAW, 2.0),) if autopilot.tells_motors else ()),
        TopicStream(topics.BATTERY, _BATTERY_STATUS, 1.0),
        *(() if autopilot.takes_feed_forward else _UNCOUNTED),
    )


_UNCOUNTED = (
    TopicStream(topics.MISSION, _MISSION_CURRENT, 2.0, is_counted=False),
    TopicStream(topics.GPS_RTK, _GPS_RTK, 1.0, is_counted=False),
    TopicStream(topics.GPS2_RTK, _GPS2_RTK, 1.0, is_counted=False),
)
"""Streams of ArduPilot that come now and then, or from some receivers only."""


GIMBAL = TopicStream(topics.GIMBAL, _GIMBAL_DEVICE_ATTITUDE_STATUS, 10.0, is_counted=False)
"""Stream of an autopilot that has a gimbal. Only MAVROS of ROS 2 publishes it."""


class StreamRequests:
    """Asks for the streams that do not come, one call at a time."""

    def __init__(self, streams: tuple[TopicStream, ...], counts: Mapping[str, int]) -> None:
        self._streams = streams
        self._counts = counts
        self._before: dict[str, int] = dict(counts)
        self._looked_s = -math.inf
        self._wanted: list[TopicStream] = list(streams)
        self._granted: set[str] = set()
        """The topics for which the autopilot has granted a rate."""
        self._asks: Counter[str] = Counter()

    def restart(self) -> None:
        """Asks for all, as the autopilot may have booted; in flight only for what does not come from now on."""
        self._wanted, self._looked_s = list(self._streams), -math.inf
        self._granted.clear()
        self._asks.clear()

    def add(self, stream: TopicStream) -> None:
        """Asks for another one, too."""
        if stream not in self._streams:
            self._streams = (*self._streams, stream)
            self._wanted.append(stream)

    def tick(self, now_s: float, call: Call, *, is_flying: bool) -> bool:
        """Asks for what is due. Returns whether it has called a service."""
        if is_flying and self._looked_s == -math.inf:
            self._begin_round(now_s)  # it may all come: another program has asked for it
        if not self._wanted and now_s - self._looked_s >= ROUND_S:
            self._poll(now_s, is_flying=is_flying)
        if is_flying:
            self._wanted = self._stopped(self._wanted)
        if not self._wanted:
            return False
        stream = self._wanted.pop(0)
        self._asks[stream.topic] += 1
        arguments = {"message_id": stream.message_id, "message_rate": stream.rate_hz}
        call(topics.SET_INTERVAL, arguments, lambda answer: self._on_answer(stream, answer), CALL_S)
        return True

    def _on_answer(self, stream: TopicStream, answer: Message) -> None:
        if answer.get("success"):
            self._granted.add(stream.topic)

    def _poll(self, now_s: float, *, is_flying: bool) -> None:
        passed_s = min(now_s - self._looked_s, 2.0 * ROUND_S)
        wanted = [each for each in self._streams if not self._flows(each, passed_s)]
        wanted = self._stopped(wanted) if is_flying else wanted
        self._begin_round(now_s)
        self._wanted = wanted

    def _stopped(self, streams: list[TopicStream]) -> list[TopicStream]:
        return [each for each in streams if each.topic in NEEDED and not self._came_count(each)]

    def _begin_round(self, now_s: float) -> None:
        self._wanted, self._before, self._looked_s = [], dict(self._counts), now_s

    def _came_count(self, stream: TopicStream) -> int:
        return self._counts[stream.topic] - self._before.get(stream.topic, 0)

    def _flows(self, stream: TopicStream, passed_s: float) -> bool:
        """Returns whether enough came; topics are throttled, so no more than 5 a second are expected of the others."""
        if not stream.is_counted:
            return stream.topic in self._granted or self._asks[stream.topic] >= ASKS_COUNT
        rate_hz = stream.rate_hz if stream.topic == topics.POSE else min(stream.rate_hz, 2.0)
        return self._came_count(stream) >= FLOWS_SHARE * rate_hz * passed_s
