"""The first checks of every command: can the backend do it, and is the state right? Refusals are logged."""

from __future__ import annotations

from collections.abc import Collection

from ual.errors import LinkLostError, NotSupportedError, WrongStateError
from ual.types import Capability, State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.offers.missions import AutopilotMissions
from ual_daemon.backends.values import Cause, Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.manoeuvres.manoeuvre import ONLY_OTHERS_END_IT, takes_back
from ual_daemon.flight.policy.following import ENDS_LYING, FALL_M_S
from ual_daemon.flight.refusals import only_watching, shutting_down
from ual_daemon.flight.state import Estimate
from ual_daemon.vehicle.refusal_log import RefusalLog

_ALWAYS = frozenset({"land", "abort", "cancel", "disarm", "pause", "set_home", "recover_from_manual"})
"""Commands that are possible also where the UAV does not follow, or its motors are stopped: they end a motion, or begin
none.
"""
_ENDS = _ALWAYS - {"recover_from_manual"}
"""The commands that are possible also where the UAV may lie on the ground. To hold its pose there would lift it off."""


class Preconditions(RefusalLog):
    """The checks of one UAV, and the log of what they refuse. Any thread may call."""

    def __init__(self, backend: Backend, flight: Flight) -> None:
        super().__init__()
        self._backend = backend
        self._flight = flight

    def require_capability(self, capability: Capability, command: str) -> None:
        """Checks that the backend has a capability.

        Raises:
            NotSupportedError: It has not.
            LinkLostError: Nothing is received from the autopilot, so its capabilities are not known.

        """
        info = self._backend.info()
        if capability in info.capabilities:
            return
        # Nothing is known of the capabilities of an autopilot that was not received yet.
        _require_link(command, self._flight.estimate(self._backend.snapshot()))
        if info.limitation:
            raise NotSupportedError(f"{command}: {info.limitation}", {"autopilot": info.autopilot})
        known = ", ".join(sorted(c.name for c in info.capabilities)) or "nothing of the kind"
        raise NotSupportedError(f"{command}: the backend {self._backend.name} cannot (it can: {known})")

    def require_flying_allowed(self, command: str) -> None:
        """Checks that this daemon may fly.

        Raises:
            PermissionDeniedError: It only watches.

        """
        if self._flight.is_watch_only:
            raise only_watching(command)

    def require_own_ground(self, command: str) -> None:
        """Checks that no other has flown the UAV since it was disarmed, unless control was asked back.

        A pilot who has taken over and landed by hand may step up to the UAV while its motors run. A take-off that a
        client repeats must not lift it again.

        Raises:
            WrongStateError: Others have flown it, or it has landed in this moment.

        """
        if self._flight.authority.is_landing_new:
            raise WrongStateError(
                f"{command}: the UAV has landed just now, and it is not known yet whether others have flown it: "
                "command it again",
                {"state": State.LANDED_ARMED.name, "command": command},
            )
        if self._flight.authority.is_ground_theirs:
            raise WrongStateError(
                f"{command}: others have flown the UAV since it was armed, so it stays on the ground until it was "
                "disarmed once, or until recover_from_manual takes control back",
                {"state": State.LANDED_ARMED.name, "needed": "recover_from_manual", "command": command},
            )

    def require_no_fall(self, command: str, snapshot: Snapshot) -> None:
        """Checks that the UAV does not fall by its velocity, as one that was just disarmed, or armed again, in the air.

        The watch of what follows takes longer: to a daemon that is new, a UAV may be carried, as in a lift.

        Raises:
            WrongStateError: It falls.

        """
        velocity = snapshot.motion.velocity
        if velocity is None or snapshot.time_s - velocity.time_s > self._backend.freshness.pose_s:
            return
        if (down_m_s := -velocity.value.linear.z) > FALL_M_S:
            remedy = "it is armed again once it lies still" if command == "arm" else "wait until it lies still"
            raise WrongStateError(
                f"{command}: the UAV falls at {down_m_s:.0f} m/s; {remedy}",
                {"state": self._flight.estimate(snapshot).state.name, "needed": "standing still", "command": command},
            )

    def require_recoverable(self, command: str) -> tuple[State, ...]:
        """Returns the states in which the control of a UAV that does not follow may be asked back.

        Raises:
            WrongStateError: It still moves, or its motors are stopped.

        """
        following = self._flight.following
        if why_not := following.why_not_recoverable(self._flight.raw_estimate(self._backend.snapshot()).state):
            raise WrongStateError(f"{command}: {why_not} ({following.why})", {"command": command})
        return State.FLYING_AUTO, State.FLYING_MANUAL, State.LANDED_ARMED

    def require_no_pilot(self, command: str, lease_id: str) -> Snapshot:
        """Returns the snapshot in which the end of a flight may begin: in FLYING_AUTO, or where the autopilot flies by
        itself. It does, too, in a take-off that our arming has begun.

        Raises:
            WrongStateError: The safety pilot flies, the state is another one, or UAL is shutting down.
            LinkLostError: Nothing is received from the autopilot.
            PermissionDeniedError: This daemon only watches.

        """
        state = self._flight.estimate(self._backend.snapshot()).state
        if state is State.TAKING_OFF and self._flight.arming.is_ours_to_end:
            return self.require_state(command, lease_id, State.TAKING_OFF)
        if state is not State.FLYING_MANUAL:
            return self.require_state(command, lease_id, State.FLYING_AUTO)
        snapshot = self.require_state(command, lease_id, State.FLYING_MANUAL)
        mode = snapshot.control.mode
        if mode is not None and mode.value.is_autonomous:
            return snapshot
        name = "" if mode is None else f" in mode {mode.value.text}"
        raise _controlled_by_others(command, f"the safety pilot flies{name} and lands it by hand")

    def require_no_mission_of_others(self, command: str, snapshot: Snapshot) -> None:
        """Checks that the autopilot flies no mission that others have begun. A failsafe may use one to land.

        Raises:
            WrongStateError: It does.

        """
        offer = self._backend.offer(AutopilotMissions)  # type: ignore[type-abstract]  # it is only looked for
        held_by, is_ours = snapshot.control.held_by, self._flight.arming.is_ours_to_end or self._flight.is_on_mission
        if offer is None or is_ours or (held_by is not None and held_by.is_failsafe):
            return
        if (
            self._flight.raw_estimate(snapshot).state is State.FLYING_MANUAL
            and snapshot.control.mode_name == offer.mode
        ):
            raise _controlled_by_others(command, "the autopilot flies a mission that UAL has not begun")

    def require_no_failsafe(self, command: str, snapshot: Snapshot, *, force: bool) -> None:
        """Checks that no failsafe of the autopilot is active or holds the control, unless forced.

        Raises:
            WrongStateError: One is; the metadata `by` names it.

        """
        refusal = self.failsafe_refusal(command, snapshot, force=force)
        if refusal is not None:
            raise refusal

    def failsafe_refusal(self, command: str, snapshot: Snapshot, *, force: bool) -> WrongStateError | None:
        """Returns the refusal of a command because of a failsafe; None if none hinders it, or if it is forced."""
        if _are_motors_stopped(snapshot):
            return _motors_stopped(command)
        held_by = _needing_force(snapshot.control.held_by)
        cause = held_by or _needing_force(snapshot.control.failsafe)
        if force or cause is None:
            return None
        mode = f" (mode {snapshot.control.mode_text})" if snapshot.control.mode_text else ""
        does = "has taken control" if held_by and not snapshot.control.is_on_ground else "is active"
        return WrongStateError(
            f"{command}: the autopilot's {cause.value} {does}{mode}; only with force is it overridden, and the UAV "
            "then flies without that protection",
            {"by": cause.value, "needed": "force", "command": command},
        )

    def require_state(self, command: str, lease_id: str, *allowed: State) -> Snapshot:
        """Returns the snapshot in which the state is one of the allowed ones. `lease_id` is that of the command.

        Raises:
            WrongStateError: The state is another one, the UAV does not follow, its motors are stopped, or UAL is
                shutting down.
            LinkLostError: Nothing is received from the autopilot.
            PermissionDeniedError: This daemon only watches.
            LeaseHeldError: Another program holds the lease.
            LeaseLostError: The lease of the command has ended.

        """
        if self._flight.is_closing:
            raise shutting_down(command)
        if self._flight.is_watch_only:
            raise only_watching(command)
        if lease_id != self._flight.lease.id and (refusal := self._flight.lease.refusal(command, lease_id)):
            raise refusal
        snapshot = self._backend.snapshot()
        found = self._flight.estimate(snapshot)
        # The autopilot's word is enough: the watch of what follows needs a look more, and in a landing a fall of 1 m.
        is_stopped = _are_motors_stopped(snapshot) and command not in _ALWAYS
        if found.state in allowed:
            if self._flight.following.why and command not in _ALWAYS:
                refusal = self._flight.following.refusal(command, found.state)
                if refusal is not None:
                    raise refusal
            if not is_stopped:
                is_sure = self._flight.authority.is_ours or command in _ENDS
                if not is_sure and (why := self._flight.why_it_may_lie(snapshot, found.state)):
                    metadata = {"state": found.state.name, "needed": "land", "command": command}
                    raise WrongStateError(f"{command}: {why}: {ENDS_LYING}; if it flies, climb 1 m by hand", metadata)
                return snapshot
        _require_link(command, found)
        if is_stopped and found.state is not State.UNINITIALIZED:  # by old data, or another vehicle's, nothing is known
            raise _motors_stopped(command)
        needed = " or ".join(state.name for state in allowed)
        raise WrongStateError(
            f"{command} needs the state {needed}, but it is {found.state.name}: {found.why}"
            f"{_remedy(command, found.state, snapshot, allowed)}",
            {"state": found.state.name, "needed": needed, "command": command},
        )


_NO_MOTIONS = ("abort", "land", "return_to_launch", "pause", "resume", "jump_to_item")
"""Commands of a UAV in flight for which nobody takes off."""


def _remedy(command: str, state: State, snapshot: Snapshot, allowed: Collection[State]) -> str:
    """Returns what can be done on the ground, or where others fly the UAV; empty where nothing can."""
    if State.FLYING_AUTO in allowed and command not in _NO_MOTIONS:
        if state is State.LANDED_DISARMED:
            return "; arm first" if State.LANDED_ARMED in allowed else "; arm and take off first"
        if state is State.LANDED_ARMED:
            return "; take off first"
    held_by = snapshot.control.held_by
    if state is State.FLYING_MANUAL and State.FLYING_AUTO in allowed:
        return f"; {takes_back(_needing_force(held_by) or snapshot.control.failsafe)}"
    if state in (State.LANDING, State.TAKING_OFF) and held_by not in (None, Cause.OPEN):
        return f"; {ONLY_OTHERS_END_IT}"
    return ""


def _are_motors_stopped(snapshot: Snapshot) -> bool:
    """Returns whether the autopilot says that it keeps the motors stopped, in the air or on the ground."""
    return Cause.TERMINATION in (snapshot.control.failsafe, snapshot.control.held_by)


def _motors_stopped(command: str) -> WrongStateError:
    return WrongStateError(
        f"{command}: the autopilot has stopped the motors (flight termination, or a kill switch); "
        f"{takes_back(Cause.TERMINATION)}",
        {"by": Cause.TERMINATION.value, "command": command},
    )


def _needing_force(cause: Cause | None) -> Cause | None:
    return cause if cause is not None and cause.needs_force else None


def _require_link(command: str, found: Estimate) -> None:
    if not found.is_link_up:
        raise LinkLostError(f"{command}: {found.why}", {"state": found.state.name})


def _controlled_by_others(command: str, how: str) -> WrongStateError:
    return WrongStateError(
        f"{command} needs the state FLYING_AUTO, but it is FLYING_MANUAL: {how}; recover_from_manual takes control "
        f"back, and then {command} is possible",
        {"state": State.FLYING_MANUAL.name, "needed": State.FLYING_AUTO.name, "command": command},
    )
