"""`ual gimbal`, the clients and the service, with a daemon of a light UAV."""

from __future__ import annotations

import asyncio
import json
import math

import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.waiting import until
from ual.errors import InvalidArgumentError
from ual.gimbals import GimbalActivity, GimbalControl, GimbalReference
from ual_tools.main import cli

AT = ual.PointStamped(ual.Vector3(0.0, -5.0, 0.0), "map")


@pytest.fixture
def daemon(start_daemon: StartDaemon) -> DaemonProcess:
    return start_daemon("--set", "light.gimbals=[{speed_rad_s: 1000}]", backend="light")


def run(daemon: DaemonProcess, *words: str) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *words])


def done(daemon: DaemonProcess, *words: str) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def status(daemon: DaemonProcess) -> dict[str, object]:
    found: dict[str, object] = json.loads(done(daemon, "--json", "gimbal", "status"))
    return found


def test_the_command_does_all(daemon: DaemonProcess) -> None:
    (listed,) = (json.loads(line) for line in done(daemon, "--json", "gimbal", "list").splitlines())
    assert (listed["number"], listed["frame_id"]) == (0, "uav_1/gimbal_0")
    assert "pitch -0.50 to 1.57 rad" in done(daemon, "gimbal", "list")
    done(daemon, "gimbal", "angles", "90deg", "-45deg")
    until(lambda: "pitch 1.57 yaw -0.79 roll 0.00 rad, angles" in done(daemon, "gimbal", "status"))
    assert "control: this daemon" in done(daemon, "gimbal", "status")
    done(daemon, "gimbal", "angles", "0", "90deg", "--reference", "earth", "--frame", "map")
    done(daemon, "gimbal", "rates", "0.1", "-5deg")
    assert "rates" in done(daemon, "gimbal", "status")
    done(daemon, "gimbal", "point", "5", "-5", "0", "--frame", "map")
    assert status(daemon)["activity"] == "POINT"
    done(daemon, "gimbal", "neutral")
    done(daemon, "gimbal", "retract")
    done(daemon, "gimbal", "control", "release")
    assert (status(daemon)["activity"], status(daemon)["control"]) == (None, "FREE")
    done(daemon, "gimbal", "control", "take")
    refused = run(daemon, "gimbal", "angles", "-60deg")
    assert refused.exit_code == 1
    assert "beyond the limits of gimbal 0" in refused.stderr
    assert "there is no gimbal 3: 0 to 0" in run(daemon, "gimbal", "status", "--gimbal", "3").stderr


def test_both_clients_point_it_and_watch_it(daemon: DaemonProcess) -> None:
    with ual.Uav(address=daemon.address) as uav:
        (gimbal,) = uav.gimbals
        gimbal.set_angles(0.5, 0.3, 0.1)
        seen = next(each for each in gimbal.watch(50.0) if each.angles and each.angles.roll_rad > 0.09)
        assert seen.angles is not None
        assert (seen.angles.pitch_rad, seen.angles.yaw_rad) == pytest.approx((0.5, 0.3))
        assert (seen.activity, seen.control) == (GimbalActivity.ANGLES, GimbalControl.OURS)
        gimbal.point_at(AT)
        seen = next(
            each for each in gimbal.watch(50.0) if each.off_target_rad is not None and each.off_target_rad < 0.01
        )
        assert seen.target == AT
        assert seen.in_odom is not None
        assert seen.in_odom.yaw_rad == pytest.approx(-math.pi / 2.0)
        with pytest.raises(InvalidArgumentError, match="reference: 'up' is no GimbalReference"):
            gimbal.set_angles(0.0, reference="up")  # type: ignore[arg-type]  # as a caller without types may give
        with pytest.raises(InvalidArgumentError, match="point"):
            gimbal.point_at(3)  # type: ignore[arg-type]  # as a caller without types may give
        with pytest.raises(InvalidArgumentError, match="rate_hz: 99 is out of range"):
            next(iter(gimbal.watch(99.0)))
    asyncio.run(by_asyncio(daemon))


async def by_asyncio(daemon: DaemonProcess) -> None:
    async with ual.aio.Uav(address=daemon.address) as uav:
        gimbals = [each async for each in uav.gimbals]
        assert len(gimbals) == 1
        await gimbals[0].set_angles(0.2, reference=GimbalReference.BODY)
        async for seen in gimbals[0].watch(50.0):
            if seen.angles is not None and seen.angles.pitch_rad == pytest.approx(0.2):
                break
        await uav.gimbals[0].move_to_neutral()
        assert (await uav.gimbals[0].status()).activity is GimbalActivity.NEUTRAL
