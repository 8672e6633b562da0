"""Limits of the work for a setpoint and for a sample of telemetry, in the worst case: the only table of such limits.

`tests/work/test_work.py` holds them. They are counted, not timed: see `tests/work/counting.py`. Each is what was
counted, and a margin: a twentieth for `calls`, a twelfth for samples, as not all take the same messages. Where one is
exceeded, something that each setpoint or sample passes has become longer: make it shorter, or say in the commit what it
is worth.
"""

from __future__ import annotations

from typing import NamedTuple


class Most(NamedTuple):
    """The limits of a setpoint.

    Attributes:
        calls: Functions of UAL that are called, and functions of C that they call; the median of a flight.
        first_calls: The most: where nothing is known yet of the fence here, by the rule itself, with polygons. It
            depends on what is near.
        blocks: Blocks of memory that are taken; the least of a flight. Twice what was counted: other threads take some
            where the call waits.

    """

    calls: int
    first_calls: int
    blocks: int


SETPOINTS = {
    "light": Most(106, 380, 20),
    "mavlink-px4": Most(122, 400, 24),
    "mavlink-ardupilot": Most(119, 400, 24),
    "mavros": Most(138, 430, 26),
    "crazyflie": Most(117, 400, 20),
    "airsim": Most(103, 380, 20),
    "dji": Most(124, 450, 24),
}
"""`UAL.set_velocity` 0.8 m above the ground, beside a corner or between holes of a fence, with each backend."""

SAMPLES = {
    "light": 422,
    "mavlink-px4": 1022,
    "mavlink-ardupilot": 890,
    "mavros": 1198,
    "crazyflie": 560,
    "airsim": 700,
    "dji": 1067,
}
"""Calls of functions from one sample to the next in the same flights. What was received is decoded, the velocity is
flown on, and the sample is made for one subscriber.
"""

SERVED_SETPOINTS = {
    "stream": Most(158, 400, 72),
    "stream with everything": Most(168, 520, 150),
    "call": Most(187, 440, 96),
    "call with everything": Most(347, 600, 200),
}
"""A velocity from a received message to the backend of a light UAV, in a stream or as a call of its own. *Everything*:
by a token and under a lease, while the flight is recorded and audited, and an extension and a second program subscribe.
"""

SERVED_SAMPLES = {"one reader": Most(532, 1000, 83), "everything": Most(570, 1100, 160)}
"""One step of that UAV, its update, and its sample to the programs that read it. The margin is narrow, as its time is
stepped and nothing else runs: a sample that is packed by protobuf's objects takes 8 blocks more.
"""
