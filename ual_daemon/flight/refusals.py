"""The errors of a command that may not begin, and of a manoeuvre that another command ended."""

from __future__ import annotations

from ual.errors import PermissionDeniedError, TaskAbortedError, WrongStateError
from ual.types import State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre


def shutting_down(command: str) -> WrongStateError:
    """The refusal of a command that arrives after the shutdown has begun."""
    return WrongStateError(f"{command}: UAL is shutting down and takes no more commands")


def only_watching(command: str) -> PermissionDeniedError:
    """The refusal of a command by a daemon that only watches."""
    return PermissionDeniedError(
        f"{command}: this daemon only watches (--watch-only) and sends nothing that flies", {"command": command}
    )


def not_replaceable(manoeuvre: Manoeuvre, command: str) -> WrongStateError:
    """The refusal of a command during a manoeuvre that only the safety pilot can abort."""
    metadata = {"command": command}
    if manoeuvre.declares is not None:
        metadata["state"] = manoeuvre.declares.name
    return WrongStateError(
        f"{command}: {manoeuvre.name} is under way; only the safety pilot can abort it, else wait for its end", metadata
    )


def on_mission(command: str) -> WrongStateError:
    """The refusal of a reference while the autopilot flies a mission: a stream of them cannot take it back."""
    return WrongStateError(
        f"{command}: the autopilot flies a mission; stop it first (abort), or replace it by a go-to, a path, a landing "
        "or a return",
        {"command": command, "needed": "abort"},
    )


def stopping_mission(command: str) -> WrongStateError:
    """The refusal of a reference while a mission is being stopped."""
    return WrongStateError(
        f"{command}: the mission is being stopped, and UAL does not have the control yet; command it again in a moment",
        {"command": command},
    )


def just_taken(command: str, snapshot: Snapshot) -> WrongStateError:
    """The refusal of a command while the autopilot flew for UAL until others chose another mode just now."""
    mode = snapshot.control.mode_text
    return WrongStateError(
        f"{command}: others have just chosen mode {mode} over its flight for UAL (the safety pilot, a ground "
        "station, or a failsafe); the state tells within half a second which, and what is possible then",
        {"command": command, "mode": mode},
    )


def not_pausable(command: str, why: str) -> WrongStateError:
    """The refusal of a pause or resume; `why` says what runs, or that nothing does."""
    return WrongStateError(f"{command}: {why}", {"command": command})


def replaced(old: Manoeuvre, by: str) -> TaskAbortedError:
    """The end of a manoeuvre that a newer command replaced or cancelled."""
    how = "cancelled" if by in ("cancel", "abort") else f"replaced by {by}"
    return TaskAbortedError(f"{old.name}: {how}", {"by": by, "state": State.FLYING_AUTO.name})
