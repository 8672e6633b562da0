"""Every member from many threads at once: no deadlock, only documented errors, and a normal flight afterwards.

`UAL_TEST_STRESS_S` makes it last that many seconds; else each thread makes a fixed number of calls.
"""

from __future__ import annotations

import contextlib
import os
import random
import threading
import time
from collections.abc import Callable

import pytest

from tests.conftest import LIMIT_S
from tests.waiting import until
from ual.errors import RejectedByAutopilotError, UalError, WrongStateError
from ual.geometry import Pose, Quaternion, Transform, Twist, Vector3
from ual.types import State
from ual_daemon import UAL

THREADS = 100
CALLS = 40
STRESS_S = float(os.environ.get("UAL_TEST_STRESS_S", "0"))


def members(uav: UAL, dice: random.Random) -> list[Callable[[], object]]:
    """Returns a call of each member, with random values."""
    sim = uav.simulation
    near = Pose.at(dice.uniform(-5, 5), dice.uniform(-5, 5), dice.uniform(1, 5), dice.uniform(-3, 3))
    wait_s = dice.uniform(0.0, 0.05)

    def subscribe() -> None:
        with uav.subscribe(lambda _: None):
            time.sleep(0)

    return [
        uav.info,
        uav.is_ready,
        uav.is_idle,
        uav.state,
        uav.pose,
        uav.velocity,
        uav.odometry,
        uav.transform,
        uav.reference_pose,
        uav.telemetry,
        uav.frames,
        subscribe,
        lambda: uav.add_frame(Transform(Vector3(1, 2, 3), Quaternion.from_yaw(1.0), "map", f"f{dice.randrange(5)}")),
        lambda: uav.arm(timeout_s=wait_s),
        lambda: uav.disarm(timeout_s=wait_s),
        lambda: uav.take_off(2.0, timeout_s=wait_s),
        lambda: uav.land(blocking=False),
        lambda: uav.go_to_waypoint(near, timeout_s=wait_s),
        lambda: uav.go_to_waypoint(near, blocking=False).cancel(),
        lambda: uav.go_to_waypoint_geo(37.4117, -6.0013, 3.0, blocking=False),
        lambda: uav.follow_path([near, Pose.at(0, 0, 3)], corner_radius_m=0.5, blocking=False),
        lambda: uav.set_pose(near),
        lambda: uav.set_velocity(Twist(Vector3(dice.uniform(-1, 1), 0, 0))),
        lambda: uav.recover_from_manual(timeout_s=wait_s),
        lambda: uav.set_home(dice.random() < 0.5),
        lambda: uav.abort(dice.random() < 0.5),
        lambda: uav.task("no such task"),
        sim.pilot_arm,
        sim.pilot_take_over,
        sim.pilot_give_back,
        lambda: sim.pilot_move_sticks(forward=dice.uniform(-1, 1)),
        sim.faults,
    ]


@pytest.mark.timeout(600)
def test_a_hundred_threads_call_every_member() -> None:
    unexpected: list[BaseException] = []
    until_s = time.monotonic() + STRESS_S

    with UAL(backend_settings={"speed_factor": 10}) as uav:

        def work(seed: int) -> None:
            dice = random.Random(seed)
            made = 0
            while (time.monotonic() < until_s) if STRESS_S else (made < CALLS):
                made += 1
                try:
                    dice.choice(members(uav, dice))()
                except UalError:
                    pass  # refusals are what is documented
                except BaseException as error:  # noqa: BLE001  the finding of this test
                    unexpected.append(error)
                    return

        threads = [threading.Thread(target=work, args=(seed,)) for seed in range(THREADS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout=STRESS_S + 300)
        assert not [thread for thread in threads if thread.is_alive()], "a deadlock"
        assert not unexpected, unexpected[:3]
        _flies_as_ever(uav)


def _flies_as_ever(uav: UAL) -> None:
    """Makes a plain flight, whatever the state is now."""

    def take_back() -> None:
        try:
            uav.recover_from_manual()
        except WrongStateError:  # it hovers where it may lie by what is known: its pilot is asked
            uav.simulation.pilot_give_back()

    def rests() -> bool:
        way_down: dict[State, Callable[[], object]] = {
            State.FLYING_MANUAL: take_back,
            State.FLYING_AUTO: uav.land,
            State.LANDED_ARMED: uav.disarm,
        }
        with contextlib.suppress(WrongStateError):  # an earlier command is still under way
            way_down.get(uav.state(), lambda: None)()
        return uav.state() is State.LANDED_DISARMED

    def arms() -> bool:
        with contextlib.suppress(RejectedByAutopilotError):  # it was disarmed just above the ground, and falls
            uav.arm()
        return uav.state() is State.LANDED_ARMED

    until(rests)
    until(arms)
    uav.set_home(set_z=True)
    uav.take_off(2.0)
    uav.go_to_waypoint(Pose.at(2, 1, 2))
    position = uav.pose().pose.position
    assert tuple(position) == pytest.approx((2, 1, 2), abs=0.05)
    uav.land()


def test_a_thread_waits_for_a_state_that_another_one_brings() -> None:
    with UAL(backend="light", backend_settings={"speed_factor": 20.0}) as uav:
        uav.wait_for(State.LANDED_DISARMED, timeout_s=LIMIT_S)
        found: list[State] = []
        waiting = threading.Thread(target=lambda: found.append(uav.wait_for(State.FLYING_AUTO, timeout_s=LIMIT_S)))
        waiting.start()
        uav.arm()
        uav.take_off(3.0)
        waiting.join(LIMIT_S)
        assert found == [State.FLYING_AUTO]
