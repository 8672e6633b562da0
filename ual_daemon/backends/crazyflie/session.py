"""The conversation with one Crazyflie: what is done on the engine's thread."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import TypeAlias

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError
from ual.geometry import Pose, Vector3
from ual.parameters.values import Parameter
from ual_daemon.backends import futures
from ual_daemon.backends.base import UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.crazyflie import connecting, packets
from ual_daemon.backends.crazyflie.commander import MODES, Commander, Phase
from ual_daemon.backends.crazyflie.connecting import ASK_VERSION, CrazyflieFirmware
from ual_daemon.backends.crazyflie.encoder import Encoder, rest
from ual_daemon.backends.crazyflie.links import CrtpLink, CrtpLinkError, CrtpUdpLink, vehicle_key
from ual_daemon.backends.crazyflie.packets import CONSOLE, LOG, LOG_DATA_CHANNEL, CrtpPacket
from ual_daemon.backends.crazyflie.parameter_exchanges import ParameterExchanges
from ual_daemon.backends.crazyflie.requests import CrtpRequest, CrtpRequests
from ual_daemon.backends.crazyflie.settings import CrazyflieSettings
from ual_daemon.backends.crazyflie.supervision import CrazyflieLinkState, CrazyflieSupervision
from ual_daemon.backends.crazyflie.supervisor import SupervisorFlags, troubles, why_not_disarm, why_not_fly
from ual_daemon.backends.crazyflie.telemetry import CrazyflieTelemetry
from ual_daemon.backends.crazyflie.toc import TocCache
from ual_daemon.backends.crazyflie.values_reader import ValuesReader
from ual_daemon.backends.crazyflie.vehicle import describe
from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Repeat, Verdict, shows_armed
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import Loop, LoopThread, OnceLog
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot, VehicleInfo

TICK_S = 0.02
"""The longest wait for packets: commands of other threads wait for as long at most."""
_POSE_AGE_LIMIT_S = 0.15
"""An older pose does not say where it is now."""
_ARMING = Repeat(every_s=0.1, most=45)
"""Its firmware refuses to arm for 3 s after a landing: a refusal counts only when that has passed."""

Ask: TypeAlias = Callable[[Hashable], "Callable[[], object] | None"]
"""Sends a command, whose answer has this key. Returns what takes it back."""


class CrazyflieSession:
    """Belongs to the engine's thread, but for `send`, the commands, `info`, `firmware` and `is_connected`."""

    def __init__(
        self,
        link: CrtpLink,
        settings: CrazyflieSettings,
        clock: MonotonicClock,
        on_update: UpdateCallback,
        lost_s: float,
        *,
        name: str = "crazyflie",
        is_watch_only: bool = False,
    ) -> None:
        """Without values of its pose for `lost_s` the link is lost. `name` is the thread's."""
        self.firmware = CrazyflieFirmware()
        self.info = VehicleInfo()
        self.watch = LinkWatch(link.url, lost_s)
        self.telemetry = CrazyflieTelemetry(settings.largest_position_std_m)
        self.commander = Commander(link.send, link.send_now, hovers_by_itself=settings.hovers_by_itself)
        self._settings = settings
        self._is_simulation = isinstance(link, CrtpUdpLink)
        self._link = link
        self._clock = clock
        self._requests = CrtpRequests(link.send)
        self.parameters = ParameterExchanges(self._requests, lambda: self.firmware.table, self._on_written)
        self._reader = ValuesReader(self.telemetry, self.watch)
        cache = TocCache(settings.cache_directory)
        make_steps = partial(connecting.steps, settings, cache, is_watch_only=is_watch_only)
        self._supervision = CrazyflieSupervision(link, self._requests, make_steps, self._use)
        self._describe("")
        self._failures = OnceLog("a packet of the Crazyflie was dropped; this is a defect of UAL, please report it")
        self.loop = Loop(self, clock, self.watch, on_update)
        self.thread = LoopThread(self.loop, clock, name, self._receive, self._on_defect, self._supervision.close)
        self._runner: CommandRunner[Ask] = CommandRunner(
            "the firmware", lambda ask, _, key: ask(key), self._known, self.watch, setpoints_s=lambda _: 0.0
        )
        self._entrance = CommandEntrance(self.loop, clock, self._require_link)

    @property
    def is_connected(self) -> bool:
        """Whether its values come."""
        return self._supervision.state is CrazyflieLinkState.CONNECTED

    # --- Commands, from any thread ------------------------------------------------------------------------------------

    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint."""
        now_s, pose = self._clock.now_s(), self.telemetry.pose
        is_new = pose is not None and now_s - pose.time_s <= _POSE_AGE_LIMIT_S
        self.commander.send(setpoint, now_s, pose.value.position if pose is not None and is_new else None)

    def arm(self) -> Future[None]:
        """Arms; the future ends with the effect."""
        return self._entrance.give("arm", lambda: self._arming(is_armed=True))

    def disarm(self) -> Future[None]:
        """Disarms; the future ends with the effect."""
        return self._entrance.give("disarm", lambda: self._arming(is_armed=False))

    def take_off(self) -> Future[None]:
        """Lets setpoints fly."""
        why = why_not_fly(self.telemetry.supervisor, self.telemetry.power_state) if self.is_connected else ""
        return futures.failed(_refusal(why)) if why else self.take_control()

    def take_control(self) -> Future[None]:
        """Lets setpoints fly."""
        lost = self._require_link("take control")
        if isinstance(lost, UalError):
            return futures.failed(lost)
        self.commander.take_control()
        return futures.done()

    def hold(self) -> Future[None]:
        """Has it stop and hover by itself."""
        return self._entrance.give("hold", self._holding)

    def land(self, descent_speed_m_s: float) -> Future[None]:
        """Has it land by itself."""
        return self._entrance.give("land", lambda: self._landing(descent_speed_m_s))

    def _require_link(self, what: str) -> CommandRunner[Ask] | UalError:
        return self._runner if self.is_connected else LinkLostError(f"cannot {what}: no Crazyflie is connected")

    # --- The commands -------------------------------------------------------------------------------------------------

    def _arming(self, *, is_armed: bool) -> Command[Ask]:
        telemetry = self.telemetry
        info, power_state, is_on_ground = telemetry.supervisor, telemetry.power_state, telemetry.is_on_ground
        _refuse("; ".join(troubles(info, power_state)) if is_armed else why_not_disarm(info, is_on_ground=is_on_ground))
        return Command(
            "arm" if is_armed else "disarm",
            lambda _: self._link.send(packets.arm(self.firmware.protocol, is_armed=is_armed)),
            ARMING,
            key=ARMING,
            shows=shows_armed(is_armed=is_armed),
            repeat=_ARMING,
            waits=None if is_armed else self._why_wait_to_disarm,
            refusal_is_final=False,
        )

    def _why_wait_to_disarm(self, _: Snapshot) -> str:
        """Its supervisor says "flying" for 2 s after its motors have stopped: disarmed before, it would be locked."""
        return "its supervisor says that it still flies" if self.telemetry.supervisor & SupervisorFlags.FLYING else ""

    def _holding(self) -> Command[Ask]:
        """Nobody else flies it, and without setpoints it falls: whenever this is executed, it does no harm."""
        pose, velocity = self._motion()
        ask = partial(self._hand_over, Phase.HOLDING, self.commander.encoder.stop(pose, velocity), rest(pose, velocity))
        return self._flying("hold", Phase.HOLDING, ask, is_harmless=True)

    def _landing(self, descent_speed_m_s: float) -> Command[Ask]:
        pose, velocity = self._motion()
        ground_z = self.telemetry.ground.landing_z_m(pose.position)
        request = self.commander.encoder.land(pose.position.z, ground_z, descent_speed_m_s)
        return self._flying(
            "land", Phase.LANDING, partial(self._hand_over, Phase.LANDING, request, rest(pose, velocity))
        )

    def _flying(self, what: str, phase: Phase, ask: Ask, *, is_harmless: bool = False) -> Command[Ask]:
        """All modes are ours: nobody else can choose one."""
        mode = MODES[phase].name
        return Command(what, ask, FLYING, mode=mode, own_modes=lambda _: True, is_harmless=is_harmless)

    def _hand_over(
        self, phase: Phase, request: CrtpRequest, stays: PositionSetpoint, key: Hashable
    ) -> Callable[[], None]:
        return self.commander.hand_over(phase, request, stays, partial(self._on_handed_over, key))

    def _on_handed_over(self, key: Hashable, refusal: str) -> None:
        verdict = Verdict.REFUSED if refusal else Verdict.ACCEPTED
        self._runner.on_answer(key, verdict, self._clock.now_s(), refusal)

    def _motion(self) -> tuple[Pose, Vector3]:
        pose, velocity = self.telemetry.pose, self.telemetry.velocity
        _refuse("its pose is not known" if pose is None or velocity is None else "")
        assert pose is not None
        assert velocity is not None
        return pose.value, velocity.value.linear

    # --- What the engine calls ----------------------------------------------------------------------------------------

    @property
    def is_urgent(self) -> bool:
        """Its commander has always something to do soon."""
        return True

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what has arrived, and what may have changed, in a pause of this computer."""
        del now_s, pause_s
        self.telemetry.discard_state()
        while self._wait(0.0):
            pass

    def tick(self, now_s: float) -> None:
        """Watches the link, and goes on with the commands."""
        self.watch.tick(now_s)
        self._runner.tick(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data, and what is wrong with the link."""
        trouble = "" if self.is_connected else self._supervision.text
        snapshot = self.telemetry.snapshot(now_s, self.commander.mode, trouble)
        return snapshot._replace(
            updated_s=updated_s, scheduling_gap=scheduling_gap, link=snapshot.link._replace(trouble=trouble)
        )

    def _known(self, now_s: float) -> Snapshot:
        return self.telemetry.snapshot(now_s, self.commander.mode, "")

    # --- On the thread ------------------------------------------------------------------------------------------------

    def _receive(self, timeout_s: float) -> None:
        """Receives, and sends what is due."""
        before = self.telemetry.pose
        was_connected = self.is_connected
        received = self._wait(min(timeout_s, TICK_S))
        now_s = self._clock.now_s()
        if self.loop.woke(now_s):
            received = []
        self._on_packets(received, now_s)
        self._talk(now_s, was_connected=was_connected)
        if self.commander.has_answered:
            self.loop.publish(now_s)  # a command ends once its effect can be seen
            self.commander.finish()
        self.loop.step(now_s, has_news=self.telemetry.pose is not before)

    def _talk(self, now_s: float, *, was_connected: bool) -> None:
        self._supervision.step(now_s, is_flowing=self.watch.is_up(now_s))
        if was_connected and not self.is_connected:
            self.commander.on_lost()
        if self._reader.has_rebooted:
            self._reader.has_rebooted = False
            self._runner.drop(now_s)
            self.commander.on_reboot()
        if self.is_connected and not self._reader.is_boot_open:  # one that has booted is not in the air any more
            self.commander.step(self._requests, now_s, self._flies(), touches=self.telemetry.contact.touches)
        self.parameters.tick(now_s, is_connected=self.is_connected)
        self._requests.step(now_s)

    def _on_defect(self, error: Exception, now_s: float) -> None:
        self._supervision.reopen(str(error) or repr(error), now_s)
        self.commander.on_lost()

    def _flies(self) -> tuple[Pose, Vector3] | None:
        """Its pose and velocity; None if it is not known to be in the air."""
        pose, velocity = self.telemetry.pose, self.telemetry.velocity
        if pose is None or velocity is None or self.telemetry.is_on_ground:
            return None
        return pose.value, velocity.value.linear

    def _wait(self, timeout_s: float) -> list[CrtpPacket]:
        """Waits for packets."""
        if self._supervision.state is CrazyflieLinkState.OPENING:
            time.sleep(timeout_s)  # nothing can come yet
            return []
        try:
            return self._link.receive(timeout_s)
        except CrtpLinkError as error:
            self._supervision.reopen(str(error), self._clock.now_s())
            return []

    def _on_packets(self, received: list[CrtpPacket], now_s: float) -> None:
        for packet in received:
            self.telemetry.heard_s = now_s
            try:
                self._on_packet(packet, now_s)
            except (ValueError, LookupError, struct.error) as error:  # it may be in the air: the others still count
                self._failures.log(error)

    def _on_packet(self, packet: CrtpPacket, now_s: float) -> None:
        if packet.port == LOG and packet.channel == LOG_DATA_CHANNEL:
            if (
                self._supervision.state is not CrazyflieLinkState.CONNECTING
            ):  # they may be of another boot, whose blocks are new
                self._reader.on_data(packet.data, now_s, self._clock.utc_s())
        elif packet.port == CONSOLE:
            self.telemetry.on_console(packet.data)
        elif not self._requests.on_packet(packet) and packets.refuses_arming(packet):
            text = self.telemetry.text or "its supervisor does not allow it"
            self._runner.on_text(text)
            self._runner.on_answer(ARMING, Verdict.REFUSED, now_s, text)

    def _use(self, firmware: CrazyflieFirmware, is_new: bool) -> None:
        """Uses what was learned of a firmware."""
        self.firmware = firmware
        if is_new:
            self._reader.use(firmware.blocks)
            self._describe("")
            self._fly_by(firmware.parameters)

    def _on_written(self, written: Parameter) -> None:
        """Uses the new value of a parameter by which UAL flies."""
        parameters = self.firmware.parameters
        if written.name in parameters and parameters[written.name] != written.value:
            changed = {**parameters, written.name: float(written.value)}
            self._use(replace(self.firmware, parameters=changed), is_new=False)
            self._fly_by(changed)

    def _fly_by(self, parameters: Mapping[str, float]) -> None:
        self.telemetry.parameters = parameters
        self.commander.encoder = Encoder(self.firmware.protocol, parameters)
        self._requests.add(ASK_VERSION, self._on_version)

    def _on_version(self, data: bytes) -> None:
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


def _refuse(why: str) -> None:
    if why:
        raise _refusal(why)


def _refusal(why: str) -> RejectedByAutopilotError:
    return RejectedByAutopilotError(f"the Crazyflie refuses: {why}", {"text": why})
