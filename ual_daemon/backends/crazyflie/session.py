"""The conversation with one Crazyflie, and the thread that receives."""

from __future__ import annotations

import logging
import struct
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from ual.errors import RejectedByAutopilotError
from ual.geometry import Pose, Vector3
from ual_daemon.backends import futures
from ual_daemon.backends.base import UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.crazyflie import connecting
from ual_daemon.backends.crazyflie.arming import Arming
from ual_daemon.backends.crazyflie.commander import Commander, Phase
from ual_daemon.backends.crazyflie.connecting import ASK_VERSION, Firmware
from ual_daemon.backends.crazyflie.encoder import Encoder, rest
from ual_daemon.backends.crazyflie.links import Link, LinkError, UdpLink, vehicle_key
from ual_daemon.backends.crazyflie.packets import CONSOLE, LOG, LOG_DATA_CHANNEL, Packet
from ual_daemon.backends.crazyflie.requests import Requests
from ual_daemon.backends.crazyflie.settings import CrazyflieSettings
from ual_daemon.backends.crazyflie.supervision import LinkState, Supervision
from ual_daemon.backends.crazyflie.supervisor import troubles, why_not_disarm, why_not_fly
from ual_daemon.backends.crazyflie.telemetry import Telemetry
from ual_daemon.backends.crazyflie.toc import TocCache
from ual_daemon.backends.crazyflie.values_reader import ValuesReader
from ual_daemon.backends.crazyflie.vehicle import describe
from ual_daemon.backends.values import Setpoint, Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

TICK_S = 0.02
"""The longest wait for packets: commands of other threads wait for as long at most."""
UPDATE_S = 0.05
"""The longest interval between two updates, whatever comes."""

_NEW_S = 0.15
"""An older pose does not say where it is now."""


class Session:
    """Runs on one thread until it is closed. `snapshot`, `firmware`, `version` and `post` are for any thread."""

    def __init__(
        self,
        link: Link,
        settings: CrazyflieSettings,
        clock: MonotonicClock,
        on_update: UpdateCallback,
        *,
        is_watch_only: bool = False,
    ) -> None:
        self.firmware = Firmware()
        self.info = VehicleInfo()
        self.telemetry = Telemetry(settings.largest_position_std_m)
        self.commander = Commander(link.send, link.send_now, hovers_by_itself=settings.hovers_by_itself)
        self._arming = Arming(link.send, self.telemetry)
        self._settings = settings
        self._is_simulation = isinstance(link, UdpLink)
        self._link = link
        self._clock = clock
        self._on_update = on_update
        self._requests = Requests(link.send)
        self._reader = ValuesReader(self.telemetry)
        cache = TocCache(settings.cache_directory)
        make_steps = partial(connecting.steps, settings, cache, is_watch_only=is_watch_only)
        self._supervision = Supervision(link, self._requests, make_steps, self._use)
        self._describe("")
        self._updated_s = self._looked_s = clock.now_s()
        self._posted: deque[Callable[[float], None]] = deque()
        self._closing = threading.Event()
        self._failure = ""
        self.snapshot = Snapshot(self._updated_s)

    def run(self) -> None:
        """Receives until it is closed."""
        try:
            while not self._closing.is_set():
                self._turn()
        finally:
            self._supervision.close()

    def close(self) -> None:
        """Ends `run`."""
        self._closing.set()

    def post(self, action: Callable[[float], None]) -> None:
        """Has an action done by the thread that receives; it gets the time."""
        self._posted.append(action)

    @property
    def is_connected(self) -> bool:
        """Whether its values come."""
        return self._supervision.state is LinkState.CONNECTED

    # --- Commands, from any thread ------------------------------------------------------------------------------------

    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint."""
        now_s, pose = self._clock.now_s(), self.telemetry.pose
        is_new = pose is not None and now_s - pose.time_s <= _NEW_S
        self.commander.send(setpoint, now_s, pose.value.position if pose is not None and is_new else None)

    def set_armed(self, *, is_armed: bool) -> Future[None]:
        """Arms or disarms; the future ends with the effect. Raises `RejectedByAutopilotError`."""
        telemetry = self.telemetry
        info, power_state, is_on_ground = telemetry.supervisor, telemetry.power_state, telemetry.is_on_ground
        _refuse("; ".join(troubles(info, power_state)) if is_armed else why_not_disarm(info, is_on_ground=is_on_ground))
        future: Future[None] = Future()
        self.post(lambda now_s: self._arming.begin(future, now_s, is_armed=is_armed))
        return future

    def take_off(self) -> Future[None]:
        """Lets setpoints fly. Raises `RejectedByAutopilotError`."""
        _refuse(why_not_fly(self.telemetry.supervisor, self.telemetry.power_state))
        return self.take_control()

    def take_control(self) -> Future[None]:
        """Lets setpoints fly."""
        self.commander.take_control()
        return futures.done()

    def hold(self) -> Future[None]:
        """Has it stop and hover by itself. Raises `RejectedByAutopilotError`."""
        pose, velocity = self._motion()
        return self.commander.hand_over(
            Phase.HOLDING, self.commander.encoder.stop(pose, velocity), rest(pose, velocity)
        )

    def land(self, descent_speed_m_s: float) -> Future[None]:
        """Has it land by itself. Raises `RejectedByAutopilotError`."""
        pose, velocity = self._motion()
        ground_z = self.telemetry.ground.landing_z_m(pose.position)
        request = self.commander.encoder.land(pose.position.z, ground_z, descent_speed_m_s)
        return self.commander.hand_over(Phase.LANDING, request, rest(pose, velocity))

    def _motion(self) -> tuple[Pose, Vector3]:
        pose, velocity = self.telemetry.pose, self.telemetry.velocity
        _refuse("its pose is not known" if pose is None or velocity is None else "")
        assert pose is not None
        assert velocity is not None
        return pose.value, velocity.value.linear

    # --- One turn -----------------------------------------------------------------------------------------------------

    def _turn(self) -> None:
        """Does one turn. No error ends the thread: whatever fails is logged, and the link is opened anew."""
        try:
            has_pose = self._talk()
        except Exception as error:  # noqa: BLE001  logged with its traceback
            has_pose = False
            self._log_failure("the conversation with the Crazyflie failed", error)
            self._supervision.reopen(str(error) or repr(error), self._clock.now_s())
            self.commander.on_lost()
        try:
            self._update_if_due(self._clock.now_s(), has_pose=has_pose)
        except Exception as error:  # noqa: BLE001  logged; the link is not at fault, and it may be in the air
            self._log_failure("an update of the Crazyflie failed", error)

    def _talk(self) -> bool:
        """Receives, and sends what is due. Returns whether a new pose has come."""
        was_connected = self.is_connected
        has_pose = self._receive()
        now_s = self._clock.now_s()
        while self._posted:
            self._posted.popleft()(now_s)
        self._supervision.step(now_s, self._reader.motion_s)
        if was_connected and not self.is_connected:
            self.commander.on_lost()
        if self._reader.has_rebooted:
            self._reader.has_rebooted = False
            self.commander.on_reboot()
        if self.is_connected and not self._reader.is_boot_open:  # one that has booted is not in the air any more
            self.commander.step(self._requests, now_s, self._flying(), touches=self.telemetry.contact.touches)
            self._arming.step(now_s, self.firmware.protocol)
        self._requests.step(now_s)
        return has_pose

    def _update_if_due(self, now_s: float, *, has_pose: bool) -> None:
        if has_pose or now_s - self._updated_s >= UPDATE_S:
            self._update(now_s)
            self.commander.finish()

    def _log_failure(self, what: str, error: Exception) -> None:
        """Logs an error with its traceback, unless it is the same as the last one."""
        words = repr(error)
        if words != self._failure:
            self._failure = words
            _log.error("%s; this is a defect of UAL, please report it", what, exc_info=error)

    def _flying(self) -> tuple[Pose, Vector3] | None:
        """Its pose and velocity; None if it is not known to be in the air."""
        pose, velocity = self.telemetry.pose, self.telemetry.velocity
        if pose is None or velocity is None or self.telemetry.is_on_ground:
            return None
        return pose.value, velocity.value.linear

    def _receive(self) -> bool:
        """Receives what has come. Returns whether a new pose was among it."""
        before = self.telemetry.pose
        if self._supervision.state is LinkState.OPENING:
            self._closing.wait(TICK_S)
            self._looked_s = self._clock.now_s()  # nothing can come yet
            return False
        try:
            received = self._link.receive(TICK_S)
        except LinkError as error:
            self._supervision.reopen(str(error), self._clock.now_s())
            return False
        now_s = self._looked_s = self._clock.now_s()
        for packet in received:
            self.telemetry.heard_s = now_s
            try:
                self._take(packet, now_s)
            except (ValueError, LookupError, struct.error) as error:  # it may be in the air: the others still count
                self._log_failure("a packet of the Crazyflie was dropped", error)
        return self.telemetry.pose is not before

    def _take(self, packet: Packet, now_s: float) -> None:
        if packet.port == LOG and packet.channel == LOG_DATA_CHANNEL:
            if self._supervision.state is not LinkState.CONNECTING:  # they may be of another boot, whose blocks are new
                self._reader.take(packet.data, now_s, self._clock.utc_s())
        elif packet.port == CONSOLE:
            self.telemetry.on_console(packet.data)
        elif not self._requests.take(packet):
            self._arming.take(packet)

    def _use(self, firmware: Firmware, is_new: bool) -> None:
        """Uses what was learned of a firmware."""
        self.firmware = firmware
        if is_new:
            self.telemetry.parameters = firmware.parameters
            self.commander.encoder = Encoder(firmware.protocol, firmware.parameters)
            self._reader.use(firmware.blocks)
            self._describe("")
            self._requests.add(ASK_VERSION, self._take_version)

    def _take_version(self, data: bytes) -> None:
        self._describe(data[1:].split(b"\0")[0].decode("ascii", "replace"))

    def _describe(self, version: str) -> None:
        url = self._link.url
        self.info = describe(
            self.firmware.parameters,
            self._settings.yaw_rate_rad_s,
            version,
            f"crazyflie {vehicle_key(url)}" if self.is_connected and url else "",
            is_simulation=self._is_simulation,
        )

    def _update(self, now_s: float) -> None:
        self._updated_s = now_s
        connecting_words = "" if self.is_connected else self._supervision.words
        snapshot = self.telemetry.snapshot(now_s, self.commander.mode, connecting_words)
        self.snapshot = snapshot._replace(updated_s=self._looked_s, link_trouble=connecting_words)
        self._on_update(self.snapshot)


def _refuse(why: str) -> None:
    if why:
        raise RejectedByAutopilotError(f"the Crazyflie refuses: {why}", {"text": why})
