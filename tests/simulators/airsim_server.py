"""A small AirSim: its RPC server (MessagePack-RPC over TCP) with some vehicles, and faults.

Its time advances by a fixed step whenever the first vehicle's state is read: a test on a busy computer only takes
longer. Nothing else waits for time but calls that last (``moveByVelocity``), which are answered when they end.
"""

from __future__ import annotations

import json
import math
import selectors
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec
from typing_extensions import Self

from tests.simulators.airsim import STEP_S, Vehicle
from tests.simulators.airsim_cameras import AirsimCameras, CrashedError, RefusedError
from tests.simulators.physics import Target
from ual_daemon.backends.airsim.framing import message_end

EPOCH_S = 1_700_000_000.0
_SPARE_WORKERS = 4
_POLLED = ("getMultirotorState", "getRotorStates", "isApiControlEnabled", "simGetCollisionInfo")
_OFTEN = (*_POLLED, "moveByVelocity", "moveByRC")
"""Calls that are too frequent to be noted."""


class Peer:
    """One connection."""

    def __init__(self, accepted: socket.socket) -> None:
        self.socket = accepted
        self.received = bytearray()
        self.is_open = True

    def answer(self, number: int, error: object, result: object) -> None:
        if self.is_open:
            try:
                self.socket.sendall(msgspec.msgpack.encode((1, number, error, result)))
            except OSError:
                self.is_open = False


class AirsimServer:
    """Serves from one thread until it is closed. `port` 0 takes any."""

    def __init__(
        self, vehicles: list[Vehicle], port: int = 0, *, steps_per_poll: int = 2, clock_speed: float = 5.0
    ) -> None:
        self.vehicles = {each.name: each for each in vehicles}
        self.epoch_s = EPOCH_S
        self.is_paused = False
        self.is_silent = False
        """Takes requests and answers nothing, until this is False again: then all at once, late."""
        self.on_step: Callable[[], object] = list
        """Called before each step of its time, by the thread that steps it."""
        self.cameras = AirsimCameras(self)
        self.calls: list[tuple[str, tuple[Any, ...]]] = []
        self._late: list[Callable[[], None]] = []
        self._steps_per_poll = steps_per_poll
        self._clock_speed = clock_speed
        self._methods: dict[str, Callable[..., Any]] = {
            "getMultirotorState": self._get_multirotor_state,
            "getRotorStates": self._get_rotor_states,
            "isApiControlEnabled": self._is_api_control_enabled,
            "simGetCollisionInfo": self._sim_get_collision_info,
            "enableApiControl": self._enable_api_control,
            "armDisarm": self._arm_disarm,
            "moveByRC": self._move_by_rc,
            "listVehicles": self._list_vehicles,
            "getHomeGeoPoint": self._get_home_geo_point,
            "getServerVersion": self._get_server_version,
            "getSettingsString": self._get_settings_string,
            "simPause": self._sim_pause,
            "simIsPaused": self._sim_is_paused,
            "simContinueForTime": self._sim_continue_for_time,
            "simSetWind": self._sim_set_wind,
            "simSetKinematics": self._sim_set_kinematics,
            "simGetImages": self.cameras.get_images,
            "simGetCameraInfo": self.cameras.get_camera_info,
        }
        self.forgets_count = 0
        """Number of the next velocities that it never answers."""
        self._unrendered: list[tuple[Peer, int, list[Any]]] = []
        self._paused_moves: list[Callable[[], None]] = []
        self._pending = 0
        self._waiting: list[tuple[Peer, int, str, list[Any]]] = []
        self._lock = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.setblocking(False)
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="airsim server", daemon=True)
        self.port = int(self._listener.getsockname()[1])
        self._thread.start()

    @property
    def pending_count(self) -> int:
        """Calls under way."""
        return self._pending

    @property
    def url(self) -> str:
        return f"127.0.0.1:{self.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends as a killed simulator does: all its connections close."""
        self._is_closing = True
        self._thread.join()

    def run(self, duration_s: float) -> None:
        """Lets time pass, and serves what comes meanwhile at its moment."""
        for _ in range(round(duration_s / STEP_S)):
            with self._lock:
                self._serve_ready()
                self._advance(1)

    def render(self) -> None:
        """Renders again, and answers what has waited for that."""
        with self._lock:
            self.cameras.renders = True
            for peer, number, arguments in self._unrendered:
                self._pending -= 1
                self._answer(peer, number, None, self.cameras.get_images(*arguments))
            self._unrendered.clear()

    def drop_connections(self) -> None:
        """Closes all connections, and goes on."""
        with self._lock:
            for key in list((self._selector.get_map() or {}).values()):  # none once it has ended
                if isinstance(key.data, Peer):
                    with suppress(OSError):  # it has ended by itself
                        key.data.socket.shutdown(socket.SHUT_RDWR)

    def _run(self) -> None:
        try:
            while not self._is_closing:
                self._selector.select(0.02)  # waits only: `run` may serve it first, and close it
                with self._lock:
                    self._serve_ready()
                    if not self.is_silent:
                        late, self._late = self._late, []
                        for answer in late:
                            answer()
        finally:  # else its clients would wait for one that has died
            self._end()

    def _end(self) -> None:
        with self._lock:
            self._is_closing = True
            for key in list(self._selector.get_map().values()):
                key.fileobj.close()  # type: ignore[union-attr]
            self._selector.close()

    def _serve_ready(self) -> None:
        """Serves what has come. Called with the lock held."""
        if not self._is_closing:
            for key, _ in self._selector.select(0.0):
                self._serve(key.data)

    def _serve(self, peer: Peer | None) -> None:
        if peer is None:
            accepted, _ = self._listener.accept()
            accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._selector.register(accepted, selectors.EVENT_READ, Peer(accepted))
            return
        try:
            data = peer.socket.recv(1 << 16, socket.MSG_DONTWAIT)
        except OSError:
            data = b""
        if not data:
            peer.is_open = False
            self._selector.unregister(peer.socket)
            peer.socket.close()
            return
        peer.received += data
        while (end := message_end(peer.received)) is not None and end:
            _, number, method, arguments = msgspec.msgpack.decode(bytes(peer.received[:end]))
            del peer.received[:end]
            self._begin(peer, number, method, arguments)

    def _begin(self, peer: Peer, number: int, method: str, arguments: list[Any]) -> None:
        """Executes a call if one of the server's threads is free."""
        if self._pending >= len(self.vehicles) + _SPARE_WORKERS:
            self._waiting.append((peer, number, method, arguments))
            return
        if method not in _OFTEN:
            self.calls.append((method, tuple(arguments)))
        if method == "moveByVelocity":
            self._move(peer, number, arguments)
            return
        if method == "simGetImages" and not self.cameras.renders:
            self._pending += 1  # its thread waits for the picture
            self._unrendered.append((peer, number, arguments))
            return
        if method not in self._methods:
            words = f"rpclib: server could not find function '{method}' with argument count 1."
            self._answer(peer, number, words, None)
            return
        try:
            result = self._methods[method](*arguments)
        except CrashedError:
            self._is_closing = True
        except RefusedError as error:
            self._answer(peer, number, str(error), None)
        except KeyError:
            words = f"Vehicle API for '{arguments[-1]}' is not available."
            prefix = f"rpclib: function '{method}' threw an exception. The exception contained this information: "
            self._answer(peer, number, prefix + words, None)
        else:
            self._answer(peer, number, None, result)

    def _answer(self, peer: Peer, number: int, error: object, result: object) -> None:
        if self.is_silent:
            self._late.append(lambda: peer.answer(number, error, result))
        else:
            peer.answer(number, error, result)

    def _move(self, peer: Peer, number: int, arguments: list[Any]) -> None:
        north, east, down, duration_s, _, yaw_mode, name = arguments
        vehicle = self.vehicles[name]
        target = Target((None, None, None), (north, east, down), yaw_rate_rad_s=math.radians(yaw_mode["yaw_or_rate"]))
        self._pending += 1

        def ended(result: bool) -> None:
            self._pending -= 1
            self._answer(peer, number, None, result)
            if self._waiting:
                self._begin(*self._waiting.pop(0))

        if self.forgets_count:
            self.forgets_count -= 1
        elif self.is_paused:  # no call ends while time stands still, and this one waits for the one before
            self._paused_moves.append(lambda: vehicle.move(target, duration_s, ended))
        else:
            vehicle.move(target, duration_s, ended)

    def _go_on(self) -> None:
        """Begins what waited for the time to go on."""
        moves, self._paused_moves = self._paused_moves, []
        for move in moves:
            move()

    def _advance(self, steps: int) -> None:
        for _ in range(steps):
            self.on_step()
            for vehicle in self.vehicles.values():
                vehicle.step()

    # --- The methods: see `_methods` ----------------------------------------------------------------------------------

    def _get_multirotor_state(self, name: str) -> dict[str, Any]:
        vehicle = self.vehicles[name]
        if vehicle is next(iter(self.vehicles.values())) and not self.is_paused and not self.is_silent:
            self._advance(self._steps_per_poll)
        return vehicle.state(self.epoch_s)

    def _sim_get_collision_info(self, name: str) -> dict[str, Any]:
        return self.vehicles[name].read_collision(self.epoch_s)

    def _get_rotor_states(self, name: str) -> dict[str, Any]:
        return self.vehicles[name].rotors()

    def _is_api_control_enabled(self, name: str) -> bool:
        return self.vehicles[name].has_api_control

    def _enable_api_control(self, is_enabled: bool, name: str) -> None:
        self.vehicles[name].enable_api_control(is_enabled)

    def _arm_disarm(self, arms: bool, name: str) -> bool:
        vehicle = self.vehicles[name]
        return vehicle.arm() if arms else vehicle.disarm()

    def _move_by_rc(self, data: dict[str, Any], name: str) -> None:
        vehicle = self.vehicles[name]
        if vehicle.keeps_rc:
            vehicle.rc = data

    def _list_vehicles(self) -> list[str]:
        return list(self.vehicles)

    def _get_home_geo_point(self, name: str) -> dict[str, float]:
        latitude, longitude, altitude = self.vehicles[name].home
        return {"latitude": latitude, "longitude": longitude, "altitude": altitude}

    def _get_server_version(self) -> int:
        return 4

    def _get_settings_string(self) -> str:
        return json.dumps({"SettingsVersion": 2.0, "ClockSpeed": self._clock_speed, **self.cameras.settings})

    def _sim_pause(self, is_paused: bool) -> None:
        self.is_paused = is_paused
        if not is_paused:
            self._go_on()

    def _sim_is_paused(self) -> bool:
        return self.is_paused

    def _sim_continue_for_time(self, duration_s: float) -> None:
        self._go_on()
        self._advance(round(duration_s / STEP_S))

    def _sim_set_wind(self, wind: dict[str, float]) -> None:
        for vehicle in self.vehicles.values():
            vehicle.wind = (wind["x_val"], wind["y_val"], wind["z_val"])

    def _sim_set_kinematics(self, state: dict[str, Any], _: bool, name: str) -> None:
        position, rotation = state["position"], state["orientation"]
        yaw_rad = 2.0 * math.atan2(rotation["z_val"], rotation["w_val"])
        self.vehicles[name].current_position((position["x_val"], position["y_val"], position["z_val"]), yaw_rad)
