"""Flies one UAV again and again, with all commands."""

from __future__ import annotations

import math
import random
import threading
import time
from collections.abc import Callable

import ual
from benchmarks.soak.tally import Tally
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Transform, Twist, Vector3
from ual.types import State

_LIMIT_S = 60.0
_HEIGHT_M = 3.0
_AREA_M = 4.0
_PAUSE_S = 0.5
_SETPOINT_PERIOD_S = 0.04
_FRAME = "soak"


class SoakPilot:
    """Flies until it is stopped, with a new client for each flight. What goes wrong is counted, and it goes on."""

    def __init__(self, address: str, tally: Tally, seed: int, stopped: threading.Event) -> None:
        self._address = address
        self._tally = tally
        self._random = random.Random(seed)
        self._stopped = stopped

    def run(self) -> None:
        while not self._stopped.wait(_PAUSE_S):
            with ual.Uav(address=self._address) as uav:
                self._tally.attempt("flight", lambda uav=uav: self._fly(uav))  # type: ignore[misc]

    def _fly(self, uav: ual.Uav) -> None:
        self._get_ready(uav)
        if uav.state() is not State.FLYING_AUTO:
            for _ in uav.take_off(_HEIGHT_M, blocking=False).watch(rate_hz=5.0):
                pass
        motions: list[Callable[[ual.Uav], object]] = [
            self._go_to,
            self._go_to_and_cancel,
            self._go_to_and_lose_patience,
            self._go_to_in_frame,
            self._stream_velocity,
            self._stream_pose,
            self._follow_path,
            self._replace,
            self._plan,
        ]
        self._random.shuffle(motions)
        for motion in motions:
            if self._stopped.is_set():
                break
            self._tally.attempt(motion.__name__.strip("_"), lambda motion=motion: motion(uav))  # type: ignore[misc]
        uav.land(timeout_s=_LIMIT_S)
        uav.wait_for(State.LANDED_DISARMED, timeout_s=_LIMIT_S)
        uav.set_home()

    def _get_ready(self, uav: ual.Uav) -> None:
        """Brings it into a state in which a flight can begin, whatever happened before."""
        state = uav.wait_for(
            State.LANDED_DISARMED, State.LANDED_ARMED, State.FLYING_AUTO, State.FLYING_MANUAL, timeout_s=_LIMIT_S
        )
        if state is State.LANDED_DISARMED:
            uav.arm(timeout_s=_LIMIT_S)
            uav.wait_for(State.LANDED_ARMED, timeout_s=_LIMIT_S)
        elif state is State.FLYING_MANUAL:
            uav.recover_from_manual(timeout_s=_LIMIT_S)

    def _pose(self) -> Pose:
        east_m, north_m = (self._random.uniform(-_AREA_M, _AREA_M) for _ in range(2))
        return Pose.at(east_m, north_m, _HEIGHT_M + self._random.uniform(-0.5, 1.0))

    def _go_to(self, uav: ual.Uav) -> None:
        uav.go_to_waypoint(self._pose(), timeout_s=_LIMIT_S)

    def _go_to_and_cancel(self, uav: ual.Uav) -> None:
        task = uav.go_to_waypoint(self._pose(), blocking=False)
        self._stopped.wait(0.3)
        task.cancel()
        uav.task(task.id).info()

    def _go_to_and_lose_patience(self, uav: ual.Uav) -> None:
        try:
            uav.go_to_waypoint(self._pose(), timeout_s=0.5)
        except UalError as error:
            self._tally.add(f"lost patience: {error.reason}")

    def _go_to_in_frame(self, uav: ual.Uav) -> None:
        frame = f"{uav.ns}/{_FRAME}_{self._random.randrange(1000)}"
        where = Vector3(self._random.uniform(-1.0, 1.0), 0.5, 0.0)
        uav.add_frame(Transform(where, frame_id=f"{uav.ns}/odom", child_frame_id=frame))
        try:
            uav.go_to_waypoint(PoseStamped(self._pose(), frame), timeout_s=_LIMIT_S)
            uav.transform(frame)
        finally:
            uav.remove_frame(frame)

    def _stream_velocity(self, uav: ual.Uav) -> None:
        direction_rad = self._random.uniform(-math.pi, math.pi)
        for _ in range(25):
            uav.set_velocity(Twist(Vector3(0.5 * math.cos(direction_rad), 0.5 * math.sin(direction_rad), 0.0)))
            time.sleep(_SETPOINT_PERIOD_S)
        uav.abort(freeze=self._random.random() < 0.5)

    def _stream_pose(self, uav: ual.Uav) -> None:
        here = uav.pose().pose
        for _ in range(15):
            uav.set_pose(here)
            time.sleep(_SETPOINT_PERIOD_S)

    def _follow_path(self, uav: ual.Uav) -> None:
        waypoints = [self._pose() for _ in range(self._random.choice((2, 5, 12)))]
        task = uav.follow_path(waypoints, corner_radius_m=0.5, blocking=False)
        self._stopped.wait(3.0)
        task.info()
        uav.abort()

    def _replace(self, uav: ual.Uav) -> None:
        task = uav.follow_path([self._pose() for _ in range(3)], blocking=False)
        other = uav.go_to_waypoint(self._pose(), blocking=False)
        try:
            task.wait(_LIMIT_S)
        except UalError as error:
            self._tally.add(f"replaced: {error.reason}")
        other.wait(_LIMIT_S)

    def _plan(self, uav: ual.Uav) -> None:
        uav.dry_run.go_to_waypoint(self._pose())
        uav.dry_run.follow_path([self._pose() for _ in range(200)], corner_radius_m=0.3)
