"""Control authority over the aircraft, for dji_osdk_ros: that wrapper does not publish it."""

from __future__ import annotations

from ual_daemon.backends.dji import modes

_MODE_CHANGE_S = 0.4
"""An aircraft that follows setpoints shows SDK_CONTROL within this time, and one that takes off AUTO_TAKEOFF."""


class DjiAuthority:
    """Control authority by the aircraft's display mode and the grants to UAL.

    SDK_CONTROL shows while it follows an SDK. After a take-off it shows P_GPS until the first setpoint comes, also with
    authority. So authority that was granted counts then, until a setpoint shows no effect or another mode shows. A
    landing ends it, and so does a lift-off that is not the built-in one: that is the pilot's.
    """

    def __init__(self) -> None:
        self._is_granted = self._has_followed = False
        self._sent_s: float | None = None
        self._is_in_air = self._idles = False
        self._lifted_s: float | None = None
        self._idle_followed_s: float | None = None
        """Time at which it last showed that it follows an SDK on the ground, with its motors running."""
        self._is_taking_off = False
        self.why_lost = ""
        """Human-readable sign that another program flies the aircraft since authority was granted; empty: there was
        none.
        """
        self._is_doubted = False
        """Whether that is only so because the first setpoints showed no effect yet."""

    def grant(self, *, is_granted: bool) -> None:
        """Notes the answer of the wrapper to our request, or our release."""
        self._is_granted, self._has_followed, self._sent_s = is_granted, False, None
        if is_granted:
            self.why_lost = ""

    def forget(self) -> None:
        """Forgets what was granted: the pilot may have taken over unseen. An aircraft that follows an SDK shows it."""
        self._is_granted = self._has_followed = self._is_taking_off = False
        self._sent_s = self._lifted_s = self._idle_followed_s = None

    def note_silence(self) -> None:
        """Notes that nothing was received for a moment. In the air the pilot may have taken over: with authority that
        has not shown yet, P_GPS looks the same.
        """
        if self._is_in_air and not self._has_followed and not self._is_taking_off:
            self._is_granted = False

    def note_setpoint(self, now_s: float) -> None:
        """Notes that a setpoint was sent."""
        if self._sent_s is None:
            self._sent_s = now_s

    def note_status(self, flight_status: int, now_s: float) -> None:
        """Takes whether it flies. The mode of a lift-off may come a little later than this."""
        was_in_air, self._is_in_air = self._is_in_air, flight_status == modes.IN_AIR
        self._idles = flight_status == modes.ON_GROUND
        if was_in_air and not self._is_in_air:
            self._is_granted = False
        if self._is_in_air and not was_in_air:
            self._lifted_s = now_s

    def observe(self, display_mode: int, height_m: float | None, now_s: float) -> bool:
        """Takes the display mode and the height above the take-off. Returns whether it follows an SDK, or would."""
        self._watch_ground(display_mode, now_s)
        was_taking_off, self._is_taking_off = self._is_taking_off, display_mode in modes.TAKING_OFF
        if display_mode in modes.TAKING_OFF or display_mode == modes.SDK_CONTROL:
            self._lifted_s = None
        elif self._lifted_s is not None and now_s - self._lifted_s > _MODE_CHANGE_S:
            self._lose(display_mode)
            self._lifted_s = None
        if display_mode == modes.SDK_CONTROL:
            self._has_followed = True
            if self._is_doubted:
                self.why_lost, self._is_doubted = "", False
            return True
        is_ignored = self._sent_s is not None and now_s - self._sent_s > _MODE_CHANGE_S
        is_waiting = display_mode in (modes.P_GPS, modes.ENGINE_START) or display_mode in modes.TAKING_OFF
        is_cut_short = was_taking_off and height_m is not None and height_m < _TAKE_OFF_HEIGHT_M
        if display_mode in modes.TAKING_OFF:  # P_GPS comes after it, whatever showed on the ground
            self._sent_s, self._has_followed = None, False
        elif self._has_followed or is_ignored or is_cut_short or not is_waiting:
            is_late = not (self.why_lost or self._has_followed or is_cut_short) and is_waiting
            self._lose(display_mode)
            self._is_doubted = (self._is_doubted or is_late) and is_waiting
        return self._is_granted

    def _watch_ground(self, display_mode: int, now_s: float) -> None:
        """Notes the controller that the aircraft obeyed on the ground. Motors that stop end it, too, which shows a
        moment later.
        """
        if not self._idles:
            self._idle_followed_s = None
        elif display_mode == modes.SDK_CONTROL:
            self._idle_followed_s = now_s
        elif self._idle_followed_s is not None and now_s - self._idle_followed_s > _MODE_CHANGE_S:
            self._idle_followed_s = None
            self.why_lost = self.why_lost or f"its mode became {modes.name(display_mode)} on the ground"

    def _lose(self, display_mode: int) -> None:
        """Notes that authority is not ours. A landing, which ends it, too, does not show another one."""
        self._is_granted = False
        if self._is_in_air and display_mode not in modes.LANDING:
            self.why_lost = self.why_lost or f"its mode was {modes.name(display_mode)} in the air"


class Holding:
    """Whether authority was requested here, and was not seen lost since: the end of the daemon then releases it."""

    def __init__(self) -> None:
        self.is_held = self.is_granted = False
        self.requested_s = 0.0
        self._was_shown = False

    def ask(self, now_s: float) -> None:
        """Notes that it is requested. Without an answer it counts as obtained."""
        self.is_held, self.is_granted, self._was_shown, self.requested_s = True, False, False, now_s

    def drop(self) -> None:
        """Notes that it is not ours: refused, released or lost."""
        self.is_held = self.is_granted = False

    def observe(self, now_s: float, *, is_ours: bool) -> None:
        """Takes the present holder. A report from before the request may come a little after it."""
        if is_ours:
            self._was_shown = True
        elif self._was_shown or now_s - self.requested_s > _AUTHORITY_NEWS_S:
            self.drop()


_TAKE_OFF_HEIGHT_M = 1.1
"""The built-in take-off ends at 1.2 m. One that ends lower was ended by the pilot."""
_AUTHORITY_NEWS_S = 2.5
"""Authority that was granted shows within this time, also where it is published once a second."""
