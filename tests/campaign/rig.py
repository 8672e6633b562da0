"""All that one campaign flies with: simulator, wiretap, daemon, client, safety pilot, truth."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import all as mavlink

import ual
from tests.campaign.ears import Ears
from tests.campaign.evidence import REFUSED, estimate_error_m
from tests.campaign.modes import BY_AUTOPILOT
from tests.campaign.plan import ABORT, AREA_M, FENCE_HEIGHT_M, FENCE_SIDE_M, JUMP
from tests.campaign.positions import Origin
from tests.campaign.processes import ClientProcess, DaemonProcess, FlightFailedError, SimulatorProcess
from tests.campaign.record import (
    DAEMON_KILLED,
    DAEMON_STARTED,
    Called,
    Life,
    Order,
    Place,
    Record,
    StatusText,
    Text,
    Trouble,
)
from tests.campaign.starvation import StarvationWatch
from tests.campaign.truth import TruthLink
from tests.simulators.faults import GOOD
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual.types import Telemetry

_PARAMETERS = {
    "ardupilot": {
        "RTL_ALT": 400.0,
        "RTL_LOIT_TIME": 500.0,
        "WPNAV_SPEED": 1000.0,
        "WPNAV_SPEED_UP": 250.0,
        "BATT_FS_LOW_ACT": 2.0,
        "BATT_LOW_TIMER": 1.0,
        "BATT_LOW_VOLT": 10.5,
        "SIM_BATT_VOLTAGE": 12.6,
        "SIM_RC_FAIL": 0.0,
    },
    "px4": {
        "RTL_RETURN_ALT": 5.0,
        "RTL_DESCEND_ALT": 5.0,
        "SIM_BAT_DRAIN": 60.0,
        "SIM_BAT_MIN_PCT": 50.0,
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_XY_CRUISE": 5.0,
    },
}
"""So that a failsafe's return is short, and comes when it is caused."""
NAMES = {"px4": "PX4", "ardupilot": "ArduPilot"}
"""The autopilots, as UAL names them."""
_ON_EARTH = ("go_to_geo", "go_above_home")
_STATES_HZ = 20.0
_BOOT_S = 150.0
_DOWN_S = 60.0
_ASTRAY_M = 3.0
_UP_M = 2.8
_DOWN_M, _SUNK_M = 0.3, 0.5
_FALLEN_S = 3.0
"""The time in which a UAV that was disarmed in the air falls, lies still, and is told."""
_LIES_S = 5.0
_FORCE = 21196.0
_KEPT_COUNT = 5
_SURE_M, _SURE_S = 1.0, 20.0
"""A failed sensor leaves the estimate wrong for a while."""
_CLIENT_KILLED = "CLIENT_KILLED"
_BROKEN_OFF = frozenset({"LINK_LOST", "UNAVAILABLE"})
"""So may a call end that had begun."""
_NO_RESET = 42651
"""MAV_CMD_BATTERY_RESET."""


@dataclass(frozen=True)
class Options:
    """Vehicle and links of a campaign."""

    autopilot: str
    url: str
    make_pilot: Callable[[], Transmitter]
    truth_url: str
    start: str
    folder: Path
    origin: Origin
    mutant: str = ""
    """The defect of the daemon; none: the real one."""


class Rig:
    """Everything, from its making to `close`. Each flight has a record of its own."""

    def __init__(self, options: Options) -> None:
        self.options = options
        self.modes = BY_AUTOPILOT[options.autopilot]
        self.record = self._new_record()
        self.simulator = SimulatorProcess(options.start) if options.start else None
        if self.simulator is not None:
            self.simulator.start()
        self._ears = Ears(self.record, options.origin)
        self.wiretap = Wiretap(options.url, self._ears)
        self.truth = TruthLink(options.truth_url, self.record, options.origin)
        self.daemon = DaemonProcess(options.mutant, self._flags(), options.folder)
        self._observer: ual.Uav | None = None
        self._client: ClientProcess | None = None
        self.must_boot = False
        """Whether the autopilot must boot before the next flight."""
        self._places: list[Place] = []
        self.anchor: Place | None = None
        self.anchor_error_m = 0.0
        self.start_daemon()  # first: ArduPilot's simulator opens its other ports for the first client of this one
        self.pilot = self._make_pilot()
        self._starvation = StarvationWatch(self._daemon_pid, self._note_starvation)

    def close(self) -> None:
        for close in (
            self._starvation.close,
            self._end_client,
            self._end_observer,
            self.daemon.close,
            self.pilot.close,
            self.truth.close,
            self.wiretap.close,
        ):
            close()
        if self.simulator is not None:
            self.simulator.end()

    # --- A flight's record --------------------------------------------------------------------------------------------

    def begin_record(self) -> Record:
        """Begins a new one. What is true already is in it."""
        before, known = self.record, self.record.told[-200:]
        self.record = self._new_record()
        self.record.anchor, self.record.anchor_error_m = self.anchor, self.anchor_error_m
        self.record.told.extend(known)
        self.record.values.extend({each.name: each for each in before.values}.values())
        self.record.told_homes.extend(before.told_homes[-1:])
        self.record.homes.extend(before.homes[-1:])
        self.record.healths.extend(before.healths[-1:])
        self.record.truth.extend(before.truth[-_KEPT_COUNT:])
        self.record.estimate.extend(before.estimate[-_KEPT_COUNT:])
        self.record.lives.append(Life(known[0].time_s if known else time.monotonic(), DAEMON_STARTED))
        self._ears.record = self.truth.record = self.record
        return self.record

    def _new_record(self) -> Record:
        return Record(self.options.autopilot, (FENCE_SIDE_M, FENCE_HEIGHT_M))

    # --- The daemon and its clients -----------------------------------------------------------------------------------

    def start_daemon(self) -> None:
        self.record.lives.append(Life(time.monotonic(), DAEMON_STARTED))
        self.daemon.start()
        self._end_observer()
        self._observer = ual.Uav("uav_1", address=self.daemon.address)
        self._observer.subscribe(self._note_state, rate_hz=_STATES_HZ)

    def kill_daemon(self) -> None:
        self.daemon.kill()
        self.record.lives.append(Life(time.monotonic(), DAEMON_KILLED))

    def kill_client(self) -> None:
        if self._client is not None:
            self._client.kill()

    def call(self, name: str, values: tuple[float, ...] = (), goal: Place | None = None) -> Called:
        """Has the client do a step; a client that was killed is followed by another at the next step."""
        if self._client is None:
            self._client = ClientProcess(self.daemon.address)
        sent, places = values, self._places
        if name in _ON_EARTH:
            assert goal is not None
            latitude_deg, longitude_deg, altitude_m = self.options.origin.geo(goal)
            sent = (latitude_deg, longitude_deg, altitude_m if name == "go_to_geo" else goal[2])
        if name == "upload":
            places, sent = self._mission(values)
        if name == "mission":
            sent = (*values, float(len(self._places)))
        answer = self._client.run(name, sent)
        if name == "upload":
            self._note_upload(answer.get("outcome", _CLIENT_KILLED), places)
        if "ended_s" not in answer:
            self._end_client()
            answer = {**answer, "ended_s": time.monotonic(), "outcome": _CLIENT_KILLED, "by": "", "text": ""}
        call = Called(
            name,
            answer["began_s"],
            answer["ended_s"],
            answer["outcome"],
            answer["by"],
            goal,
            name in _ON_EARTH,
            answer.get("accepted", 0),
            (values[0], values[1], values[2]) if name == "velocity" else None,
            name == "go_above_home",
            answer["text"],
            values[0] if name == "take_off" else None,
            self._goals(int(values[0]), answer["began_s"]) if name == "mission" else (),
        )
        self.record.called.append(call)
        return call

    def _mission(self, values: tuple[float, ...]) -> tuple[list[Place], tuple[float, ...]]:
        """Returns the places of a mission, and the same as latitude, longitude and height above home."""
        places = [(values[each], values[each + 1], values[each + 2]) for each in range(0, len(values), 3)]
        geo = [(*self.options.origin.geo(place)[:2], place[2]) for place in places]
        return places, tuple(value for each in geo for value in each)

    def _note_upload(self, outcome: str, places: list[Place]) -> None:
        """A refused upload leaves the mission before it. After one that broke off the mission is not known."""
        if outcome not in REFUSED - _BROKEN_OFF:
            self._places = [] if outcome else places

    def _goals(self, action: int, time_s: float) -> tuple[Place, ...]:
        """Returns the goals of the mission that was begun then: its heights count from the autopilot's home."""
        homes = [each.place[2] for each in self.record.homes if each.time_s <= time_s]
        if action == ABORT or not homes:
            return ()
        goals = [(east, north, up + homes[-1]) for east, north, up in self._places]
        return tuple(goals[-1:] if action == JUMP else goals)

    def upload_mission(self, places: Sequence[Place]) -> None:
        """Replaces the mission as a ground station does; without places it is cleared."""
        geo = [(*self.options.origin.geo(place)[:2], place[2]) for place in places]
        if self.pilot.upload_mission(geo):
            self.note("upload" if places else "clear")

    def note(self, what: str) -> None:
        """Notes that the safety pilot or a ground station does something."""
        self.record.orders.append(Order(time.monotonic(), what))

    def set_home(self) -> None:
        """Home is where the vehicle stands: the judge knows where that is."""
        call = self.call("set_home")
        if not call.outcome and self.truth.place is not None:
            self.anchor = self.record.anchor = self.truth.place
            self.anchor_error_m = self.record.anchor_error_m = estimate_error_m(self.record, call.ended_s)

    def state(self) -> str:
        """The state that the daemon told last."""
        return self.record.said[-1].state if self.record.said else ""

    def reason(self) -> str:
        """The reason of that state."""
        return self.record.said[-1].reason if self.record.said else ""

    def _note_state(self, sample: Telemetry) -> None:
        now_s = time.monotonic()
        self.record.said.append(StatusText(now_s, sample.state.name, sample.state_reason))
        health = sample.health
        text = "" if health is None else "; ".join((*health.failing_checks, health.failsafe))
        if not self.record.healths or self.record.healths[-1].text != text:
            self.record.healths.append(Text(now_s, text))

    def _daemon_pid(self) -> int | None:
        return self.daemon.pid if self.daemon.is_running else None

    def _note_starvation(self, began_s: float, ended_s: float) -> None:
        self.record.troubles.append(Trouble("busy", began_s, ended_s))

    def _end_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def _end_observer(self) -> None:
        if self._observer is not None:
            self._observer.close()
            self._observer = None

    def _flags(self) -> tuple[str, ...]:
        origin = self.options.origin
        side = FENCE_SIDE_M
        config = {
            "map_origin_geo": [origin.latitude_deg, origin.longitude_deg, origin.altitude_m],
            "geofence": {
                "frame_id": "map",
                "polygon": [[-side, -side], [side, -side], [side, side], [-side, side]],
                "max_height_m": FENCE_HEIGHT_M,
            },
        }
        path = self.options.folder / "uav.yaml"
        path.write_text(json.dumps(config))  # JSON is YAML, too
        return ("--url", self.wiretap.url, "--allow-arming", "--config", str(path))

    # --- The line -----------------------------------------------------------------------------------------------------

    def set_link(self, **faults: float | bool) -> None:
        """Changes some faults of the line; the others stay."""
        self.wiretap.faults = dataclasses.replace(self.wiretap.faults, **faults)  # type: ignore[arg-type]

    # --- The vehicle and its pilot ------------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Until the autopilot may be armed, and the daemon sees it stand disarmed.

        Raises:
            FlightFailedError: The simulator did not come so far.

        """
        self.pilot.stand_by()
        try:
            self.pilot.wait_until_ready()
        except AssertionError as error:
            raise FlightFailedError(str(error)) from None
        self.wait_for(lambda: self.state() == "LANDED_DISARMED", "LANDED_DISARMED", _DOWN_S)
        with contextlib.suppress(FlightFailedError):  # it is told to have fallen until it has lain still for a second
            self.wait_for(lambda: "once it lies" not in self.reason(), "that it lies still", _LIES_S)
        self.wait_for(lambda: self.truth.place is not None, "the truth", _DOWN_S)
        with contextlib.suppress(FlightFailedError):  # the judge allows for an estimate that stays wrong
            self.wait_for(lambda: estimate_error_m(self.record, time.monotonic()) < _SURE_M, "the estimate", _SURE_S)

    def is_up(self) -> bool:
        """Returns whether it is high enough to have ended its take-off."""
        return self.truth.place is not None and self.truth.place[2] > _UP_M

    def is_down(self) -> bool:
        """Returns whether it is where it stood when the flight began, by the truth."""
        truth = self.record.truth
        return bool(truth) and truth[-1].place[2] - truth[0].place[2] < _DOWN_M

    def has_sunk(self) -> bool:
        """Returns whether it was below the ground, which PX4's simulator does not always have."""
        heights_m = [each.place[2] for each in self.record.truth]
        return bool(heights_m) and heights_m[0] - min(heights_m) > _SUNK_M

    def is_astray(self) -> bool:
        """Returns whether it stands where a flight cannot begin: somebody else has flown it there."""
        place = self.truth.place or (0.0, 0.0, 0.0)
        return max(abs(place[0]), abs(place[1])) > AREA_M + _ASTRAY_M

    def set_parameters(self) -> None:
        """Sets the parameters that faults may have changed."""
        for name, value in _PARAMETERS[self.options.autopilot].items():
            self.pilot.set_parameter(name, value)
        if self.options.autopilot == "ardupilot":
            self.pilot.order(_NO_RESET, (255.0, 100.0))

    def reboot(self) -> None:
        """Reboots the autopilot: by its own command, or by starting its simulator anew."""
        self.pilot.close()
        if self.simulator is not None:
            self.simulator.end()
            self.simulator.start()
        else:
            raise FlightFailedError("no command to start the simulator")
        self.truth.place, self.must_boot = None, False
        self.pilot = self._make_pilot()
        self.set_parameters()
        self._ears.renew()

    def bring_down(self) -> None:
        """Lands and disarms it, whatever has happened.

        Raises:
            FlightFailedError: It could not be brought down.

        """
        self.wiretap.faults = GOOD
        self.daemon.signal(signal.SIGCONT)
        if not self.daemon.is_running:
            self.start_daemon()
        self.pilot.stand_by()
        until_s = time.monotonic() + _DOWN_S
        while self.pilot.is_armed:
            if time.monotonic() > until_s:
                raise FlightFailedError(f"it could not be landed: {self.state()}")
            if self.state() == "FLYING_MANUAL":
                self.call("recover", (1.0,))
            elif self.state() == "FLYING_AUTO":
                self.call("land")
            elif self.state() == "LANDED_ARMED":
                self.pilot.disarm()
            if self.is_down():  # it has fallen, and may be taken for flying
                self.pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, _FORCE))
            time.sleep(0.2)
        if not self.is_down():  # disarmed in the air
            time.sleep(_FALLEN_S)
        if self.record.said and self.daemon.is_running:
            with contextlib.suppress(FlightFailedError):  # the judge finds a state that stays untrue
                self.wait_for(lambda: self.state() == "LANDED_DISARMED", "LANDED_DISARMED", 3.0)

    def wait_for(self, is_done: Callable[[], bool], what: str, limit_s: float) -> None:
        until_s = time.monotonic() + limit_s
        while not is_done():
            if time.monotonic() > until_s:
                raise FlightFailedError(f"{what} did not come; the state is {self.state()}")
            time.sleep(0.02)

    def begin_trouble(self, kind: str) -> Callable[[], None]:
        """Notes that a fault begins; call what is returned when it ends."""
        began_s = time.monotonic()
        index = len(self.record.troubles)
        troubles = self.record.troubles
        troubles.append(Trouble(kind, began_s, math.inf))

        def end() -> None:
            troubles[index] = Trouble(kind, began_s, time.monotonic())

        return end

    def _make_pilot(self) -> Transmitter:
        until_s = time.monotonic() + _BOOT_S
        while True:
            try:
                pilot = self.options.make_pilot()
                break
            except OSError:
                if time.monotonic() > until_s:
                    raise FlightFailedError("the simulator does not listen") from None
                time.sleep(0.5)
        try:
            pilot.begin()
        except AssertionError as error:
            pilot.close()
            raise FlightFailedError(str(error)) from None
        except BaseException:  # the campaign is ended: its thread would keep the process
            pilot.close()
            raise
        return pilot


def take_mode(rig: Rig, main: float, sub: float = 0.0) -> None:
    """A ground station changes the mode, once."""
    flag = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
    rig.pilot.order(mavlink.MAV_CMD_DO_SET_MODE, (flag, main, sub))
