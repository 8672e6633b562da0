"""The link to a Crazyflie: connecting, losing, finding again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.simulators.crazyflie import Crazyflie, Supervisor
from tests.simulators.faults import Faults
from tests.simulators.ports import MemoryPort
from tests.ual_daemon.backends.crazyflie.flights import FlightTrace, current_position
from ual.types import State
from ual_daemon.backends.crazyflie.packets import LOG, PARAMETER, RESET_LOG, WRITE_CHANNEL, CrtpPacket
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings

BAD = Faults(loss=0.2, delay_s=0.01, jitter_s=0.03, duplication=0.2)


def table_items(flown: FlightTrace, since: int = 0) -> int:
    """Returns the number of requested entries of the tables."""
    packets = [packet for _, packet in flown.crazyflie.received[since:]]
    return sum(p.port in (LOG, PARAMETER) and p.channel == 0 and p.data[:1] == b"\x02" for p in packets)


def test_connects_and_knows_its_state(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    assert flown.estimate().state is State.LANDED_DISARMED
    info = flown.backend.info()
    assert (info.autopilot, info.autopilot_version, info.has_safety_pilot) == ("Crazyflie", "2024.2", False)
    assert info.limits.horizontal_speed_m_s == 0.8
    battery = flown.backend.snapshot().condition.battery
    assert battery is not None
    assert battery.voltage_v == pytest.approx(3.9, abs=0.01)


def test_says_what_it_is_doing_while_it_connects(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.until(lambda: "reading its table" in flown.estimate().why)
    assert flown.estimate().state is State.UNINITIALIZED


def test_the_tables_are_read_once(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    assert table_items(flown) >= len(flown.crazyflie.logged) + len(flown.crazyflie.parameters)
    since = len(flown.crazyflie.received)
    flown.restart_daemon()
    flown.ready()
    assert table_items(flown, since) == 0


def test_a_damaged_cache_is_read_anew(tmp_path: Path) -> None:
    FlightTrace(tmp_path).ready()
    for path in tmp_path.iterdir():
        path.write_text('{"stateEstimate.x": [99999, "x", false]}')
    flown = FlightTrace(tmp_path)
    flown.ready()
    assert table_items(flown) > 0


def test_connects_over_a_bad_link(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, faults=BAD)
    flown.until(lambda: flown.session.is_connected, 30.0)
    flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED)


def test_arms_and_flies_over_a_bad_link(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, faults=BAD)
    flown.take_off()
    flown.fly(lambda _: current_position(0.5, 0.0, 1.0), 4.0)
    x, _, z = flown.crazyflie.current_position
    assert (x, z) == pytest.approx((0.5, 1.0), abs=0.1)


def test_what_comes_late_or_twice_is_not_taken(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    flown.memory.sent.clear()
    flown.crazyflie.run(0.02)
    old = flown.memory.sent.copy()
    flown.run(0.2)
    before = flown.backend.snapshot().motion.measured_s
    flown.memory.sent.extend(old)
    flown.run(0.01)
    assert flown.backend.snapshot().motion.measured_s >= before


def test_out_of_range_and_back_is_no_reboot(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    since = len(flown.crazyflie.received)
    flown.crazyflie.is_silent = True
    flown.until(lambda: not flown.estimate().is_link_up)
    assert flown.estimate().state is State.UNINITIALIZED
    flown.run(5.0)
    flown.crazyflie.is_silent = False
    assert flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED) < 1.0
    assert table_items(flown, since) == 0
    assert flown.backend.snapshot().link.boot == 1


@pytest.mark.parametrize(
    ("decks", "frames"),
    [(("deck.bcFlow2",), 1), (("deck.bcLighthouse4",), 0), (("deck.bcFlow2", "deck.bcLighthouse4"), 1)],
)
def test_a_reboot_is_noticed_and_healed(tmp_path: Path, decks: tuple[str, ...], frames: int) -> None:
    """With a flow deck its local frame may begin anew, also if Lighthouse is there but off."""
    flown = FlightTrace(tmp_path)
    for deck in decks:
        flown.crazyflie.parameters[deck] = "B", 1, True
    flown.take_off()
    flown.crazyflie.is_silent = True
    flown.run(1.0)
    flown.crazyflie.boot()
    flown.crazyflie.is_silent = False
    assert flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED) < 2.0
    snapshot = flown.backend.snapshot()
    assert (snapshot.link.boots_count, snapshot.link.boots_in_frame_count) == (1 + frames, 1 - frames)
    assert flown.crazyflie.parameters["commander.enHighLevel"][1] == 1


def test_another_client_that_took_the_log_is_no_reboot(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.memory.arriving.append(CrtpPacket(LOG, 1, b"\x05").encode())
    flown.until(lambda: not flown.session.is_connected)
    flown.until(lambda: flown.session.is_connected and flown.estimate().state is State.FLYING_AUTO)
    assert flown.backend.snapshot().link.boot == 1


def test_does_without_a_variable_that_is_missing(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, Crazyflie(MemoryPort(), has_battery=False))
    flown.ready()
    assert flown.estimate().state is State.LANDED_DISARMED
    assert flown.backend.snapshot().condition.battery is None


def test_says_which_variable_it_cannot_do_without(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    del flown.crazyflie.logged["supervisor.info"]
    flown.until(lambda: "does not log supervisor.info" in flown.estimate().why)
    assert flown.estimate().state is State.UNINITIALIZED


def test_sets_the_users_parameters_and_names_those_it_cannot(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    flown = FlightTrace(tmp_path, parameters={"posCtlPid.xVelMax": 2.0, "posCtlPid.yVelMax": 2.0, "no.such": 1.0})
    flown.ready()
    assert flown.backend.info().limits.horizontal_speed_m_s == 1.6
    fields = [
        record.__dict__.get("ual_fields")
        for record in caplog.records
        if vars(record).get("ual_event") == "parameters_not_set"
    ]
    assert fields == [{"parameters": "no.such"}]


def test_says_what_its_console_says(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    flown.crazyflie.say("KALMAN: a line that is longer than the thirty bytes of one packet")
    flown.run(0.2)
    assert (
        flown.backend.snapshot().condition.status_text
        == "KALMAN: a line that is longer than the thirty bytes of one packet"
    )


def test_says_which_vehicle_it_is_once_it_is_connected(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    assert flown.backend.info().identity == ""
    flown.ready()
    assert flown.backend.info().identity == "crazyflie udp 127.0.0.1:1"


def test_a_home_of_before_a_restart_is_lost_and_not_silently_another_one(tmp_path: Path) -> None:
    """Nothing ties its local frame to Earth, so a home that was set would move to the origin of the local frame."""

    def resolved(file: HomeFile) -> tuple[FlightTrace, FrameResolver]:
        flown = FlightTrace(tmp_path)
        resolver = FrameResolver(
            "uav_1", VehicleSettings(), file if flown.backend.outlived else None, lambda: flown.backend.info().identity
        )
        resolver.open()
        flown.ready()
        resolver.update(flown.backend.snapshot())
        return flown, resolver

    flown, before = resolved(HomeFile(tmp_path / "uav_1.home"))
    pose = flown.backend.snapshot().motion.pose
    assert pose is not None
    before.set_home(pose.value.position, flown.backend.snapshot(), set_z=True)
    _, after = resolved(HomeFile(tmp_path / "uav_1.home"))
    assert before.odom_loss is None
    assert after.odom_loss is not None
    assert "nothing tied it to Earth" in after.odom_loss.why


def test_one_that_only_watches_changes_nothing_and_takes_no_log_from_another(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, is_watch_only=True, parameters={"posCtlPid.xVelMax": 3.0})
    flown.crazyflie._on_log_control(bytes((6, 0)))  # another program has a block
    others = flown.crazyflie.blocks[0]
    for _ in range(2):
        flown.ready()
        assert flown.estimate().state is State.LANDED_DISARMED
        assert flown.crazyflie.blocks[0] is others
        flown.restart_daemon()
    assert flown.crazyflie.parameters["posCtlPid.xVelMax"][1] == 1.0
    assert flown.crazyflie.parameters["commander.enHighLevel"][1] == 0
    sent = [packet for _, packet in flown.crazyflie.received]
    assert not any(p.port == PARAMETER and p.channel == WRITE_CHANNEL for p in sent)
    assert not any(p.port == LOG and p.channel == 1 and p.data[:1] == bytes((RESET_LOG,)) for p in sent)


@pytest.mark.parametrize("is_watch_only", [False, True])
def test_a_reboot_after_a_while_is_noticed(tmp_path: Path, *, is_watch_only: bool) -> None:
    flown = FlightTrace(tmp_path, is_watch_only=is_watch_only, positioning_deck="deck.bcFlow2")
    flown.ready()
    flown.run(10.0)
    flown.crazyflie.is_silent = True
    flown.run(2.0)
    flown.crazyflie.boot()
    flown.crazyflie.is_silent = False
    flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED)
    assert flown.backend.snapshot().link.boots_count == 2


def failing_once(error: Exception, call: Callable[..., Any]) -> Callable[..., Any]:
    """The call, which raises an error the first time."""
    errors = [error]

    def called(*args: Any) -> Any:
        if errors:
            raise errors.pop()
        return call(*args)

    return called


@pytest.mark.parametrize("method", ["open", "receive"])
def test_an_error_of_the_link_that_nobody_knows_is_reported_and_it_connects_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    flown = FlightTrace(tmp_path)
    link = flown.backend._link
    monkeypatch.setattr(link, method, failing_once(RuntimeError("its cable glows"), getattr(link, method)))
    flown.until(lambda: "its cable glows" in flown.backend.snapshot().condition.status_text)
    flown.ready()
    assert flown.estimate().state is State.LANDED_DISARMED


def test_an_answer_that_is_cut_short_is_reported_and_requested_again(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    send = flown.crazyflie._send
    cut: list[bytes] = []

    def short(port: int, channel: int, data: bytes) -> None:
        if (port, channel, data[:1]) == (LOG, 0, b"\x03") and not cut:
            cut.append(data)
            data = data[:1]
        send(port, channel, data)

    flown.crazyflie._send = short  # type: ignore[method-assign]
    flown.ready()
    assert cut
    assert flown.estimate().state is State.LANDED_DISARMED


def test_an_update_that_fails_above_does_not_end_the_link(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.session.loop.on_update = failing_once(RuntimeError("a defect"), flown.updates.append)
    flown.run(3.0)
    assert flown.session.is_connected
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    assert sum(record.getMessage().startswith("an update failed") for record in caplog.records) == 1


def test_a_lost_answer_to_the_second_part_of_a_log_block_does_not_stop_its_values(tmp_path: Path) -> None:
    """The firmware adds the variables once more when they are asked for again."""
    flown = FlightTrace(tmp_path)
    flown.crazyflie.logged["radio.rssi"] = "B", lambda: 40.0
    send = flown.crazyflie._send
    lost: list[bytes] = []

    def lossy(port: int, channel: int, data: bytes) -> None:
        if (port, channel, data[:1]) == (LOG, 1, b"\x07") and not lost:
            lost.append(data)
        else:
            send(port, channel, data)

    flown.crazyflie._send = lossy  # type: ignore[method-assign]
    flown.ready()
    assert lost
    assert flown.estimate().state is State.LANDED_DISARMED
    assert flown.session.telemetry.rssi_dbm == -40.0


def test_a_failed_assertion_of_its_firmware_is_severe(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    flown.crazyflie.say("SYS: all is well")
    flown.run(0.2)
    assert flown.backend.snapshot().condition.severe_texts == ()
    flown.crazyflie.say("Assert failed src/modules/src/stabilizer.c:123")
    flown.run(0.2)
    assert [each.text for each in flown.backend.snapshot().condition.severe_texts] == [
        "Assert failed src/modules/src/stabilizer.c:123"
    ]
