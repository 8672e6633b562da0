"""Each fault: what it does to the rig, for how long, and how it ends."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack

from typing_extensions import Self

from tests.campaign.failures import FAILURES, Wait
from tests.campaign.plan import Fault
from tests.campaign.rig import NAMES, Rig, take_mode
from tests.simulators.faults import GOOD
from tests.sitl.troubles import TROUBLES, changed

_CLIMB_TIMES = 60
_BLIND_S = 7.0
"""Seconds for which both autopilots fly on without GPS until they act (PX4 5.8 s)."""
_ON_LINE: dict[str, Callable[[float], dict[str, float | bool]]] = {
    "loss": lambda strength: {"loss": 0.05 + 0.25 * strength},
    "delay": lambda strength: {"delay_s": 0.3 * strength, "jitter_s": 0.1},
    "corruption": lambda strength: {"corruption": 0.02 + 0.1 * strength},
    "silence": lambda _: {"is_silent": True},
}
"""Faults of the line, from their strength."""
_HOME_M, _HOME_UP_M = 3.0, 2.0
_ORIGIN_M = 5.0
_LAND = {"px4": (4.0, 6.0), "ardupilot": (9.0, 0.0)}


class Befalling:
    """The faults of one flight: each waits for its step on a thread of its own. They end with the block."""

    def __init__(self, rig: Rig, faults: tuple[Fault, ...]) -> None:
        self._rig = rig
        self._over = threading.Event()
        self._reached = {fault.step: threading.Event() for fault in faults}
        self._threads = [threading.Thread(target=self._run, args=(fault,), name=fault.kind) for fault in faults]
        self._active = 0
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for event in self._reached.values():
            event.set()
        for thread in self._threads:
            thread.join()

    def range_m(self, step: int) -> None:
        """The mission is at this step."""
        if step in self._reached:
            self._reached[step].set()

    @property
    def is_calm(self) -> bool:
        """Whether no fault is under way."""
        return self._active == 0

    def _run(self, fault: Fault) -> None:
        self._reached[fault.step].wait()
        if self._over.wait(fault.delay_s):
            return
        with self._lock:
            self._active += 1
        ended = self._rig.begin_trouble(fault.kind)
        try:
            FAULTS[fault.kind](self._rig, fault, self._over.wait)
        except Exception as error:  # noqa: BLE001  a fault that fails is told with the flight
            self._rig.record.failed.append(f"{fault.kind}: {error!r}")
        finally:
            ended()
            with self._lock:
                self._active -= 1


def _row(rig: Rig, fault: Fault, wait: Wait) -> None:
    rig.set_link(**_ON_LINE[fault.kind](fault.strength))
    wait(fault.duration_s)
    rig.set_link(**{name: getattr(GOOD, name) for name in _ON_LINE[fault.kind](0.0)})


def _reboot(_rig: Rig, _fault: Fault, _wait: Wait) -> None:
    """Done before the mission begins: see `flight.fly`."""


def _kill_daemon(rig: Rig, fault: Fault, wait: Wait) -> None:
    rig.kill_daemon()
    wait(fault.duration_s)
    rig.start_daemon()


def _kill_client(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    rig.kill_client()


def _second_sender(rig: Rig, fault: Fault, wait: Wait) -> None:
    """Not before it is up: a target that ends ArduCopter's own take-off is an internal error of it, until it boots."""
    for _ in range(_CLIMB_TIMES):
        if rig.is_up() or wait(0.2):
            break
    here = rig.truth.place or (0.0, 0.0, 0.0)
    there = (here[0] * 0.5, 4.0 * fault.strength - 2.0, 3.0)
    for _ in range(int(fault.duration_s * 5.0)):
        rig.truth.send_target(there)
        if wait(0.2):
            return


def _pilot(rig: Rig, fault: Fault, wait: Wait) -> None:
    rig.pilot.take_over()
    wait(fault.duration_s)
    rig.pilot.stand_by()


def _rc_loss(rig: Rig, fault: Fault, wait: Wait) -> None:
    if rig.options.autopilot == "px4":
        rig.pilot.holds_sticks = False
        wait(fault.duration_s)
        rig.pilot.holds_sticks = True
    else:
        rig.pilot.set_parameter("SIM_RC_FAIL", 1.0)
        wait(fault.duration_s)
        rig.pilot.set_parameter("SIM_RC_FAIL", 0.0)


def _battery(rig: Rig, fault: Fault, wait: Wait) -> None:
    if rig.options.autopilot == "px4":
        rig.pilot.set_parameter("SIM_BAT_MIN_PCT", 8.0)
        rig.pilot.set_parameter("SIM_BAT_DRAIN", 12.0)
        wait(3.0 + fault.duration_s)
        rig.pilot.set_parameter("SIM_BAT_DRAIN", 60.0)
        rig.pilot.set_parameter("SIM_BAT_MIN_PCT", 50.0)
    else:
        rig.pilot.set_parameter("SIM_BATT_VOLTAGE", 9.9)
        wait(3.0 + fault.duration_s)
        rig.pilot.set_parameter("SIM_BATT_VOLTAGE", 12.6)
        rig.pilot.order(42651, (255.0, 100.0))


def _home(rig: Rig, fault: Fault, wait: Wait) -> None:
    """A ground station moves the autopilot's home aside and up or down, and back."""
    before = rig.record.homes[-1].place if rig.record.homes else (0.0, 0.0, 0.0)
    angle_rad, up_m = 2.0 * math.pi * fault.strength, _HOME_UP_M * (2.0 * fault.strength - 1.0)
    east_m, north_m = _HOME_M * math.cos(angle_rad), _HOME_M * math.sin(angle_rad)
    rig.truth.set_home((before[0] + east_m, before[1] + north_m, before[2] + up_m))
    wait(2.0 + fault.duration_s)
    rig.truth.set_home(before)


def _origin(rig: Rig, fault: Fault, wait: Wait) -> None:
    """PX4's local frame moves, and back. ArduPilot takes no other origin while its estimator has one."""
    if rig.options.autopilot != "px4":
        return
    angle_rad = 2.0 * math.pi * fault.strength
    rig.truth.set_origin((_ORIGIN_M * math.cos(angle_rad), _ORIGIN_M * math.sin(angle_rad), 1.0))
    wait(2.0 + fault.duration_s)
    rig.truth.set_origin((0.0, 0.0, 0.0))


def _station(rig: Rig, _fault: Fault, _wait: Wait) -> None:
    """A ground station has it land."""
    take_mode(rig, *_LAND[rig.options.autopilot])


def _ekf(rig: Rig, fault: Fault, wait: Wait) -> None:
    """GPS is lost: the estimator has no position after some seconds, and the autopilot's failsafe sets in."""
    with changed(rig.pilot, TROUBLES[NAMES[rig.options.autopilot]]["position failsafe"]):
        wait(_BLIND_S + fault.duration_s)


def _freeze(rig: Rig, fault: Fault, wait: Wait) -> None:
    rig.daemon.signal(signal.SIGSTOP)
    wait(fault.duration_s)
    rig.daemon.signal(signal.SIGCONT)


def _busy(_rig: Rig, fault: Fault, wait: Wait) -> None:
    with ExitStack() as stack:
        for _ in range(2):
            spinner = stack.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            stack.callback(spinner.kill)
        wait(fault.duration_s)


FAULTS: dict[str, Callable[[Rig, Fault, Wait], None]] = {
    **FAILURES,
    **dict.fromkeys(_ON_LINE, _row),
    "reboot": _reboot,
    "kill_daemon": _kill_daemon,
    "kill_client": _kill_client,
    "second_sender": _second_sender,
    "pilot": _pilot,
    "rc_loss": _rc_loss,
    "battery": _battery,
    "ekf": _ekf,
    "home": _home,
    "origin": _origin,
    "station": _station,
    "freeze": _freeze,
    "busy": _busy,
}
