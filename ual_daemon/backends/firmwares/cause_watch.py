"""Finds out what took the control: the pilot, a ground station, or a failsafe and which. Pure logic."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.motor_outputs import MotorChannels, MotorOutputs
from ual_daemon.backends.firmwares.numbers import Sensor, SystemStatus, sensor_names
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import Cause, Control, ControlState, LandedState, Mode, Sample

_REFERENCES, _NOT_IN_AIR = Control.REFERENCES, (LandedState.ON_GROUND, LandedState.UNKNOWN)
"""As names of the module: Python looks up a member of an enumeration by a call, and each update would pay."""
SIGN_LEAD_S = 1.5
"""Seconds by which a sign may come before the mode that it explains. PX4's events come 10 to 20 ms before it, ArduPilot
distinguishes the positions of a switch after 0.2 s, and a heartbeat may be 1 s late.
"""
EPISODE_S = 3.0
"""Seconds before a failsafe's flight within which PX4 may have reported the trigger."""
HELD_EPISODE_S = 8.0
"""The same where it has held meanwhile in the mode that was requested: PX4 holds for 5 s first (COM_FAIL_ACT_T)."""
REASON_DELAY_S = 0.4
"""Until then the reason of a new mode may still come. ArduPilot's texts follow the heartbeat, and its SYS_STATUS comes
at 5 Hz. PX4 may report the mode in a heartbeat before it says whether it was intended."""
OWN_COMMAND_S = 5.0
"""A mode that comes this soon after a command of ours for it is ours."""
OWN_EFFECT_S = 1.0
"""Seconds after an order about its mission (start, resumption, jump) within which it may hold by itself for it."""
MISSION_END_S = 2.5
"""Seconds after the mode that follows a mission within which its end may be reported: PX4 reports it once a second."""
MISSION_REPORT_S = 0.9
"""Seconds after that mode until which a report of the mission is waited for, which says whether it has ended. PX4
reports once a second, and at once where it is asked.
"""
STREAM_S = 0.5
"""Seconds without a setpoint of ours after which a failsafe may be for that reason alone. Where it is known how long
the autopilot waits for them, it is `LOST_SETPOINTS_SHARE` of that.
"""
STATUS_S = 1.2
"""The status of a heartbeat is up to 0.8 s late."""
LOST_SETPOINTS_SHARE = 0.9
"""Setpoints come later than they were sent, one more than the other."""
COMPUTER_PAUSE_S = 2.5
"""Seconds before the first sight of its mode within which the gap may have ended: a pause of this computer hides the
mode while it lasts.
"""
_AIDING_SENSORS_MASK = int(Sensor.OPTICAL_FLOW | Sensor.VISION_POSITION)
_SUSPICIOUS_SENSORS_MASK = int(Sensor.BATTERY | Sensor.RC_RECEIVER)
_SWITCHES_FROM, _SWITCHES_TO, _MOVED_US, _NO_SIGNAL = 5, 16, 100, 65535
"""The first and the last channel that can be a switch, by how much a switch moves one, and the value of one that is not
there."""
_MOST_SIGNS = 8
MOTORS_KNOWN_S = 2.0
"""Seconds for which a lookup of the motor outputs counts."""
TEXT_AHEAD_S = 1.0
"""Seconds after a text of the switch within which a report of the outputs may be from before."""


class CauseWatch:
    """Watches what one autopilot says around its changes of mode. Belongs to the thread that receives.

    `names_intended_mode` is whether it is reported here which mode was requested of the autopilot, besides the one that
    flies: another one is then a failsafe's.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        sent: SetpointMonitor,
        *,
        names_intended_mode: bool,
        setpoints_lost_s: Callable[[], float] = lambda: math.inf,
    ) -> None:
        """`setpoints_lost_s` returns how long the autopilot waits for setpoints; infinity where that is not known."""
        self._autopilot = autopilot
        self._setpoints_lost_s = setpoints_lost_s
        self._names_intended_mode = names_intended_mode
        self._sent = sent
        self._signs: deque[tuple[float, Cause]] = deque(maxlen=_MOST_SIGNS)
        self._lasting: set[int] = set()
        """The signs of this flight that each report repeats."""
        self._mode_name = ""
        self._was_ours = self._is_ours = self._is_ours_intended = False
        """Whether the mode before, the present one, and the one that it was requested last take our setpoints."""
        self._since_s = -math.inf
        self._was_found = True
        """Whether the present mode was there before anything was known of it, or before the arming."""
        self._settled: Cause | None = None
        self._is_settled = False
        self._before_s = -math.inf
        """Time at which the mode before the present one came."""
        self._is_after_failsafe = False
        """Whether a failsafe explained the mode before."""
        self._held_s = self._held_before_s = -math.inf
        """Time of the autopilot's last own hold, and of the one before that."""
        self._explained_s = -math.inf
        """Time at which a failsafe last explained a mode: the signs until then are used up."""
        self._intention = ("", False)
        """The mode of the newest CURRENT_MODE, and whether it is another one than was requested."""
        self._episode: Cause | None = None
        self._sensors: Cause | None = None
        self._sensors_s = -math.inf
        self._healthy_once = 0
        self._is_booting, self._is_critical, self._is_terminated = True, False, False
        self._are_motors_stopped: bool | None = None
        """State of the switch that stops the motors, by the last text; None while there was none."""
        self._motor_text_s = -math.inf
        self._motors = MotorOutputs()
        self._motor_channels: MotorChannels | None = None
        self._motors_known_until_s = -math.inf
        self._critical_s = -math.inf
        self._switches: tuple[int, ...] = ()
        self._switched_s = -math.inf
        self._commanded_s: dict[str, float] = {}
        """Time of our last command of each mode, by name."""
        self._ordered_s = -math.inf
        """Time of our last order about its mission."""
        self._ended_s = -math.inf
        """Time of the last report that its mission is complete. It is repeated as long as that is so."""
        self._progress_s = -math.inf
        """Time of the last report of its mission, complete or not; minus infinity where none comes."""
        self._is_report_wanted = False
        self._was_on_mission = False
        """Whether the mode before was that of its missions."""
        self.failing_sensors = 0
        """The sensors (MAV_SYS_STATUS) that are enabled, and not healthy."""
        self.aids = ""
        """Human-readable aids that give its position without satellites, and are healthy; empty if there is none."""

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_sign(self, cause: Cause | None, now_s: float, *, lasting: int = 0) -> None:
        """Takes a sign: a text or an event that names the reason of what follows. One that lasts (`lasting` is its
        number) is repeated with what does not follow from it, so it counts once in a flight.
        """
        if cause is None or lasting in self._lasting:
            return
        if lasting:
            self._lasting.add(lasting)
        self._signs.append((now_s, cause))

    def on_own_command(self, mode: str, now_s: float) -> None:
        """Takes note of a command of ours that changes to the mode of a name."""
        self._commanded_s[mode] = now_s
        if self._autopilot.missions is not None and mode == self._autopilot.missions.mode:
            self.on_own_order(now_s)

    def on_own_order(self, now_s: float) -> None:
        """Takes note of an order of ours about its mission, which it may end at once, and then holds by itself."""
        self._ordered_s = now_s

    def on_mission_report(self, now_s: float, *, is_complete: bool) -> None:
        """Takes a report of its mission."""
        self._progress_s = now_s
        if not is_complete:
            return
        self._ended_s = now_s
        is_late = now_s - self._since_s <= MISSION_END_S
        if self._is_settled and self._settled is Cause.GROUND_STATION and is_late and self._holds_by_itself():
            self._settled = Cause.AUTOPILOT

    def on_system_status(self, status: int, now_s: float) -> None:
        """Takes the system status of a heartbeat."""
        is_critical = status >= SystemStatus.CRITICAL
        if is_critical and not self._is_critical:
            self._critical_s = now_s
        self._is_critical = is_critical
        self._is_booting = status == SystemStatus.BOOT
        self._is_terminated = status == SystemStatus.FLIGHT_TERMINATION
        if self._is_booting:
            self._are_motors_stopped = None

    def on_text(self, text: str, now_s: float) -> None:
        """Takes a text of the autopilot."""
        self.on_sign(self._autopilot.cause_of_text(text), now_s)
        are_stopped = self._autopilot.motor_stop_of_text(text)
        if are_stopped is not None:
            self._are_motors_stopped, self._motor_text_s = are_stopped, now_s

    def on_outputs(
        self,
        pulses_us: Sequence[int],
        parameters: Mapping[str, float],
        armed: Sample[bool] | None,
        landed: Sample[LandedState] | None,
        now_s: float,
    ) -> None:
        """Takes the pulses that it puts out, in microseconds. They count where it is armed and in the air by now: those
        from before a pause of this computer may be from the ground.
        """
        if armed is None or not armed.value or not _is_in_air(landed):
            self._motors.forget()
            return
        if now_s >= self._motors_known_until_s:  # it costs more than the rest
            self._motors_known_until_s = now_s + MOTORS_KNOWN_S
            self._motor_channels = self._autopilot.motor_channels(parameters)
        self._motors.on_pulses(pulses_us, self._motor_channels, now_s)

    def on_intention(self, custom_mode: int, intended_custom_mode: int, now_s: float) -> None:
        """Takes the number of the mode, and of the one that the autopilot was requested (0: it does not say)."""
        is_unintended = bool(intended_custom_mode) and intended_custom_mode != custom_mode
        self._intention = (self._autopilot.mode(custom_mode).name, is_unintended)
        self._is_ours_intended = self._autopilot.mode(intended_custom_mode).control is _REFERENCES
        if not is_unintended:
            self._episode = None
        elif self._episode is None:
            since_s = self._before_s if self._intention[0] == self._mode_name else self._since_s
            held = self._sign_since(now_s - HELD_EPISODE_S, after_s=max(self._explained_s, since_s))
            self._episode = self._sign_since(now_s - EPISODE_S) or held

    def on_sensors(self, enabled: int, healthy: int, now_s: float) -> None:
        """Takes which sensors are enabled and which are healthy (bits of MAV_SYS_STATUS_SENSOR)."""
        self.failing_sensors = enabled & ~healthy
        aids = enabled & healthy & _AIDING_SENSORS_MASK
        self.aids = ", ".join(sensor_names(aids)) if aids else ""
        self._healthy_once |= enabled & healthy
        found = self._autopilot.failsafe_of_sensors(self.failing_sensors, self._healthy_once)
        if self._is_booting:  # ArduPilot's battery is not healthy before it was measured first
            found = None
        if found is not None and found is not self._sensors:
            self._sensors_s = now_s
        self._sensors = found

    def on_rc_channels(self, channels: Sequence[int], now_s: float) -> None:
        """Takes the channels of the transmitter in microseconds, for its switches."""
        switches = tuple(channels[_SWITCHES_FROM - 1 : _SWITCHES_TO])
        pairs = zip(switches, self._switches, strict=False)
        if any(abs(new - old) >= _MOVED_US and _NO_SIGNAL not in (new, old) for new, old in pairs):
            self._switched_s = now_s
        self._switches = switches

    def take_report_request(self) -> bool:
        """Returns whether to request a report of its mission, once for each mode that may follow from its end."""
        is_wanted, self._is_report_wanted = self._is_report_wanted, False
        return is_wanted

    # --- What follows from it -----------------------------------------------------------------------------------------

    def control_state(
        self,
        armed: Sample[bool] | None,
        landed: Sample[LandedState] | None,
        mode: Sample[Mode] | None,
        other_sender: str,
        now_s: float,
    ) -> ControlState:
        """Returns what flies it. All at once: a value that is replaced afterwards copies its group, at each update."""
        is_armed = None if armed is None else armed.value
        held_by = None if mode is None else self.held_by(mode.value, now_s, is_armed=is_armed)
        return ControlState(
            armed,
            landed,
            mode,
            failsafe=self.failsafe(now_s, is_armed=is_armed, is_in_air=_is_in_air(landed)),
            held_by=held_by,
            other_sender=other_sender,
            is_of_command=held_by is None and self._is_settled,
        )

    def failsafe(self, now_s: float, *, is_armed: bool | None, is_in_air: bool = False) -> Cause | None:
        """Returns the failsafe that is active, whatever the mode; None if none is, or while it has no name yet.

        `is_in_air` is whether it takes itself to be there. On the ground motors stand also where nothing stops them.
        """
        if self._is_terminated or self._has_stopped_motors(now_s, may_turn=bool(is_armed) and is_in_air):
            return Cause.TERMINATION
        if is_armed and self._is_unintended:
            return self._episode
        return self._sensors

    def _has_stopped_motors(self, now_s: float, *, may_turn: bool) -> bool:
        """Returns whether a switch stops them, by its text or by the outputs, which tell more: a text may be lost."""
        if not self._are_motors_stopped:
            return may_turn and bool(self._motors.stand(now_s))
        return not self._motors.turn_since(self._motor_text_s + TEXT_AHEAD_S)

    def held_by(self, mode: Mode, now_s: float, *, is_armed: bool | None) -> Cause | None:
        """Returns what holds the control in the present mode.

        None in the mode that takes setpoints, before the arming, and where it is not known how the mode came.
        `is_armed` is None while that is not known, as just after a pause of this computer: that is no disarming.
        """
        if mode.name != self._mode_name:
            self._begin_mode(mode, now_s)
        if is_armed is None:
            return None
        if not is_armed:
            self._was_found, self._is_settled = True, False
            self._lasting.clear()
            return None
        if mode.control is _REFERENCES:
            return None
        if mode.name == self._autopilot.termination_mode:
            return Cause.TERMINATION
        if not self._is_settled:
            found = self._find(mode, now_s)
            if found is Cause.OPEN or self._was_found:  # of a mode that was found, a failsafe may yet become known
                return found
            self._settle(found, now_s)
        return self._settled

    def _settle(self, cause: Cause | None, now_s: float) -> None:
        self._settled, self._is_settled = cause, True
        if cause is not None and cause.is_failsafe:
            self._explained_s = now_s

    def _begin_mode(self, mode: Mode, now_s: float) -> None:
        self._was_found = not self._mode_name
        self._before_s, self._is_after_failsafe = self._since_s, self._explained_s >= self._since_s > -math.inf
        missions = self._autopilot.missions
        self._was_on_mission = missions is not None and self._mode_name == missions.mode
        self._mode_name, self._since_s, self._is_settled = mode.name, now_s, False
        if mode.name == self._autopilot.hold_mode:
            self._held_s, self._held_before_s = now_s, self._held_s
        self._was_ours, self._is_ours = self._is_ours, mode.control is _REFERENCES
        self._is_report_wanted = self._may_be_done

    @property
    def _is_in_done_mode(self) -> bool:
        """Whether it is in the mode that follows its missions, and not in that of the missions themselves."""
        missions = self._autopilot.missions
        return missions is not None and self._mode_name == missions.done_mode != missions.mode

    @property
    def _may_be_done(self) -> bool:
        """Whether its mission may have ended just now."""
        return self._was_on_mission and self._is_in_done_mode

    @property
    def _is_unintended(self) -> bool | None:
        """Whether a failsafe flies: the mode is not the intended one. None while that is not known of this mode."""
        name, is_unintended = self._intention
        return is_unintended if name == self._mode_name else None

    def _find(self, mode: Mode, now_s: float) -> Cause | None:
        """Returns the cause of the present mode; OPEN while what tells it may still come."""
        # After a pause PX4 may have fallen back to a pilot's mode by itself. Without the intended mode, only the status
        # of a heartbeat tells.
        is_status_awaited = not self._names_intended_mode and self._has_paused
        is_over = now_s - self._since_s > (STATUS_S if is_status_awaited else REASON_DELAY_S)
        if self._names_intended_mode and self._is_unintended is None and not is_over:
            # A heartbeat may tell the mode first. The signs alone may be of a failsafe before it: PX4 reports a breach
            # of its fence again with each mode that a ground station selects.
            return Cause.OPEN
        if self._is_unintended is not False:
            failsafe = self._failsafe_that_flies(mode, is_over=is_over)
            if failsafe is not None or self._is_unintended:
                return failsafe or Cause.OPEN
        if self._was_found:
            return None
        is_intention_open = is_status_awaited if not self._names_intended_mode else self._is_unintended is None
        if mode.name in self._autopilot.pilots_modes and not is_intention_open:
            return Cause.SAFETY_PILOT
        if not is_over:
            return Cause.OPEN
        if mode.name in self._autopilot.pilots_modes:
            return Cause.SAFETY_PILOT
        found = self._other_than_failsafe()
        if found is Cause.GROUND_STATION and self._may_be_done and self._awaits_report(now_s):
            return Cause.OPEN
        return found

    def _awaits_report(self, now_s: float) -> bool:
        """Returns whether reports of its mission come, and none has since the present mode."""
        is_due = now_s <= self._since_s + MISSION_REPORT_S
        return is_due and -math.inf < self._progress_s < self._since_s

    def _other_than_failsafe(self) -> Cause | None:
        is_switched = self._switched_s >= self._since_s - SIGN_LEAD_S
        commanded_s = self._commanded_s.get(self._mode_name, -math.inf)
        newest_s = max(self._commanded_s.values(), default=-math.inf)
        # A switch that moves after a newer command of ours, for another mode, has not waited for the one before.
        is_back = is_switched and commanded_s < newest_s < self._switched_s
        # A hold that we asked for has come, and ended: this one is another.
        is_again = self._mode_name == self._autopilot.hold_mode and commanded_s < self._held_before_s
        if self._since_s - commanded_s < OWN_COMMAND_S and not is_back and not is_again:
            return None
        if is_switched:
            return Cause.SAFETY_PILOT
        return Cause.AUTOPILOT if self._holds_by_itself() else Cause.GROUND_STATION

    def _holds_by_itself(self) -> bool:
        """Returns whether it is in the mode that follows its missions: as one is complete, or just after an order of
        ours about one.
        """
        is_ordered = 0.0 <= self._since_s - self._ordered_s < OWN_EFFECT_S
        is_complete = self._was_on_mission and self._ended_s >= self._since_s - SIGN_LEAD_S
        return self._is_in_done_mode and (is_ordered or is_complete)

    def _failsafe_that_flies(self, mode: Mode, *, is_over: bool) -> Cause | None:
        """Returns the failsafe by which the present mode came; None if there is no sign of one (yet)."""
        begin_s = self._since_s - SIGN_LEAD_S
        if self._is_unintended:
            if self._episode is None and is_over:
                self._episode = self._unnamed()
            return self._episode
        is_pilots = mode.name in self._autopilot.pilots_modes
        unused_s = max(self._explained_s, self._before_s if is_pilots else -math.inf)
        sign = self._sign_since(begin_s, after_s=unused_s)
        if sign is not None:
            return sign
        if is_pilots and self._is_after_failsafe:  # its pilot ended the failsafe, whatever still shows of it
            return None
        if self._sensors is not None and self._sensors_s >= begin_s:
            return self._sensors
        was_critical = self._is_critical and self._critical_s >= begin_s
        return self._unnamed() if was_critical and (is_over or self._has_paused) else None

    def _unnamed(self) -> Cause:
        """Returns the cause of a failsafe without a report: setpoints, where none of ours came before it."""
        is_ill = self.failing_sensors & self._healthy_once & _SUSPICIOUS_SENSORS_MASK
        are_missing = self._has_paused or self._mode_name == self._autopilot.fallback_mode
        return Cause.SETPOINTS if are_missing and not is_ill else Cause.FAILSAFE

    @property
    def _has_paused(self) -> bool:
        """Whether no setpoint of ours came in its mode for them, for longer than it waits for one, before the present
        mode.
        """
        needed_ours = self._is_ours_intended if self._is_unintended else self._was_ours
        if self._autopilot.stays_without_setpoints or not needed_ours:
            return False
        gap_s = self._sent.longest_gap_s(self._since_s - COMPUTER_PAUSE_S, self._since_s)
        return gap_s >= min(STREAM_S, LOST_SETPOINTS_SHARE * self._setpoints_lost_s())

    def _sign_since(self, begin_s: float, after_s: float = -math.inf) -> Cause | None:
        """Returns the newest sign since a time, and after another; missing setpoints only where nothing else shows."""
        causes = [cause for time_s, cause in self._signs if time_s >= begin_s and time_s > after_s]
        others = [cause for cause in causes if cause is not Cause.SETPOINTS]
        return (others or causes or [None])[-1]


def _is_in_air(landed: Sample[LandedState] | None) -> bool:
    return landed is not None and landed.value not in _NOT_IN_AIR
