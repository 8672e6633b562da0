"""Who controls the aircraft, for dji_osdk_ros: that wrapper does not publish it."""

from __future__ import annotations

from ual_daemon.backends.dji import modes

_FOLLOWS_S = 0.4
"""An aircraft that follows setpoints shows SDK_CONTROL within this time, and one that takes off AUTO_TAKEOFF."""


class Authority:
    """What the aircraft's display mode says, and whether authority was granted to us.

    SDK_CONTROL shows while it follows an SDK. After a take-off it shows P_GPS until the first setpoint comes, also with
    authority: so authority that was granted counts then, until a setpoint shows no effect or another mode shows. A
    landing ends it, and so does a lift-off that is not the built-in one: that is the pilot's.
    """

    def __init__(self) -> None:
        self._is_granted = self._has_followed = False
        self._sent_s: float | None = None
        self._is_in_air = False
        self._lifted_s: float | None = None

    def grant(self, *, is_granted: bool) -> None:
        """Notes the answer of the wrapper to our request, or our release."""
        self._is_granted, self._has_followed, self._sent_s = is_granted, False, None

    def note_setpoint(self, now_s: float) -> None:
        """Notes that a setpoint was sent."""
        if self._sent_s is None:
            self._sent_s = now_s

    def note_status(self, flight_status: int, now_s: float) -> None:
        """Takes whether it flies. The mode of a lift-off may come a little later than this."""
        was_in_air, self._is_in_air = self._is_in_air, flight_status == modes.IN_AIR
        if was_in_air and not self._is_in_air:
            self._is_granted = False
        if self._is_in_air and not was_in_air:
            self._lifted_s = now_s

    def observe(self, display_mode: int, now_s: float) -> bool:
        """Takes the display mode. Returns whether the aircraft follows an SDK, or would."""
        if display_mode in modes.TAKING_OFF or display_mode == modes.SDK_CONTROL:
            self._lifted_s = None
        elif self._lifted_s is not None and now_s - self._lifted_s > _FOLLOWS_S:
            self._is_granted, self._lifted_s = False, None
        if display_mode == modes.SDK_CONTROL:
            self._has_followed = True
            return True
        is_ignored = self._sent_s is not None and now_s - self._sent_s > _FOLLOWS_S
        is_waiting = display_mode in (modes.P_GPS, modes.ENGINE_START) or display_mode in modes.TAKING_OFF
        if display_mode in modes.TAKING_OFF:
            self._sent_s = None
        elif self._has_followed or is_ignored or not is_waiting:
            self._is_granted = False
        return self._is_granted
