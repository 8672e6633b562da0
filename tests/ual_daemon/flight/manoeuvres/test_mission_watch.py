"""Times at which a mission is read again to see whether another station has replaced it."""

from __future__ import annotations

from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import KEPT, Missions
from ual.errors import RejectedByAutopilotError
from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import KeptMission, MissionReport
from ual_daemon.flight.manoeuvres.mission_watch import CHANGE_DELAY_S, READ_PAUSE_S, READ_RETRY_S, MissionWatch


def tell(offer: Missions, mission_id: int, *changes: int) -> None:
    offer.told = MissionReport(MissionStage.ACTIVE, 1, None, 0.0, mission_id, changes=changes)


def test_another_checksum_is_read_at_once() -> None:
    """PX4 tells it once the upload has ended, and up to 1 s late: no time is left to wait."""
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, KEPT.mission_id, 4)
    watch.step(0.0)
    assert not offer.asked
    tell(offer, KEPT.mission_id + 1, 2)
    watch.step(1.0)
    assert offer.asked == ["download"]
    offer.read.set_result(KeptMission(KEPT.items, "another"))
    watch.step(1.1)
    assert watch.is_other


def test_without_a_checksum_it_is_read_once_the_upload_has_ended() -> None:
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, 0, 4, 0)
    watch.step(0.0)
    offer.read.set_result(KEPT)
    watch.step(0.1)
    for text in (1, 2, 3):
        tell(offer, 0, 4, text)
        watch.step(1.0 + 0.1 * text)
    assert offer.asked == ["download"]
    watch.step(1.3 + CHANGE_DELAY_S)
    assert offer.asked == ["download", "download"]


def test_without_a_checksum_it_is_read_again_and_again_for_a_third_of_the_time() -> None:
    """ArduPilot: a mission with as many items was told after 1.54 s, and where no text comes at the next item only."""
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, 0, 4, 0)
    for began_s, took_s, next_s in ((0.0, 0.02, READ_PAUSE_S), (2.0, 0.2, 0.4)):
        watch.step(began_s)
        ended_s = began_s + took_s
        for tenth in range(1, round(10 * took_s)):
            watch.step(began_s + 0.1 * tenth)
        offer.read.set_result(KEPT)
        for time_s in (ended_s, ended_s + 0.95 * next_s):
            asked = list(offer.asked)
            watch.step(time_s)
            assert offer.asked == asked
        watch.step(ended_s + next_s + 0.01)
        assert len(offer.asked) == len(asked) + 1
        offer.read.set_result(KEPT)
        watch.step(ended_s + next_s + 0.02)
    watch.step(20.0)
    offer.read.set_result(KeptMission(KEPT.items, "another"))
    watch.step(20.1)
    assert watch.is_other


def test_with_a_checksum_it_is_read_only_where_that_changes() -> None:
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, KEPT.mission_id, 4)
    for tenth in range(100):
        watch.step(0.1 * tenth)
    assert offer.asked == []


def test_a_time_in_which_no_step_is_made_is_none_of_the_read() -> None:
    """While the cause of a mode was open (0.4 s) it counted, and the next read came a second later."""
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, 0, 4, 0)
    watch.step(0.0)
    offer.read.set_result(KEPT)
    watch.step(0.5)
    watch.step(0.55)
    assert offer.asked == ["download", "download"]


def test_a_read_that_fails_is_repeated_soon_and_then_each_second() -> None:
    """One that was under way as another station began its upload failed, and the next one came a second later."""
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, 0, 4, 0)
    now_s = 0.0
    watch.step(now_s)
    for pause_s in (0.2, 0.4, 0.8, READ_RETRY_S, READ_RETRY_S):
        asked = len(offer.asked)
        offer.read.set_exception(RejectedByAutopilotError("INVALID"))
        watch.step(now_s)
        assert watch.failure is not None
        watch.step(now_s + pause_s - 0.01)
        assert len(offer.asked) == asked
        now_s += pause_s + 0.01
        watch.step(now_s)
        assert len(offer.asked) == asked + 1
