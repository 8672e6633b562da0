"""Defects that no simulator shows at will: threads that meet, and answers that nobody expects. Without sockets and
threads.
"""

from __future__ import annotations

import logging
import math

import pytest

from ual_daemon.backends.airsim.backend import AirsimBackend
from ual_daemon.backends.airsim.link import Simulator
from ual_daemon.backends.airsim.state import (
    AirsimReport,
    Collision,
    Kinematics,
    Location,
    MultirotorState,
    RemoteControl,
    Rotation,
    Rotor,
    Rotors,
    Vector,
)
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.values import LandedState, Snapshot

LEVEL = Rotation(1.0, 0.0, 0.0, 0.0)


def report(rotation: Rotation = LEVEL, *, rotor_rad_s: float = 500.0) -> AirsimReport:
    """It descends."""
    motion = Kinematics(Vector(z_val=-3.0), rotation, Vector(z_val=0.5), Vector(), Vector())
    state = MultirotorState(motion, 1000, 1, RemoteControl(False))
    return AirsimReport(state, Rotors([Rotor(3.0, rotor_rad_s)] * 4), has_api_control=True, collision=Collision())


def connected(backend: AirsimBackend) -> AirsimBackend:
    backend._link.simulator = Simulator(("Drone1",), "Drone1", Location(47.0, 8.0, 400.0), 1.0, "1")
    return backend


@pytest.fixture
def backend() -> AirsimBackend:
    return connected(AirsimBackend(BackendOptions("uav_1")))


def test_an_orientation_of_all_zeros_is_no_pose(backend: AirsimBackend) -> None:
    session = backend._session
    session._on_report(report())
    assert session._snapshot.motion.pose is not None
    session._on_report(report(Rotation(0.0, 0.0, 0.0, 0.0)))
    assert session._snapshot.motion.pose is None


def test_a_motion_that_is_no_number_shows_no_ground(backend: AirsimBackend) -> None:
    """The physics of AirSim may end in NaN after a collision. It counted as landed."""
    nan = math.nan
    motion = Kinematics(Vector(), Rotation(nan, nan, nan, nan), Vector(nan, nan, nan), Vector(), Vector(nan, nan, nan))
    state = MultirotorState(motion, 1000, 1, RemoteControl(False))
    falling = AirsimReport(state, Rotors([Rotor(0.0, 500.0)] * 4), has_api_control=True, collision=Collision())
    backend._session._on_report(falling)
    landed = backend._session._snapshot.control.landed
    assert landed is not None
    assert landed.value is not LandedState.ON_GROUND


def test_the_link_survives_what_nobody_expects(
    backend: AirsimBackend, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    link, updates = backend._link, list[Snapshot]()
    backend._session.loop.on_update = updates.append

    def fails(_: float) -> None:
        raise AttributeError("landing")

    monkeypatch.setattr(link, "receive", fails)
    link.is_up = True
    with caplog.at_level(logging.ERROR):
        for _ in range(3):
            backend._session.thread.turn()
    assert not link.is_up
    assert not updates[0].link.conflict  # it may be well again
    assert "a defect of UAL: landing" in updates[-1].link.conflict
    assert len(updates) == 3
    (record,) = caplog.records  # told once
    assert record.exc_info is not None
