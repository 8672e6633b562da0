"""Whether UAL flies the present flight, or others do."""

from __future__ import annotations

from ual.types import State


class Authority:
    """Who holds the present flight, from the first command to the disarming.

    UAL holds it from its first command on. A daemon that was started in flight holds nothing: what it finds in OFFBOARD
    or GUIDED may be the flight of a ground station or of another program. Whoever takes the UAV ends UAL's hold; a new
    command begins it anew.

    `is_ours` is an attribute, which commands set: a method would cost each setpoint of a stream a call.
    """

    def __init__(self) -> None:
        self.is_ours = False
        """Whether UAL was commanded in this flight, and nobody has taken the UAV since."""
        self.is_ground_theirs = False
        """Whether others have flown the UAV since it was disarmed, and UAL has not been commanded since."""

    def observe(self, state: State, *, is_sending: bool) -> None:
        """Notes what an update shows while no manoeuvre of UAL is under way.

        `is_sending` is whether a reference is sent: on the ground a descent that has touched down keeps its stream.
        """
        if state is State.LANDED_DISARMED:
            self.is_ours = self.is_ground_theirs = False
        elif state is State.LANDED_ARMED:
            self.is_ours = self.is_ours and is_sending
        elif state in (State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING):
            self.is_ours, self.is_ground_theirs = False, True
        elif state is State.FLYING_AUTO:
            self.is_ground_theirs = not self.is_ours
