"""`ual watch`: its table for any terminal, its keys, and UAVs that come and go. Needs no terminal."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace

import pytest
from rich.console import Console

from tests.conftest import StartDaemon
from tests.waiting import until
from ual.discovery import Registration
from ual.errors import DaemonUnreachableError
from ual.geometry import Pose, Quaternion, Transform, Twist, Vector3
from ual.types import Battery, Health, State, TaskInfo, TaskKind, TaskStatus, Telemetry
from ual_tools import keys, terminal, watch_board, watch_screen, watch_table
from ual_tools.keys import Key
from ual_tools.session import CommandSession
from ual_tools.watch import default_rate_hz
from ual_tools.watch_board import Board, WatchedUav
from ual_tools.watch_roster import WatchRoster

NOW_S = 100.0
SIZES = [(80, 24), (40, 24), (40, 10), (57, 24), (100, 40), (200, 50), (20, 5), (3, 3)]

FLYING = Telemetry(
    State.FLYING_AUTO,
    state_reason="in the air, the autopilot takes our references (mode GUIDED)",
    pose=Pose(Vector3(-1234.56, 2345.67, 119.9)),
    transform=Transform(Vector3(-1000.04, 2000.04, 121.9), Quaternion()),
    velocity=Twist(Vector3(3.0, 4.0, 0.0)),
    battery=Battery(87.4, 15.2),
    flight_mode="GUIDED",
    armed=True,
    task=TaskInfo("1", TaskKind.GO_TO_WAYPOINT, TaskStatus.RUNNING, distance_left_m=12.34, description="goes to 4 2 3"),
)


def observed(count: int, telemetry: Telemetry = FLYING) -> dict[str, WatchedUav]:
    return {f"uav_{number}": WatchedUav(NOW_S, telemetry) for number in range(1, count + 1)}


def table(found: dict[str, WatchedUav], width: int = 80, height: int = 24, top: int = 0) -> list[str]:
    lines = watch_table.table(found, width=width, height=height, top=top, now_s=NOW_S, lost_after_s=2.0)
    return [line.text for line in lines]


# --- The table --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("count", [1, 12, 200])
def test_the_table_fits_any_terminal(width: int, height: int, count: int) -> None:
    for found in (
        observed(count),
        observed(count, Telemetry(State.UNINITIALIZED, "no data " * 50)),
        {"x" * 60: WatchedUav(NOW_S)},
    ):
        lines = table(found, width, height)
        assert len(lines) <= height
        assert max(map(len, lines)) <= width
        if height > 2:
            assert len(lines) == min(len(found) + (2 if height < 8 else 3), height)


def test_twelve_uavs_fit_an_ordinary_terminal() -> None:
    text = "\n".join(table(observed(12)))
    for number in range(1, 13):
        assert f"uav_{number} " in text
    assert "12 UAVs" in text
    assert "q quits" in text


def test_a_row_shows_what_there_is_room_for() -> None:
    narrow, ordinary, wide, widest = (table(observed(1), width)[3] for width in (40, 80, 120, 160))
    assert narrow == "uav_1  FLYING_AUTO      87 %"
    assert ordinary == "uav_1  FLYING_AUTO      87 %           -1000.0 2000.0  121.9   5.0  goes to 4 2…"
    assert wide == "uav_1  FLYING_AUTO      87 %           -1000.0 2000.0  121.9   5.0  goes to 4 2 3, 12.3 m left"
    assert widest == (
        "uav_1  FLYING_AUTO      87 %           -1000.0 2000.0  121.9   5.0  GUIDED        armed  "
        "goes to 4 2 3, 12.3 m left"
    )
    assert "x y z (m) in map" in table(observed(1), 100)[2]


def test_where_it_is_in_map_is_not_known_is_not_reported_in_another_frame() -> None:
    assert "-1234.6" not in table(observed(1, replace(FLYING, transform=None)))[3]


def test_200_uavs_are_reached_by_scrolling() -> None:
    found = observed(200)
    assert "1-21 of 200 UAVs" in table(found)[0]
    assert table(found)[1] == "200 FLYING_AUTO"
    top = 0
    shown: set[str] = set()
    for _ in range(20):
        lines = table(found, top=top)
        shown |= {line.split()[0] for line in lines[3:]}
        top = watch_table.scrolled(top, [Key.PAGE_DOWN], 200, 24)
    assert shown == set(found)
    assert lines[-1].startswith("uav_200 ")


def test_the_worst_of_200_are_on_the_first_page_in_words_and_colour() -> None:
    found = observed(200)
    found["uav_150"] = WatchedUav(NOW_S - 7.0, FLYING)
    found["uav_170"] = WatchedUav(NOW_S, replace(FLYING, battery=Battery(23.0, 14.2)))
    found["uav_80"] = WatchedUav(NOW_S, replace(FLYING, battery=Battery(9.0, 13.9)))
    found["uav_9"] = WatchedUav(NOW_S, replace(FLYING, health=Health(failsafe="rc failsafe")))
    lines = watch_table.table(found, width=80, height=24, top=0, now_s=NOW_S, lost_after_s=2.0)
    assert lines[1].text == "3 alarms, 1 warning; 199 FLYING_AUTO, 1 LOST"
    assert [line.text for line in lines[3:8]] == [
        "uav_150  no telemetry for 7 s, it was FLYING_AUTO",
        "uav_9    FLYING_AUTO      87 %           failsafe: rc failsafe",
        "uav_80   FLYING_AUTO      9 % CRITICAL   -1000.0 2000.0  121.9   5.0",
        "uav_170  FLYING_AUTO      23 % LOW       -1000.0 2000.0  121.9   5.0",
        "uav_1    FLYING_AUTO      87 %           -1000.0 2000.0  121.9   5.0",
    ]
    assert [line.style for line in lines[3:8]] == ["bold red"] * 3 + ["bold yellow", "green"]
    assert lines[1].style == "bold red"


@pytest.mark.parametrize(
    ("pressed", "top"),
    [
        ([], 0),
        ([Key.UP], 0),
        ([Key.DOWN, Key.DOWN, Key.UP], 1),
        ([Key.PAGE_DOWN], 21),
        ([Key.PAGE_DOWN, Key.PAGE_UP], 0),
        ([Key.END], 79),
        ([Key.END, Key.DOWN], 79),
        ([Key.END, Key.UP], 78),
        ([Key.END, Key.HOME], 0),
        ([Key.QUIT], 0),
    ],
)
def test_keys_scroll(pressed: Sequence[Key], top: int) -> None:
    assert watch_table.scrolled(0, pressed, 100, 24) == top


def test_a_screen_that_grows_or_uavs_that_go_leave_no_gap() -> None:
    assert watch_table.scrolled(78, [], 100, 52) == 51
    assert watch_table.scrolled(78, [], 10, 24) == 0
    assert watch_table.scrolled(0, [Key.END], 0, 24) == 0


def test_what_is_not_the_present_is_never_shown_as_it() -> None:
    old = {"uav_1": WatchedUav(NOW_S - 5.0, FLYING)}
    assert table(old)[3] == "uav_1  no telemetry for 5 s, it was FLYING_AUTO"
    assert table(old, 40)[3] == "uav_1  no telemetry for 5 s, it was FLY…"
    refused = {"uav_1": WatchedUav(NOW_S, None, "DAEMON_UNREACHABLE: no UAL daemon answers")}
    assert "DAEMON_UNREACHABLE" in table(refused)[3]
    ended = {"uav_1": WatchedUav(NOW_S, FLYING, gone_s=NOW_S)}
    assert table(ended)[3] == "uav_1  its daemon has ended, it was FLYING_AUTO"
    lines = watch_table.table(ended, width=80, height=24, top=0, now_s=NOW_S, lost_after_s=2.0)
    assert lines[3].style == "bold red"


# --- Drawn by rich ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "height"), [(80, 24), (40, 24), (200, 50)])
@pytest.mark.parametrize("picture", [watch_screen.FleetTable(), watch_screen.Detail()], ids=["table", "detail"])
def test_rich_draws_the_rows_as_they_are(width: int, height: int, picture: watch_screen.ScreenPicture) -> None:
    board = Board(["uav_[bold]1"], 5.0)
    board.put("uav_[bold]1", FLYING)
    picture.press([Key.DOWN], 1, height)
    console = Console(file=io.StringIO(), width=width, height=height, force_terminal=False)
    console.print(picture.draw(board, width, height))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    assert len(lines) <= height
    assert any("uav_[bold]1" in line for line in lines)
    assert any("FLYING_AUTO" in line for line in lines)


# --- Keys -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("read", "meant"),
    [
        (b"q", [Key.QUIT]),
        (b"\x1b[A", [Key.UP]),
        (b"\x1bOB", [Key.DOWN]),
        (b"kj", [Key.UP, Key.DOWN]),
        (b"\x1b[5~\x1b[6~", [Key.PAGE_UP, Key.PAGE_DOWN]),
        (b"\x1b[H\x1b[F", [Key.HOME, Key.END]),
        (b"\x1b[1~\x1b[4~", [Key.HOME, Key.END]),
        (b"\x1b[1;5A", []),
        (b"\x1b", []),
        (b"xyz\xc3\xa4", []),
        (b"", []),
    ],
)
def test_bytes_of_a_terminal_are_keys(read: bytes, meant: list[Key]) -> None:
    assert keys.decoded(read) == meant


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("q"))
    with terminal.keyboard() as keyboard:
        assert keyboard.wait(0.0) == []


# --- UAVs that come and go --------------------------------------------------------------------------------------------


def test_daemons_that_are_known_stay_where_they_cannot_be_sought() -> None:
    said: list[str] = []
    answers: list[list[Registration] | OSError] = [OSError(24, "Too many open files")] * 2

    def choose() -> list[Registration]:
        answer = answers.pop()
        if isinstance(answer, OSError):
            raise answer
        return answer

    roster = WatchRoster(CommandSession(), Board([], 5.0), 5.0, said.append, choose)
    roster.refresh()
    roster.refresh()
    assert said == ["ual: daemons that begin or end are not seen now: Too many open files"]


def test_daemons_appear_and_vanish(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    board = Board([], 5.0)
    roster = WatchRoster(CommandSession(), board, 5.0, said.append)

    def telemetry_of(ns: str) -> Telemetry | None:
        return board.watched_uavs()[ns].telemetry

    def wait_for_telemetry(ns: str) -> None:
        until(lambda: telemetry_of(ns), f"telemetry of {ns}", seen=board.watched_uavs)

    start_daemon(ns="uav_10").wait_for("listening")
    roster.update()
    assert list(board.watched_uavs()) == ["uav_10"]
    second = start_daemon(ns="uav_2")
    second.wait_for("listening")
    roster.update()
    assert list(board.watched_uavs()) == ["uav_2", "uav_10"]
    wait_for_telemetry("uav_2")
    second.process.kill()
    second.wait()
    roster.update()
    assert board.watched_uavs()["uav_2"].gone_s is not None
    assert said[-1] == "ual: uav_2: its daemon has ended"
    board.put("uav_2", FLYING)  # its last sample comes late
    assert board.watched_uavs()["uav_2"].gone_s is not None
    monkeypatch.setattr(watch_board, "GONE_UAV_S", 0.0)
    assert list(board.watched_uavs()) == ["uav_10"]
    start_daemon(ns="uav_2").wait_for("listening")
    roster.update()
    wait_for_telemetry("uav_2")
    roster.close()


@pytest.mark.parametrize(("count", "rate_hz"), [(1, 5.0), (40, 5.0), (200, 1.0)])
def test_many_uavs_are_queried_less_often(count: int, rate_hz: float) -> None:
    assert default_rate_hz(count) == rate_hz


def test_why_there_is_no_telemetry_stays_until_there_is() -> None:
    board = Board(["uav_1"], 5.0)
    board.put_error("uav_1", DaemonUnreachableError("no daemon answers"))
    assert board.watched_uavs()["uav_1"].why == "DAEMON_UNREACHABLE: no daemon answers"
    board.put("uav_1", FLYING)
    assert board.watched_uavs()["uav_1"].why == ""
