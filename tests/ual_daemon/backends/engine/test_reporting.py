"""The shortest way to a backend: three methods, and what the engine makes of them. `tests/examples` flies one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import pytest
from typing_extensions import override

from tests.ual_daemon.backends.engine.scripted import Clock
from ual.errors import LinkLostError, RejectedByAutopilotError
from ual.geometry import Pose, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.engine.boot_time import MESSAGE_SILENCE_S, PROOFS_COUNT
from ual_daemon.backends.engine.loop import LoopThread
from ual_daemon.backends.engine.reporting import Answer, ReportingBackend, VehicleReport
from ual_daemon.backends.values import Control, LandedState, Setpoint, VehicleInfo, VelocitySetpoint

LIMITS = Limits(3.0, 1.0, 1.0)
REST = VelocitySetpoint(Vector3(), 0.0)


@dataclass
class Device:
    """The autopilot: messages that wait, and those that reached it."""

    waiting: deque[VehicleReport | Answer] = field(default_factory=deque)
    commands: list[str] = field(default_factory=list)
    setpoints: list[Setpoint] = field(default_factory=list)
    connections: int = 1
    error: Exception | None = None


class Plain(ReportingBackend):
    """A backend of one's own, turned by the test."""

    name = "plain"
    vehicle = VehicleInfo(autopilot="plain", limits=LIMITS)
    follow_mode, hold_mode, land_mode = "guided", "loiter", "descend"

    def __init__(self) -> None:
        self.device, self.time = Device(), Clock()
        super().__init__(BackendOptions("uav_1"), clock=self.time)

    @override
    def receive(self, timeout_s: float) -> VehicleReport | Answer | None:
        error, self.device.error = self.device.error, None
        if error is not None:
            raise error
        return self.device.waiting.popleft() if self.device.waiting else None

    @override
    def command(self, name: str) -> None:
        self.device.commands.append(name)

    @override
    def follow(self, setpoint: Setpoint) -> None:
        self.device.setpoints.append(setpoint)

    @override
    def reconnect(self) -> None:
        self.device.connections += 1

    def turn(self, *messages: VehicleReport | Answer, after_s: float = 0.1) -> None:
        """Lets time pass, and has the messages received."""
        self.time.now += after_s
        self.device.waiting.extend(messages)
        self._thread.turn()

    def report(self, mode: str = "guided", *, is_armed: bool = True, is_on_ground: bool = False) -> VehicleReport:
        """Reports a hover at 3 m."""
        return VehicleReport(self.time.now, is_armed, is_on_ground, mode, Pose.at(1.0, 2.0, 3.0, 0.5), Twist())


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> Plain:
    """The backend, which is heard."""
    monkeypatch.setattr(LoopThread, "open", lambda _: None)
    backend = Plain()
    backend.open(lambda _: None)
    backend.turn(backend.report())
    return backend


@pytest.mark.parametrize(
    ("mode", "control"),
    [("guided", Control.REFERENCES), ("descend", Control.LAND), ("loiter", Control.OTHER), ("acro", Control.OTHER)],
)
def test_a_report_is_the_snapshot(backend: Plain, mode: str, control: Control) -> None:
    backend.turn(backend.report(mode))
    snapshot = backend.snapshot()
    pose, seen, landed = snapshot.motion.pose, snapshot.control.mode, snapshot.control.landed
    assert pose is not None
    assert seen is not None
    assert landed is not None
    assert pose.value.position == Vector3(1.0, 2.0, 3.0)
    assert (seen.value.name, seen.value.control) == (mode, control)
    assert landed.value is LandedState.IN_AIR


def test_each_command_is_one_name(backend: Plain) -> None:
    backend.turn(backend.report("stabilize"))
    for give in (backend.hold, lambda: backend.land(LIMITS), lambda: backend.take_off(2.0, LIMITS), backend.disarm):
        give()
        backend.turn(backend.report("stabilize"))
    assert list(dict.fromkeys(backend.device.commands)) == ["loiter", "descend", "guided", "disarm"]


def test_a_refusal_quotes_the_autopilot(backend: Plain) -> None:
    on_ground = backend.report("stabilize", is_armed=False, is_on_ground=True)
    backend.turn(on_ground)
    result = backend.arm()
    backend.turn(on_ground._replace(boot_s=backend.time.now))
    for _ in range(5):
        backend.turn(Answer("arm", "gyros are not calibrated"), on_ground._replace(boot_s=backend.time.now))
    with pytest.raises(RejectedByAutopilotError, match="gyros are not calibrated"):
        result.result(0.0)


def test_setpoints_and_commands_end_with_the_link(backend: Plain) -> None:
    backend.send(REST)
    assert backend.device.setpoints == [REST]
    for _ in range(12):
        backend.turn()
    backend.send(REST)
    assert backend.device.setpoints == [REST]
    with pytest.raises(LinkLostError, match="cannot hold: nothing is heard of the autopilot"):
        backend.hold().result(0.0)


def test_after_an_error_of_the_library_it_connects_anew_and_nothing_old_is_believed(backend: Plain) -> None:
    backend.device.error = OSError("unplugged")
    backend.turn()
    assert backend.device.connections == 2
    assert backend.snapshot().motion.pose is None
    backend.turn(backend.report())
    assert backend.snapshot().motion.pose is not None


def test_what_the_offers_have_is_found_by_its_kind(backend: Plain) -> None:
    assert backend.offer(Device) is None
    backend._offers = (backend.device,)
    assert backend.offer(Device) is backend.device


def test_a_command_from_before_the_first_reboot_is_not_sent_after_it(backend: Plain) -> None:
    for _ in range(100):
        backend.turn(backend.report())
    backend.turn(after_s=MESSAGE_SILENCE_S)
    booted_s = backend.time.now

    def booted() -> VehicleReport:
        return backend.report()._replace(boot_s=backend.time.now - booted_s)

    for _ in range(PROOFS_COUNT - 1):
        backend.turn(booted())
    result = backend.disarm()  # waits for the loop, which first takes the message that proves the boot
    backend.turn(booted())
    backend.turn(booted())
    with pytest.raises(RejectedByAutopilotError, match="the autopilot has rebooted"):
        result.result(0.0)
    assert backend.device.commands == []
