"""The longest path that is taken, with a corner at each of its waypoints: its end must not wait for its size."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tests.ual_daemon.stepped import at, stepped
from ual_daemon.settings import VehicleSettings
from ual_daemon.vehicle.planner import MOST_WAYPOINTS

MOST_S = 0.2
"""Of processor time: an abort of a short path takes 0.001 s."""


@contextmanager
def within(most_s: float) -> Iterator[None]:
    """Checks how much processor time this thread takes in the block, whatever else the computer does."""
    began_s = time.thread_time()
    yield
    assert time.thread_time() - began_s < most_s


def test_abort_and_shutdown_do_not_wait_for_the_size_of_a_path() -> None:
    corners = [at(2.0 * (i % 100), 2.0 * (i // 100) + 1.5 * (i % 2), 3.0 + i % 3) for i in range(MOST_WAYPOINTS)]
    with stepped(VehicleSettings()) as uav:
        uav.fly()
        ends: list[Callable[[], object]] = [uav.vehicle.commands.abort, uav.vehicle.prepare_shutdown]
        for end in ends:
            task = uav.prepare.follow_path(corners, corner_radius_m=0.5).begin()
            uav.run(0.5)
            with within(MOST_S):
                end()
            uav.run(2.0)
            assert task.future.done()
