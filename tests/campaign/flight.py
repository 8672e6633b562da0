"""Flies one plan, and returns its record."""

from __future__ import annotations

import time

from pymavlink.dialects.v20 import all as mavlink

from tests.campaign.befall import Befalling
from tests.campaign.evidence import SERVICES
from tests.campaign.plan import FOREIGN, PLAIN, Plan, Step
from tests.campaign.processes import FlightFailedError
from tests.campaign.record import Place, Record
from tests.campaign.rig import Rig, take_mode

_ARMED_S = 15.0
"""A daemon that is killed and started may have to tell it first."""
_CALM_S = 12.0
_ATTEMPTS = 3
_DOWN_S = 45.0
_LEAVING = ("rc_loss", "battery", "fence", "ekf", "limits", "wide_fence")
"""Faults that change parameters."""
_SHOWN_S = 0.2
"""Until the daemon's new state has surely come."""


def fly(rig: Rig, plan: Plan) -> Record:
    """Flies it from the ground to the ground.

    Raises:
        FlightFailedError: Something other than UAL failed.

    """
    if any(fault.kind == "reboot" for fault in plan.faults) or rig.is_astray() or rig.must_boot:
        rig.reboot()
    rig.prepare()
    record = rig.begin_record()
    rig.set_home()
    with Befalling(rig, plan.faults) as faults:
        (_foreign if plan.mission == FOREIGN else _ours)(rig, plan, faults)
    rig.bring_down()
    if any(fault.kind in _LEAVING for fault in plan.faults):
        rig.set_parameters()
    if rig.has_sunk():
        raise FlightFailedError("it has sunk into the simulator's ground")
    return record


def _ours(rig: Rig, plan: Plan, faults: Befalling) -> None:
    for number, step in enumerate(plan.steps):
        faults.range_m(number)
        if step.name == "arm" and plan.armed_by == "pilot":
            _pilot_arms(rig)
        elif not _do(rig, step, faults):
            return


def _pilot_arms(rig: Rig) -> None:
    try:
        _arm(rig)
        rig.wait_for(lambda: rig.state() == "LANDED_ARMED" or not rig.pilot.is_armed, "LANDED_ARMED", _ARMED_S)
    except Exception as error:
        raise AssertionError(f"the pilot could not arm: {error}") from error


def _arm(rig: Rig) -> None:
    """The pilot tries until it is armed: after a failure of the satellites that takes a while."""
    rig.note("arm")
    rig.pilot.arm()
    rig.note("armed")


def _do(rig: Rig, step: Step, faults: Befalling) -> bool:
    """Does a step; where something stands in the way, once more when it is over. Returns whether to go on."""
    for _ in range(_ATTEMPTS):
        call = rig.call(step.name, *_values(rig, step))
        if not call.outcome or call.outcome == "GEOFENCE" or step.name in SERVICES - {"upload"}:
            return True
        _wait_until_calm(rig, faults)
        if step.name == "upload":
            rig.call("mission", (float(PLAIN), 0.5))  # a part of it, which must be refused
        state = rig.state()
        if state in ("LANDED_DISARMED", "LANDED_ARMED") and step.name not in ("arm", "take_off"):
            return False
        if state == "FLYING_AUTO" and step.name == "take_off":
            return True
        if rig.is_down() and step.name not in ("arm", "take_off"):
            return False  # it has fallen
        if step.name == "mission":
            return True  # it is flown once
        if state == "FLYING_MANUAL" or "not follow" in rig.reason():
            if rig.call("recover", (0.0,)).outcome:
                rig.call("recover", (1.0,))
            time.sleep(_SHOWN_S)
    return False


def _values(rig: Rig, step: Step) -> tuple[tuple[float, ...], Place | None]:
    """The numbers of a step as the client needs them, and its goal. Plans have places from the simulator's start."""
    if step.name in ("go_to_geo", "go_above_home"):
        east, north, up = step.values
        return (), (east, north, up)
    if step.name not in ("go_to", "path", "pose"):
        return step.values, None
    home = rig.anchor or (0.0, 0.0, 0.0)
    values = tuple(value - (0.0 if number % 3 == 2 else home[number % 3]) for number, value in enumerate(step.values))
    return values, None if step.name == "pose" else (values[-3], values[-2], values[-1])


def _wait_until_calm(rig: Rig, faults: Befalling) -> None:
    """Until no fault is under way, and the autopilot does not climb by itself."""
    until_s = time.monotonic() + _CALM_S
    while not (faults.is_calm and rig.state() != "TAKING_OFF") and time.monotonic() < until_s:
        time.sleep(0.05)
    time.sleep(0.3)


def _foreign(rig: Rig, plan: Plan, faults: Befalling) -> None:
    """A ground station's flight: no client commands anything, and the daemon must send nothing."""
    rig.note("fly")
    _arm(rig)
    is_px4 = rig.options.autopilot == "px4"
    if is_px4:
        take_mode(rig, 4.0, 2.0)
    else:
        rig.pilot.order(mavlink.MAV_CMD_NAV_TAKEOFF, (0.0,) * 6 + (3.0,))
    for number in range(len(plan.steps)):
        faults.range_m(number)
        _pause(rig, 3.0)
        if not is_px4 and rig.is_up():
            rig.truth.send_target((2.0 * number - 4.0, 2.0, 3.0))
    take_mode(rig, 4.0, 6.0) if is_px4 else take_mode(rig, 9.0)
    until_s = time.monotonic() + _DOWN_S
    while rig.pilot.is_armed and time.monotonic() < until_s:
        time.sleep(0.1)


def _pause(rig: Rig, duration_s: float) -> None:
    """Waits, unless the flight is over."""
    until_s = time.monotonic() + duration_s
    while time.monotonic() < until_s and rig.pilot.is_armed:
        time.sleep(0.05)
