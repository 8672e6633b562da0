"""``ual-daemon`` with one defect, chosen by its name: the campaign must find each.

``python -m tests.campaign --mutant stubborn ...``; the daemon itself reads the name from the environment.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import os
import threading
from collections.abc import Callable
from typing import Any

from ual.geometry import Quaternion
from ual_daemon.backends.values import Cause

VARIABLE = "CAMPAIGN_MUTANT"
_REPEATS_S = 0.05
_REARMS_S = 0.5
_EARLY_SHARE = 0.3
_CROOKED_RAD = math.radians(25.0)
_MAVLINK = "ual_daemon.backends.mavlink:MavlinkBackend"
_NOT_COMMANDED = "; UAL has not been commanded in this flight since it was started, and sends nothing"


def _changed(target: str, name: str, make: Callable[[Any], object]) -> None:
    """Replaces an attribute of ``module:Class`` or of a module by what `make` makes of it."""
    module, _, member = target.partition(":")
    owner = importlib.import_module(module)
    owner = getattr(owner, member) if member else owner
    setattr(owner, name, make(getattr(owner, name)))


def _always(target: str, name: str, value: object) -> Callable[[], None]:
    return lambda: _changed(target, name, lambda _: lambda *_args, **_values: value)


def _regularly(period_s: float, do: Callable[[], object]) -> None:
    def run() -> None:
        while not threading.Event().wait(period_s):
            do()

    threading.Thread(target=run, daemon=True).start()


def _stubborn() -> None:
    """Repeats its last setpoint for ever, also in modes of others."""
    last: list[Callable[[], object]] = []

    def make(send: Callable[..., None]) -> object:
        def noting(backend: object, setpoint: object) -> None:
            last[:] = [lambda: send(backend, setpoint)]
            send(backend, setpoint)

        _regularly(_REPEATS_S, lambda: [each() for each in last])
        return noting

    _changed(_MAVLINK, "send", make)


def _blind() -> None:
    """Takes the pilot's mode for its own."""
    state = importlib.import_module("ual_daemon.flight.state")
    _changed("ual_daemon.flight.state", "_in_manual", lambda _: lambda mode, _held_by: state._in_auto(mode, ""))


def _holder(cause: Cause) -> Callable[[], None]:
    """It names this cause, whatever took the vehicle."""

    def make(held_by: Callable[..., Cause | None]) -> object:
        return lambda *args, **values: None if held_by(*args, **values) is None else cause

    return lambda: _changed("ual_daemon.backends.firmwares.cause_watch:CauseWatch", "held_by", make)


def _early() -> None:
    """Counts a goal as reached at three tenths of the time to it."""
    reference = "ual_daemon.tracker.references:TrajectoryReference"
    is_at = property(lambda each: each.time_s >= _EARLY_SHARE * each.trajectory.duration_s)
    _changed(reference, "is_finished", lambda _: is_at)
    _always("ual_daemon.flight.manoeuvres.arrival:Arrival", "has_arrived", value=True)()


def _midway_point() -> None:
    """Counts a take-off as done at a third of its height."""

    def is_up(manoeuvre: Any, _now_s: float, climbed_m: float, *_: object) -> bool:
        return climbed_m > float(manoeuvre._height_m) / 3.0

    _changed("ual_daemon.flight.manoeuvres.take_off:TakeOffManoeuvre", "_has_arrived", lambda _: is_up)


def _unfenced() -> None:
    """Knows no fence of its own."""
    fence = "ual_daemon.flight.policy.geofence:GeofencePolicy"
    for name in ("admit", "require_goal_inside", "require_inside", "require_straight_to", "require_velocity"):
        _always(fence, name, None)()
    _always(fence, "is_free", value=True)()
    _always(fence, "is_left_by", value=False)()


def _trespasser() -> None:
    """Knows nothing of the limits of the autopilot's own fence."""
    own_fence = "ual_daemon.flight.policy.autopilot_fence"
    _changed(own_fence, "within_limits", lambda _: lambda fence, *_args: fence)


def _hasty() -> None:
    """Keeps to the highest limits of speed that it has heard of."""
    highest: list[Any] = []

    def make(info: Callable[..., Any]) -> object:
        def stale(backend: object) -> object:
            found = info(backend)
            highest[:] = [max((*highest, found), key=lambda each: each.limits.horizontal_speed_m_s)]
            held = highest[0]
            return dataclasses.replace(found, limits=held.limits, cruise_speed_m_s=held.cruise_speed_m_s)

        return stale

    _changed(_MAVLINK, "info", make)


def _patient() -> None:
    """Waits for ever for a motion, a climb or a descent that makes no way."""
    progress = "ual_daemon.flight.manoeuvres.progress_watch"
    _always(f"{progress}:Headway", "stuck_s", 0.0)()
    _always(f"{progress}:ProgressWatch", "observe", None)()
    _changed("ual_daemon.flight.manoeuvres.take_off", "STUCK_TIME_S", lambda _: math.inf)


def _crooked() -> None:
    """Flies velocities that lead 25 degrees to the left. UAL pulls them to their line: less hardly shows."""
    turn = Quaternion.from_yaw(_CROOKED_RAD)

    def make(send: Callable[..., None]) -> object:
        def aside(backend: object, setpoint: Any) -> None:
            if not hasattr(setpoint, "position"):
                setpoint = dataclasses.replace(setpoint, velocity=turn.rotate(setpoint.velocity))
            send(backend, setpoint)

        return aside

    _changed(_MAVLINK, "send", make)


def _rearms() -> None:
    """Arms what it has seen disarmed."""
    armed: list[bool] = []

    def make(send: Callable[..., None]) -> object:
        def noting(backend: Any, setpoint: object) -> None:
            if not armed:
                armed.append(True)
                _regularly(_REARMS_S, lambda: None if backend.snapshot().control.armed.value else backend.arm())
            send(backend, setpoint)

        return noting

    _changed(_MAVLINK, "send", make)


def _gullible() -> None:
    """Takes any mission that the autopilot flies for its own."""
    watch = "ual_daemon.flight.manoeuvres.mission_watch:MissionWatch"
    _always(watch, "step", None)()
    _always(watch, "is_sure", value=True)()


def _careless() -> None:
    """Starts what was cut off amid its upload, and does not undo it."""
    _always("ual_daemon.vehicle.upload_journal:UploadJournal", "refusal", None)()


MUTANTS: dict[str, Callable[[], None]] = {
    "stubborn": _stubborn,
    "blind": _blind,
    "misled": _holder(Cause.FENCE),
    "undecided": _holder(Cause.OPEN),
    "early": _early,
    "half_way": _midway_point,
    "unfenced": _unfenced,
    "trespasser": _trespasser,
    "hasty": _hasty,
    "patient": _patient,
    "crooked": _crooked,
    "forgetful": _always("ual_daemon.flight.explanation:Explanation", "_not_commanded", _NOT_COMMANDED),
    "rearms": _rearms,
    "gullible": _gullible,
    "careless": _careless,
    "deaf": _always("ual_daemon.backends.engine.severe_texts:SevereTexts", "on_text", None),
    "unwatched": _always("ual_daemon.flight.policy.following:Following", "observe", value=False),
}
"""By the name: what makes the daemon so."""


if __name__ == "__main__":
    MUTANTS[os.environ[VARIABLE]]()
    importlib.import_module("ual_daemon.program.main").main()
