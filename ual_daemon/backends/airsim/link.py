"""Reads the vehicle's state again and again, and reconnects for ever."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import msgspec

from ual_daemon import logs
from ual_daemon.backends.airsim.rpc import Connection, RemoteError
from ual_daemon.backends.airsim.settings import Address
from ual_daemon.backends.airsim.state import Location, Report, Rotors, State

_log = logging.getLogger(__name__)

T = TypeVar("T")

_UPDATE_S = 0.1
"""Updates come at least this often, with or without data."""
_RETRY_S = 0.1
_GIVE_UP_S = 3.0
"""A connection that has not answered for so long is made anew."""
_CALL_S = 2.0


class Simulator(msgspec.Struct, frozen=True):
    """What a connection has found: all vehicles, the one to fly, its home, how fast time runs, and the version."""

    vehicles: tuple[str, ...]
    vehicle: str
    home: Location
    clock_speed: float
    version: str


class WrongVehicleError(Exception):
    """The simulator has no such vehicle, or several; the message says it, human-readable."""


class SimulatorLink:
    """One thread, which connects, polls, and calls `on_poll` after each answer, and every 0.1 s without one."""

    def __init__(
        self,
        address: Address,
        vehicle_name: str,
        rate_hz: float,
        on_connect: Callable[[], None],
        on_report: Callable[[Report], None],
        on_poll: Callable[[], None],
    ) -> None:
        """`on_connect` is called after each connection, before its first report."""
        self._address = address
        self._vehicle_name = vehicle_name
        self._period_s = 1.0 / rate_hz
        self._on_connect = on_connect
        self._on_report = on_report
        self._on_poll = on_poll
        self._closing = threading.Event()
        self._connection: Connection | None = None
        self._thread = threading.Thread(target=self._run, name=f"airsim {address}", daemon=True)
        self._was_refused = self._was_connected = False
        self._failure = ""
        self.simulator: Simulator | None = None
        """None until the first connection; then what the newest one has found."""
        self.is_up = False
        self.why_not = ""
        """Why no vehicle is flown although the simulator answers; empty if one is."""
        self.trouble = ""
        """Why the simulator does not answer; empty while it does."""
        self.starts_count = 0
        """How often the simulator was found to have been started anew."""

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread. It may call this itself."""
        self._closing.set()
        connection = self._connection
        if connection is not None:
            connection.close()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            self._turn()
            self._closing.wait(_RETRY_S)

    def _turn(self) -> None:
        """Connects, and polls until that fails. No error ends the thread."""
        try:
            self._connect_and_poll()
        except (OSError, ValueError, RemoteError, WrongVehicleError) as error:
            self._lost(error)
        except Exception as error:  # noqa: BLE001  logged with its traceback
            self._log_failure(error)
            self._lost(error)
        try:
            self._on_poll()
        except Exception as error:  # noqa: BLE001  logged with its traceback
            self._log_failure(error)

    def _log_failure(self, error: Exception) -> None:
        """Logs an error with its traceback, unless it is the same as the last one."""
        text = repr(error)
        if text != self._failure:
            self._failure = text
            _log.error("the link to AirSim failed; this is a defect of UAL, please report it", exc_info=error)

    def _connect_and_poll(self) -> None:
        self._connection = connection = Connection(self._address)
        try:
            self.simulator = self._identify(connection)
            self._connected()
            while not self._closing.is_set():
                begun_s = time.monotonic()
                self._poll(connection, self.simulator.vehicle)
                self._on_poll()
                period_s = self._period_s / self.simulator.clock_speed
                self._closing.wait(max(0.0, begun_s + period_s - time.monotonic()))
        finally:
            connection.close()

    def _poll(self, connection: Connection, vehicle: str) -> None:
        """Reads the state once: one request after another, as the simulator delays answers that follow each other."""
        state = self._ask(connection, State, "getMultirotorState", vehicle)
        rotors = self._ask(connection, Rotors, "getRotorStates", vehicle)
        has_api_control = self._ask(connection, bool, "isApiControlEnabled", vehicle)
        self._on_report(Report(state, rotors, has_api_control))

    def _ask(self, connection: Connection, kind: type[T], method: str, vehicle: str) -> T:
        """Calls a method, with updates while no answer comes."""
        number = connection.request(method, vehicle)
        self._wait(connection, number)
        return connection.answer(kind, number, _CALL_S)

    def _wait(self, connection: Connection, number: int) -> None:
        """Waits for an answer, with updates meanwhile.

        Raises:
            TimeoutError: None came for long.
        """
        deadline_s = time.monotonic() + _GIVE_UP_S
        while not connection.has_answer(number, _UPDATE_S):
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"the simulator has not answered for {_GIVE_UP_S:g} s")
            self._on_poll()

    def _identify(self, connection: Connection) -> Simulator:
        vehicles = tuple(connection.call(list[str], _CALL_S, "listVehicles"))
        vehicle = self._chosen(vehicles)
        home = connection.call(Location, _CALL_S, "getHomeGeoPoint", vehicle)
        version = connection.call(int, _CALL_S, "getServerVersion")
        speed = _clock_speed(connection.call(str, _CALL_S, "getSettingsString"))
        return Simulator(vehicles, vehicle, home, speed, f"API version {version}")

    def _chosen(self, vehicles: tuple[str, ...]) -> str:
        names = ", ".join(vehicles) or "none"
        if self._vehicle_name and self._vehicle_name not in vehicles:
            raise WrongVehicleError(f"the simulator has no vehicle {self._vehicle_name!r}; it has {names}")
        if not self._vehicle_name and len(vehicles) != 1:
            raise WrongVehicleError(f"set airsim.vehicle_name: the simulator's vehicles are {names}")
        return self._vehicle_name or vehicles[0]

    def _connected(self) -> None:
        assert self.simulator is not None
        if self._was_connected and self._was_refused:
            self.starts_count += 1
        self._on_connect()
        self._was_connected, self._was_refused, self.is_up, self.why_not = True, False, True, ""
        self.trouble = ""
        logs.event(_log, logging.INFO, "simulator_connected", url=str(self._address), vehicle=self.simulator.vehicle)

    def _lost(self, error: Exception) -> None:
        self._was_refused = self._was_refused or isinstance(error, ConnectionRefusedError)
        why = self.trouble = str(error) or repr(error)
        if isinstance(error, OSError):
            self.why_not = ""  # nobody answers: what was said of the vehicle is old
        elif isinstance(error, (RemoteError, WrongVehicleError)):
            self._say_why_not(why)
        elif not self.is_up:  # one damaged answer in flight is no reason yet: the connection is made anew
            whose = "its answers are not those of AirSim" if isinstance(error, ValueError) else "a defect of UAL"
            self._say_why_not(f"{whose}: {why}")
        if self.is_up and not self._closing.is_set():
            logs.event(_log, logging.WARNING, "simulator_lost", url=str(self._address), why=why)
        self.is_up = False

    def _say_why_not(self, why: str) -> None:
        """Notes why the simulator, which answers, offers no vehicle."""
        if why != self.why_not:
            logs.event(_log, logging.WARNING, "vehicle_not_found", url=str(self._address), why=why)
        self.why_not = why


def _clock_speed(settings: str) -> float:
    """Returns ``ClockSpeed`` of the simulator's settings.json."""
    try:
        speed = float(json.loads(settings).get("ClockSpeed", 1.0))
    except (ValueError, TypeError, AttributeError):
        return 1.0
    return min(max(speed, 0.1), 20.0)
