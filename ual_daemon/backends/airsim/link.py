"""Reads the vehicle's state repeatedly, and reconnects for ever."""

from __future__ import annotations

import json
import logging
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import msgspec

from ual_daemon import logs
from ual_daemon.backends.airsim.camera_settings import NamedCamera, cameras_of
from ual_daemon.backends.airsim.rpc import RemoteError, RpcConnection
from ual_daemon.backends.airsim.settings import AirsimAddress
from ual_daemon.backends.airsim.state import AirsimReport, Collision, Location, MultirotorState, Rotors

_log = logging.getLogger(__name__)

_RETRY_S = 0.1
_ANSWER_TIMEOUT_S = 3.0
"""Seconds without an answer after which a connection is made again."""
_CALL_S = 2.0
_QUESTIONS: tuple[tuple[type, str], ...] = (
    (MultirotorState, "getMultirotorState"),
    (Rotors, "getRotorStates"),
    (bool, "isApiControlEnabled"),
)
"""Questions of a poll, one after another: the simulator delays answers that follow each other."""
_COLLISION = (Collision, "simGetCollisionInfo")
_COLLISION_S = 0.2
"""Seconds between two questions for collisions. Each answer resets `has_collided`, by which the vehicle bounces at the
next frame.
"""


class Simulator(msgspec.Struct, frozen=True):
    """Findings of a connection: all vehicles, the one to fly, its home, the speed of time, the version, cameras."""

    vehicles: tuple[str, ...]
    vehicle: str
    home: Location
    clock_speed: float
    version: str
    cameras: tuple[NamedCamera, ...] = ()


class WrongVehicleError(Exception):
    """The simulator has no such vehicle, or several; the message says it, human-readable."""


class SimulatorLink:
    """Connects, and polls. For the thread that calls `receive`; others may read its attributes."""

    def __init__(
        self,
        address: AirsimAddress,
        vehicle_name: str,
        rate_hz: float,
        connect: Callable[[AirsimAddress], RpcConnection],
        wall_s: Callable[[], float],
    ) -> None:
        self.on_connect: Callable[[bool], None]
        """Called after each connection, before its first report, with whether it is to a simulator that was started."""
        self.address = address
        self._vehicle_name = vehicle_name
        self._period_s = 1.0 / rate_hz
        self._make_connection = connect
        self._wall_s = wall_s
        self._waking = threading.Event()
        self._is_closing = False
        self._connection: RpcConnection | None = None
        self._due_s = -math.inf
        """Time of the next poll or connection attempt."""
        self._number: int | None = None
        """The question that is unanswered."""
        self._questions = _QUESTIONS
        """Questions of the poll in progress."""
        self._answers: list[Any] = []
        self._polls_count = 0
        self._polls_per_collision = max(1, round(_COLLISION_S * rate_hz))
        self._collision = Collision()
        self._requested_s = 0.0
        self._is_old = False
        self._was_refused, self._was_connected = False, False
        self.simulator: Simulator | None = None
        """None until the first connection; then what the newest one has found."""
        self.is_up = False
        self.why_not = ""
        """Why no vehicle is flown although the simulator answers; empty if one is."""
        self.trouble = "no simulator was found yet"
        """Why the simulator does not answer; empty while it does."""

    def wake(self) -> None:
        """Ends the wait between two polls. From any thread."""
        self._waking.set()

    def close(self) -> None:
        """Ends each wait of `receive`, which connects no more. From any thread."""
        self._is_closing = True
        self.wake()
        connection = self._connection
        if connection is not None:
            connection.close()

    def receive(self, timeout_s: float) -> AirsimReport | None:
        """Goes on for about so long: connects, or polls. Returns the report of a poll once it is complete."""
        if not self._is_due(timeout_s):
            return None
        try:
            if self._connection is not None:
                return self._poll(self._connection, timeout_s)
            self._connect()
        except (OSError, ValueError, RemoteError, WrongVehicleError) as error:
            self.lose(error)
        return None

    def discard(self) -> None:
        """Has the poll that is in progress reported no more: it was begun before a pause of this computer."""
        self._is_old = self._number is not None

    def lose(self, error: Exception) -> None:
        """Closes the connection because of an error, and says what that means."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
        self._number = None
        self._polls_count = 0
        self._answers.clear()
        self._due_s = time.monotonic() + _RETRY_S
        self._say_lost(error)

    def _is_due(self, timeout_s: float) -> bool:
        """Waits until the next poll is due, for so long at most, or until it is woken."""
        if self._number is None:
            self._waking.wait(min(max(0.0, self._due_s - time.monotonic()), timeout_s))
            self._waking.clear()
        return not self._is_closing and (self._number is not None or time.monotonic() >= self._due_s)

    def _connect(self) -> None:
        self._connection = self._make_connection(self.address)
        self.simulator = self._identify(self._connection)
        self._connected(self.simulator)

    def _poll(self, connection: RpcConnection, timeout_s: float) -> AirsimReport | None:
        if self._number is None:
            assert self.simulator is not None
            self._is_old, self._due_s = False, time.monotonic() + self._period_s / self.simulator.clock_speed
            self._questions = self._next_questions()
            self._ask(connection)
        assert self._number is not None
        while connection.has_answer(self._number, timeout_s):
            self._answers.append(connection.answer(self._questions[len(self._answers)][0], self._number, 0.0))
            if len(self._answers) == len(self._questions):
                return self._end_poll()
            self._ask(connection)
        if self._wall_s() - self._requested_s > _ANSWER_TIMEOUT_S:
            raise TimeoutError(f"the simulator has not answered for {_ANSWER_TIMEOUT_S:g} s")
        return None

    def _next_questions(self) -> tuple[tuple[type, str], ...]:
        """Returns what the next poll asks; the first one requests the collision, too."""
        asks_collision = self._polls_count % self._polls_per_collision == 0
        self._polls_count += 1
        return (*_QUESTIONS, _COLLISION) if asks_collision else _QUESTIONS

    def _ask(self, connection: RpcConnection) -> None:
        assert self.simulator is not None
        method = self._questions[len(self._answers)][1]
        self._number, self._requested_s = connection.request(method, self.simulator.vehicle), self._wall_s()

    def _end_poll(self) -> AirsimReport | None:
        if len(self._answers) > len(_QUESTIONS):
            self._collision = self._answers.pop()
        state, rotors, has_api_control = self._answers
        report = AirsimReport(state, rotors, has_api_control, self._collision)
        self._number = None
        self._answers.clear()
        return None if self._is_old else report

    def _identify(self, connection: RpcConnection) -> Simulator:
        vehicles = tuple(connection.call(list[str], _CALL_S, "listVehicles"))
        vehicle = self._chosen(vehicles)
        home = connection.call(Location, _CALL_S, "getHomeGeoPoint", vehicle)
        version = connection.call(int, _CALL_S, "getServerVersion")
        settings = connection.call(str, _CALL_S, "getSettingsString")
        cameras = cameras_of(settings, vehicle)
        return Simulator(vehicles, vehicle, home, _clock_speed(settings), f"API version {version}", cameras)

    def _chosen(self, vehicles: tuple[str, ...]) -> str:
        names = ", ".join(vehicles) or "none"
        if self._vehicle_name and self._vehicle_name not in vehicles:
            raise WrongVehicleError(f"the simulator has no vehicle {self._vehicle_name!r}; it has {names}")
        if not self._vehicle_name and len(vehicles) != 1:
            raise WrongVehicleError(f"set airsim.vehicle_name: the simulator's vehicles are {names}")
        return self._vehicle_name or vehicles[0]

    def _connected(self, simulator: Simulator) -> None:
        self.on_connect(self._was_refused or not self._was_connected)
        self._was_connected, self._was_refused, self.is_up, self.why_not = True, False, True, ""
        self.trouble = ""
        logs.event(_log, logging.INFO, "simulator_connected", url=str(self.address), vehicle=simulator.vehicle)

    def _say_lost(self, error: Exception) -> None:
        self._was_refused = self._was_refused or isinstance(error, ConnectionRefusedError)
        system = error.strerror if isinstance(error, OSError) else None
        why = self.trouble = f"{self.address}: {system}" if system else str(error) or repr(error)
        if isinstance(error, OSError):
            self.why_not = ""  # nobody answers: the last report of the vehicle is old
        elif isinstance(error, (RemoteError, WrongVehicleError)):
            self._say_why_not(why)
        elif not self.is_up:  # one damaged answer in flight is no reason yet: the connection is made again
            whose = "its answers are not those of AirSim" if isinstance(error, ValueError) else "a defect of UAL"
            self._say_why_not(f"{whose}: {why}")
        if self.is_up and not self._is_closing:
            logs.event(_log, logging.WARNING, "simulator_lost", url=str(self.address), why=why)
        self.is_up = False

    def _say_why_not(self, why: str) -> None:
        """Notes why the simulator, which answers, offers no vehicle."""
        if why != self.why_not:
            logs.event(_log, logging.WARNING, "vehicle_not_found", url=str(self.address), why=why)
        self.why_not = why


def _clock_speed(settings: str) -> float:
    """Returns ``ClockSpeed`` of the simulator's settings.json."""
    try:
        speed = float(json.loads(settings).get("ClockSpeed", 1.0))
    except (ValueError, TypeError, AttributeError):
        return 1.0
    return min(max(speed, 0.1), 20.0)
