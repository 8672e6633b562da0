"""Choice between the firmware's two commanders, and the setpoints of the low-level one.

Setpoints go to the low-level commander, whose silence stops the motors after 2 s. The high-level commander flies by
itself, to a place or to the ground, and needs nobody. It takes over in two steps: first it gets its goal, and only when
it has answered, the firmware is notified that setpoints stop. The other way round the motors would stop if the goal
were lost. A setpoint ends what the high-level commander does, so none is sent meanwhile.

Where no answer comes, the motors would stop. Then setpoints go on for a while, and the goal is sent again. For a hover
that no command asked for, these are the setpoints of the layers above. For a hold, a landing, and a hover because
setpoints are missing, it is one that keeps it where it is.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from ual.geometry import Pose, Vector3, wrap_angle
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.encoder import Encoder, rest
from ual_daemon.backends.crazyflie.packets import CrtpPacket
from ual_daemon.backends.crazyflie.requests import CrtpRequest, CrtpRequests
from ual_daemon.backends.values import Control, Mode, PositionSetpoint, Setpoint

HOVERS_AFTER_S = 0.5
"""Seconds at one position after which a Crazyflie hovers by itself."""
HANDOVER_TIMEOUT_S = 0.25
"""Seconds without an answer after which setpoints go on: after 0.5 s without them the firmware levels out."""
LATE_HANDOVER_S = 0.1
"""The same where setpoints have been missing for `SETPOINT_SILENCE_S` before."""
KEEP_S, KEEP_EACH_S = 0.1, 0.02
"""Seconds for which setpoints keep it where it is before the high-level commander is asked again, and their
interval.
"""
REQUEST_PERIOD_S = 0.05
"""The interval at which a command to the high-level commander is repeated."""
NOTIFICATIONS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.26, 0.32, 0.39, 0.46, 0.53, 0.6, 0.67, 0.74, 0.8)
"""The notification that setpoints stop has no answer, so it is sent several times, and then every `NOTIFY_AGAIN_S`. So
many get through also where most are lost, or a link is down for half a second. The firmware waits for 2 s.
"""
REPEATED_GOALS_COUNT = 5
"""Notifications with which a goal is sent once more. Each time its flight begins again, so not with all."""
NOTIFY_AGAIN_S = 0.2
SETPOINT_SILENCE_S = 0.3
"""Seconds without a setpoint in the air after which the high-level commander takes over, whatever the reason."""
_SETPOINT_TOLERANCE = 1e-3
"""Metres, radians and their rates: a setpoint that differs by less is the same."""
_ALREADY_LANDING_ERROR = 1


class Phase(Enum):
    """Commander that flies; the value is the mode's name."""

    SETPOINTS = "setpoints"
    HOVERING = "hover (high-level commander)"
    """Until the next setpoint."""
    HOLDING = "hold (high-level commander)"
    """Until `Commander.take_control`."""
    LANDING = "land (high-level commander)"


MODES = {
    Phase.SETPOINTS: Mode(Phase.SETPOINTS.value, Control.REFERENCES),
    Phase.HOVERING: Mode(Phase.HOVERING.value, Control.REFERENCES),
    Phase.HOLDING: Mode(Phase.HOLDING.value, Control.OTHER, is_autonomous=True),
    Phase.LANDING: Mode(Phase.LANDING.value, Control.LAND),
}


def _nothing(refusal: str) -> None:
    """A hover that was not requested ends without a word."""


@dataclass(slots=True)
class _Handover:
    """A command to the high-level commander that is on its way."""

    phase: Phase
    request: CrtpRequest
    stays: PositionSetpoint | None = None
    """Keeps it in the air while no answer comes; None: the layers above do."""
    on_ended: Callable[[str], None] = _nothing
    """Gets the refusal, or nothing once it was accepted."""
    patience_s: float = HANDOVER_TIMEOUT_S
    is_taken_back: bool = False
    requested_s: float | None = None
    requests_count: int = 0
    keep_s: float | None = None
    """Time at which the next setpoint that keeps it in the air is due; None while an answer may come."""


class Commander:
    """`send` and the commands are for any thread; `step` and `on_lost` belong to the thread that receives.

    `emit` sends a packet, and `emit_setpoint` one that is worth nothing later; both return at once.
    """

    def __init__(
        self, emit: Callable[[CrtpPacket], None], emit_setpoint: Callable[[CrtpPacket], None], *, hovers_by_itself: bool
    ) -> None:
        self.encoder = Encoder(0, {})
        self._emit = emit
        self._emit_setpoint = emit_setpoint
        self._hovers_by_itself = hovers_by_itself
        self._lock = threading.Lock()
        self._phase = Phase.SETPOINTS
        self._handover: _Handover | None = None
        self._replaced: list[CrtpRequest] = []
        """Requests of earlier handovers, which must not be sent again."""
        self._last: Setpoint | None = None
        self._still_since_s = math.inf
        self._sent_s: float | None = None
        """Time of the last setpoint of this flight."""
        self._notify_s: list[float] = []
        self._untold_count = 0
        """First notifications that are still to be sent."""
        self._again: CrtpPacket | None = None
        """A goal that is sent once more before each of the first notifications."""
        self._sending_count = 0
        """Setpoints that are being sent: a radio may block meanwhile."""
        self._landings_count = 0
        self._answered: tuple[_Handover, int] | None = None

    @property
    def mode(self) -> Mode:
        """The present mode. A hold shows once the notifications have left: UAL may end then, and silence would have let
        it fall before.
        """
        is_untold = self._phase is Phase.HOLDING and self._untold_count > 0
        return MODES[Phase.SETPOINTS if is_untold else self._phase]

    # --- From any thread ----------------------------------------------------------------------------------------------

    def send(self, setpoint: Setpoint, now_s: float, here: Vector3 | None = None) -> None:
        """Sends a setpoint, unless the high-level commander flies and the setpoint is not what ends that.

        `here` is where it is now, if that is known well.
        """
        with self._lock:
            if not self._passes(setpoint, now_s):
                return
            packet = self.encoder.encode(setpoint, here)
            self._sent_s = now_s
            self._sending_count += 1
        try:
            self._emit_setpoint(packet)
        finally:
            with self._lock:
                self._sending_count -= 1

    def _passes(self, setpoint: Setpoint, now_s: float) -> bool:
        handover = self._handover
        if self._phase in (Phase.HOLDING, Phase.LANDING) or (
            handover is not None and handover.phase is not Phase.HOVERING
        ):
            return False
        is_same = self._last is not None and _is_same(setpoint, self._last)
        if not is_same:
            self._last = setpoint
            self._still_since_s = now_s if _is_still(setpoint) else math.inf
            self._resume()
        return self._phase is Phase.SETPOINTS and self._handover is None

    def _resume(self) -> None:
        """Takes setpoints again. Called with the lock held."""
        self._replace(None)
        self._phase, self._notify_s, self._untold_count = Phase.SETPOINTS, [], 0

    def _replace(self, handover: _Handover | None) -> None:
        """Puts a handover in the place of the present one, whose request is withdrawn. Called with the lock held."""
        if self._handover is not None:
            self._replaced.append(self._handover.request)
        self._handover = handover

    def take_control(self) -> None:
        """Ends what the high-level commander does: the next setpoint is sent."""
        with self._lock:
            if self._phase is not Phase.SETPOINTS or self._handover is not None:
                self._forget()

    def hand_over(
        self, phase: Phase, request: CrtpRequest, stays: PositionSetpoint, on_ended: Callable[[str], None]
    ) -> Callable[[], None]:
        """Has the high-level commander take over. Returns what takes that back, at any time.

        `stays` is sent while no answer comes. `on_ended` gets the refusal, or nothing once it was accepted.
        """
        handover = _Handover(phase, request, stays, on_ended)
        with self._lock:
            self._replace(handover)
        return lambda: self._take_back(handover)

    def _take_back(self, handover: _Handover) -> None:
        """Takes back a handover: one that has just taken effect is undone."""
        with self._lock:
            handover.is_taken_back = True
            if self._handover is not handover and self._phase is handover.phase:
                self._forget()

    # --- From the thread that receives --------------------------------------------------------------------------------

    def step(
        self, requests: CrtpRequests, now_s: float, flying: tuple[Pose, Vector3] | None, *, touches: bool = False
    ) -> None:
        """Does what is due. `flying` are its pose and velocity while it is in the air.

        `touches` ends a landing: what it stands on is where it was to land.
        """
        is_on_ground = flying is None
        with self._lock:
            if flying is None:
                self._sent_s = None
            elif self._is_silent(now_s):
                self._last = None
                self._replace(
                    _Handover(Phase.HOVERING, self.encoder.stop(*flying), rest(*flying), patience_s=LATE_HANDOVER_S)
                )
            if is_on_ground and self._handover is None and self._phase is not Phase.SETPOINTS:
                self._forget()
            if self._is_hover_due(now_s) and not is_on_ground:
                self._begin_hover()
            self._drop_withdrawn(now_s)
            due = self._due_notification(now_s)
            if flying is not None:
                due += self._due_setpoint(now_s)
            if touches and self._phase is Phase.LANDING:  # repeated until they stand still
                due.append(packets.stop())
            handover = self._begin_to_ask(now_s)
            replaced, self._replaced = self._replaced, []
        for request in replaced:
            requests.withdraw(request)
        for packet in due:
            self._emit(packet)
        if handover is not None:
            self._ask(handover, requests, now_s)

    def _due_notification(self, now_s: float) -> list[CrtpPacket]:
        """Returns the notification that setpoints stop, if it is due. Called with the lock held."""
        if not self._notify_s or now_s < self._notify_s[0]:
            return []
        self._notify_s = self._notify_s[1:] or [now_s + NOTIFY_AGAIN_S]
        is_one_of_first = self._untold_count > len(NOTIFICATIONS) - REPEATED_GOALS_COUNT
        again = [self._again] if self._again is not None and is_one_of_first else []
        self._untold_count = max(0, self._untold_count - 1)
        return [*again, packets.setpoints_stop()]

    def _due_setpoint(self, now_s: float) -> list[CrtpPacket]:
        """Returns the setpoint that keeps it in the air while no answer comes, if it is due. Called with the lock held.

        Only if setpoints have flown it: the high-level commander that flies already does not stop the motors.
        """
        handover = self._handover
        if handover is None or handover.stays is None or self._phase is not Phase.SETPOINTS:
            return []
        if handover.requested_s is None or now_s - handover.requested_s <= handover.patience_s:
            return []
        if handover.keep_s is None:  # an answer would be to a goal that the setpoint ends
            self._replaced.append(handover.request)
            handover.keep_s = now_s
        if now_s - handover.requested_s > handover.patience_s + KEEP_S:
            handover.requested_s = handover.keep_s = None
            return []
        if now_s < handover.keep_s:
            return []
        handover.keep_s, self._sent_s = now_s + KEEP_EACH_S, now_s
        return [self.encoder.encode(handover.stays)]

    def _begin_to_ask(self, now_s: float) -> _Handover | None:
        """Returns the handover that is to be requested now. Called with the lock held.

        A setpoint that is being sent leaves first: it would end the flight of the high-level commander.
        """
        handover = self._handover
        if handover is None or handover.requested_s is not None or self._sending_count:
            return None
        handover.requested_s = now_s
        handover.requests_count += 1
        packet = handover.request.packet
        if handover.phase is Phase.LANDING:  # not to be taken for the answer to an earlier one
            self._landings_count += 1
            packet = packets.numbered_landing(packet, self._landings_count)
            handover.request = CrtpRequest(packet, packet.data[:3])
        return handover

    def on_lost(self) -> None:
        """Notes that requests which were on their way are forgotten."""
        handover = self._handover
        if handover is not None:
            handover.requested_s = None

    def on_reboot(self) -> None:
        """Notes that the firmware has booted: nobody flies."""
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        """Forgets what was sent. Called with the lock held."""
        self._last, self._still_since_s = None, math.inf
        self._resume()

    def _drop_withdrawn(self, now_s: float) -> None:
        """Drops a handover that is not wanted any more, or a hover that has no answer: setpoints must go on."""
        handover = self._handover
        if handover is None:
            return
        is_hover = handover.phase is Phase.HOVERING
        requested_s = handover.requested_s if handover.stays is None else None
        is_late = requested_s is not None and now_s - requested_s > handover.patience_s
        if not is_late and not handover.is_taken_back:
            return
        if is_hover or handover.requested_s is None:
            self._replace(None)
            self._still_since_s = now_s if is_hover else math.inf
        else:
            self._forget()  # the firmware may do it already: any setpoint ends that, also one to where it hovered

    def _is_silent(self, now_s: float) -> bool:
        """Returns whether setpoints that flew it have stopped, and nothing else flies it."""
        flies = self._phase is Phase.SETPOINTS and self._handover is None
        return flies and self._sent_s is not None and now_s - self._sent_s > SETPOINT_SILENCE_S

    def _is_hover_due(self, now_s: float) -> bool:
        return (
            self._hovers_by_itself
            and self._phase is Phase.SETPOINTS
            and self._handover is None
            and now_s - self._still_since_s >= HOVERS_AFTER_S
        )

    def _begin_hover(self) -> None:
        last = self._last
        assert isinstance(last, PositionSetpoint)
        self._replace(_Handover(Phase.HOVERING, self.encoder.stay(last.position, last.yaw_rad)))

    def _ask(self, handover: _Handover, requests: CrtpRequests, now_s: float) -> None:
        def on_answer(data: bytes) -> None:
            self._on_answer(handover, data[3] if len(data) > 3 else 0, now_s)

        requests.add(handover.request, on_answer, REQUEST_PERIOD_S)

    def _on_answer(self, handover: _Handover, error: int, now_s: float) -> None:
        is_fine = error == 0 or (handover.phase is Phase.LANDING and error == _ALREADY_LANDING_ERROR)
        with self._lock:
            if self._handover is not handover:
                return  # setpoints have come meanwhile
            if handover.is_taken_back:
                self._forget()  # the firmware does it already: any setpoint ends that
                return
            self._handover = None
            self._answered = handover, error
            if is_fine:
                self._untold_count = len(NOTIFICATIONS)
                # The answer may be a late one, to a goal that a setpoint has ended.
                self._again = handover.request.packet if handover.requests_count > 1 else None
                self._phase = handover.phase
                self._notify_s = [now_s + delay_s for delay_s in NOTIFICATIONS]
            else:
                self._still_since_s = math.inf

    @property
    def has_answered(self) -> bool:
        """Whether a handover has ended, which `finish` tells."""
        return self._answered is not None

    def finish(self) -> None:
        """Tells that a handover has ended; to be called once the snapshot with its effect is published."""
        answered, self._answered = self._answered, None
        if answered is not None:
            handover, error = answered
            is_done = self._phase is handover.phase
            handover.on_ended("" if is_done else f"the high-level commander refused (error {error})")


def _is_still(setpoint: Setpoint) -> bool:
    if not isinstance(setpoint, PositionSetpoint):
        return False
    rates = (*setpoint.velocity, *setpoint.acceleration, setpoint.yaw_rate_rad_s)
    return all(abs(each) < _SETPOINT_TOLERANCE for each in rates)


def _is_same(one: Setpoint, other: Setpoint) -> bool:
    """Returns whether both are the same place, at rest."""
    if one is other:
        return _is_still(one)
    if not (isinstance(one, PositionSetpoint) and isinstance(other, PositionSetpoint)):
        return False
    is_there = (one.position - other.position).norm() < _SETPOINT_TOLERANCE
    return (
        is_there
        and abs(wrap_angle(one.yaw_rad - other.yaw_rad)) < _SETPOINT_TOLERANCE
        and _is_still(one)
        and _is_still(other)
    )
