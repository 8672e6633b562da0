"""Flies the chosen UAV by sticks and actions. The same for every device."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from ual.geometry import Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from ual.types import Limits, State, Telemetry
from ual_tools.teleop.actions import Action
from ual_tools.teleop.speeds import FIRST_SPEED_LEVEL, LEVELS, SpeedLevel
from ual_tools.teleop.stepper import Stepper
from ual_tools.teleop.sticks import CENTRED, Sticks
from ual_tools.teleop.vehicle import ScreenMessage, TeleopVehicle

TELEMETRY_AGE_LIMIT_S = 1.0
"""With telemetry that is older than this, nobody sees what the UAV does: the sticks do nothing."""
BRAKING_TIME_S = 0.3
"""Seconds after the release for which a velocity of zero is sent, and then nothing."""
OWN_MOTION_S = 1.0
"""Seconds without a velocity after which the daemon has ended it: the next flight is another's."""
LEAD_M = 3.0
"""In the pose mode, the reference waits for a UAV that is farther behind."""
_SAME_POSITION_M = 0.05
_REPORT_DELAY_S = 0.5
"""A reference is in the telemetry after this time."""
_HALT_S = 1.0
_TASKS = ("take-off", "land")


class StickMode(Enum):
    """Motion that the sticks command."""

    VELOCITY = "velocity"
    POSE = "pose"


@dataclass(frozen=True, slots=True)
class View:
    """Content of the screen at one moment."""

    name: str
    telemetry: Telemetry | None
    age_s: float
    mode: StickMode
    level: int
    speeds: SpeedLevel
    is_headless: bool
    sticks: Sticks
    done: ScreenMessage
    refusal: ScreenMessage
    number: int = 1
    count: int = 1
    now_s: float = 0.0


class Pilot:
    """Flies one of the UAVs. Sends nothing until something is touched. Used from one thread; no member blocks but those
    that stop, which have a time limit.

    Args:
        vehicles: The UAVs, opened.
        height_m: Of a take-off, in metres.
        clock: The time, in seconds from anywhere.

    """

    def __init__(
        self, vehicles: Sequence[TeleopVehicle], height_m: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.mode = StickMode.VELOCITY
        self.level = FIRST_SPEED_LEVEL
        self.is_headless = False
        self.has_quit = False
        self._vehicles = vehicles
        self._chosen = 0
        self._height_m = height_m
        self._clock = clock
        self._sticks = CENTRED
        self._is_latched = False
        self._moved_s = -math.inf
        self._reference: tuple[PoseStamped, float] | None = None
        self._stepper = Stepper()

    @property
    def vehicle(self) -> TeleopVehicle:
        """The UAV that is flown."""
        return self._vehicles[self._chosen]

    @property
    def speeds(self) -> SpeedLevel:
        """The speed level within the limits of the UAV."""
        info = self.vehicle.info
        return LEVELS[self.level].within(Limits() if info is None else info.limits)

    def view(self) -> View:
        """Returns what there is to see now."""
        vehicle = self.vehicle
        return View(
            name=vehicle.name,
            telemetry=vehicle.telemetry,
            age_s=vehicle.age_s(),
            mode=self.mode,
            level=self.level,
            speeds=self.speeds,
            is_headless=self.is_headless,
            sticks=self._sticks,
            done=vehicle.done,
            refusal=vehicle.refusal,
            number=self._chosen + 1,
            count=len(self._vehicles),
            now_s=self._clock(),
        )

    # --- Sticks -------------------------------------------------------------------------------------------------------

    def steer(self, sticks: Sticks) -> None:
        """Flies as the sticks say. To be called 20 times a second: without it, the daemon stops the UAV.

        In the pose mode a deflection makes a step, and another one each half second. After a stop, a refusal, or a
        loss of telemetry, the sticks do nothing until they were centred once.
        """
        sticks = self._admitted(sticks)
        self._sticks = sticks
        if self.mode is StickMode.POSE:
            self._step(self._stepper.steps(sticks, self._clock()))
        else:
            self._fly(sticks)

    def step(self, direction: Sticks) -> None:
        """Moves the reference by one step along each axis that is not 0. Only in the pose mode.

        For a device whose presses are steps (a keyboard), instead of `steer`.
        """
        assert self.mode is StickMode.POSE
        if self.vehicle.was_refused():
            self._reference = None
        if not self._is_blind(direction):
            self._step(direction)

    def release(self, why: str) -> None:
        """Stops what the sticks fly. They do nothing until they were centred once."""
        self.vehicle.refuse(why)
        self._drop_sticks()

    def _admitted(self, sticks: Sticks) -> Sticks:
        if self.vehicle.was_refused():
            self._latch()
        if sticks.is_centred():
            self._is_latched = False
        elif not self._is_latched:
            self._is_latched = self._is_blind(sticks)
        return CENTRED if self._is_latched else sticks

    def _is_blind(self, sticks: Sticks) -> bool:
        """Returns whether nobody sees what the UAV does; says so if the sticks are moved."""
        is_known = self.vehicle.telemetry is not None and self.vehicle.info is not None
        is_blind = self.vehicle.age_s() > TELEMETRY_AGE_LIMIT_S or not is_known
        if is_blind and not sticks.is_centred():
            self.vehicle.refuse(f"sticks: no telemetry for {self.vehicle.age_s():.0f} s: they do nothing")
        return is_blind

    def _latch(self) -> None:
        """Makes the sticks do nothing until they were centred. Sends nothing more, not even a stop."""
        self._is_latched = True
        self._moved_s, self._reference = -math.inf, None

    def _fly(self, sticks: Sticks) -> None:
        now_s = self._clock()
        if not sticks.is_centred():
            self._moved_s = now_s
            self.vehicle.send(self._velocity(self.speeds.twist(sticks)))
        elif now_s - self._moved_s < BRAKING_TIME_S:
            self.vehicle.send(self._velocity(Twist()))

    def _velocity(self, twist: Twist) -> TwistStamped:
        if self.is_headless:
            return TwistStamped(Twist(_north_up(twist.linear), twist.angular))
        return TwistStamped(twist, f"{self.vehicle.name}/base_link")

    def _step(self, direction: Sticks) -> None:
        telemetry = self.vehicle.telemetry
        if direction.is_centred():
            return
        if telemetry is None or telemetry.pose is None:
            self.vehicle.refuse("sticks: the pose is not known")
            return
        before = self._present_reference(telemetry, telemetry.pose)
        if (before.pose.position - telemetry.pose.position).norm() > LEAD_M:
            self.vehicle.refuse(f"sticks: the UAV is more than {LEAD_M:g} m behind the last step")
            return
        self._reference = self._moved(before, direction), self._clock()
        self.vehicle.send(self._reference[0])

    def _moved(self, before: PoseStamped, direction: Sticks) -> PoseStamped:
        step, turn_rad = self.speeds.step(direction)
        yaw_rad = before.pose.yaw_rad
        step = _north_up(step) if self.is_headless else Quaternion.from_yaw(yaw_rad).rotate(step)
        goal = Pose(before.pose.position + step, Quaternion.from_yaw(yaw_rad + turn_rad))
        return PoseStamped(goal, before.frame_id)

    def _present_reference(self, telemetry: Telemetry, pose: Pose) -> PoseStamped:
        """Returns what the next step begins at: the last reference while it holds, else where the UAV is."""
        if self._reference is not None and self._is_reference_ours(telemetry):
            return self._reference[0]
        return PoseStamped(pose, telemetry.frame_id)

    def _is_reference_ours(self, telemetry: Telemetry) -> bool:
        if self._reference is None:
            return False
        reference, sent_s = self._reference
        if self._clock() - sent_s < _REPORT_DELAY_S:
            return True
        reported = None if telemetry.task is not None else telemetry.reference_pose
        return reported is not None and (reported.position - reference.pose.position).norm() < _SAME_POSITION_M

    # --- Actions ------------------------------------------------------------------------------------------------------

    def act(self, action: Action) -> None:
        """Does what a key or button requests. How it ended is shown later."""
        height_m = self._height_m
        match action:
            case Action.TAKE_OFF:
                self._command("take-off", lambda uav: uav.take_off(height_m), f"taking off to {height_m:g} m")
            case Action.LAND:
                self._command("land", lambda uav: uav.land(), "landing")
            case Action.STOP | Action.ABORT:
                self._command(action.value, lambda uav: uav.abort())
            case Action.RECOVER:
                self._command("recover", lambda uav: uav.recover_from_manual(), "recovering")
            case Action.ARM:
                self._command("arm", lambda uav: uav.arm(), "arming")
            case Action.FASTER | Action.SLOWER:
                change = 1 if action is Action.FASTER else -1
                self.level = min(len(LEVELS) - 1, max(0, self.level + change))
            case Action.HEADLESS | Action.MODE:
                self._change_meaning(action)
            case Action.NEXT_UAV | Action.PREVIOUS_UAV:
                self._choose(self._chosen + (1 if action is Action.NEXT_UAV else -1))
            case Action.QUIT:
                self.has_quit = True

    def _command(self, name: str, call: Callable[..., object], begins: str = "") -> None:
        self._drop_sticks()
        self._moved_s, self._reference = -math.inf, None
        self.vehicle.command(name, call, begins=begins)

    def _change_meaning(self, action: Action) -> None:
        """Changes what the sticks mean. One that is held must not fly the other way all at once."""
        self._drop_sticks()
        if action is Action.HEADLESS:
            self.is_headless = not self.is_headless
            return
        self.mode = StickMode.POSE if self.mode is StickMode.VELOCITY else StickMode.VELOCITY
        if self._is_moving():
            self.vehicle.send(self._velocity(Twist()))
        self._reference = None

    def _choose(self, number: int) -> None:
        if len(self._vehicles) == 1:
            return
        self._drop_sticks()
        if self._is_moving():
            self.vehicle.command("stop", lambda uav: uav.abort())
        self._moved_s, self._reference = -math.inf, None
        self._chosen = number % len(self._vehicles)

    def _drop_sticks(self) -> None:
        self._sticks, self._is_latched = CENTRED, True

    # --- The end ------------------------------------------------------------------------------------------------------

    def stop(self) -> str:
        """Stops what the sticks fly, at once. Returns what became of the UAV; empty if they flew nothing.

        A task is not stopped: a take-off or a landing is safer when it ends.
        """
        is_moving = self._is_moving()
        self._drop_sticks()
        self._moved_s, self._reference = -math.inf, None
        stopped = [self._halted()] if is_moving else []
        going_on = [
            f"{each.name}: {name} goes on" for each in self._vehicles for name in each.running() if name in _TASKS
        ]
        return "; ".join(stopped + going_on)

    def _halted(self) -> str:
        if self.vehicle.halt(_HALT_S):
            return f"{self.vehicle.name} stops and holds its position"
        return f"{self.vehicle.name} did not confirm the stop: without new velocities it stops by itself after 0.5 s"

    def _is_moving(self) -> bool:
        """Returns whether the UAV flies what the sticks said."""
        if self._clock() - self._moved_s < OWN_MOTION_S:
            return True
        telemetry = self.vehicle.telemetry
        return (
            telemetry is not None
            and telemetry.state is State.FLYING_AUTO
            and self._reference is not None
            and self._is_reference_ours(telemetry)
        )


def _north_up(v: Vector3) -> Vector3:
    """Returns a vector ahead and to the left along east and north: ahead is north."""
    return Vector3(-v.y, v.x, v.z)
