"""The watch over what is flown never fires in recorded flights of real autopilots, which had no fall.

They hold take-offs, go-tos, RTL, landings, a lost GPS, a reboot, fence and battery failsafes, and a pilot's sticks.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import cast

import pytest

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, UTC_S, Harness
from tests.ual_daemon.backends.mavlink.traces import DATA, load
from ual.types import Limits, State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.following import Following
from ual_daemon.flight.state import estimate

TICK_S = 0.02
NAMES = sorted(path.name.removesuffix(".tlog.gz") for path in DATA.glob("*.tlog.gz"))
HELD_S = 0.8
"""A busy computer reads nothing for so long, and then all at once."""

Frames = list[tuple[float, bytes]]


def as_it_came(frames: Frames) -> Frames:
    return frames


def in_bursts(frames: Frames) -> Frames:
    return [((time_s // HELD_S + 1.0) * HELD_S, frame) for time_s, frame in frames]


def with_gaps(frames: Frames) -> Frames:
    """A third of all time is lost, in a rhythm that is not that of the heartbeats: else none of them would come."""
    return [(time_s, frame) for time_s, frame in frames if int(time_s * math.pi) % 3]


def with_losses(frames: Frames) -> Frames:
    """Half of all is lost, by chance: in a rhythm one kind of message would never come."""
    chance = random.Random(47)
    return [each for each in frames if chance.random() < 0.5]


WAYS: list[Callable[[Frames], Frames]] = [as_it_came, in_bursts, with_gaps, with_losses]


def watch() -> Following:
    info = SimpleNamespace(limits=Limits(12.0, 3.0, 1.5, 3.0, 1.0))
    return Following(cast("Backend", SimpleNamespace(info=lambda: info)))


def executed(frames: Frames) -> Iterator[tuple[Snapshot, Harness]]:
    harness = Harness()
    waiting = iter(frames)
    frame = next(waiting, None)
    while frame is not None:
        harness.now_s += TICK_S
        while frame is not None and frame[0] <= harness.now_s:
            harness.discovery.receiver.receive(frame[1], ADDRESS, harness.now_s, UTC_S + harness.now_s)
            frame = next(waiting, None)
        if harness.discovery.session is not None:
            yield harness.snapshot(), harness


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("name", NAMES)
def test_no_recorded_flight_falls(name: str, way: Callable[[Frames], Frames]) -> None:
    following, states = watch(), set()
    for snapshot, harness in executed(way(load(name).frames)):
        found = estimate(snapshot, harness.session.dialect.freshness)
        states.add(found.state)
        following.observe(snapshot, found, None)
        assert not following.why, f"{following.why} at {harness.now_s:.2f} s in {found}"
    assert State.LANDED_DISARMED in states
    assert states & {State.FLYING_AUTO, State.FLYING_MANUAL}
