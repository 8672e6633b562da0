"""When a mission is read again to see whether another station has replaced it."""

from __future__ import annotations

from tests.ual_daemon.flight.manoeuvres.test_autopilot_mission import KEPT, Missions
from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import KeptMission, MissionReport
from ual_daemon.flight.manoeuvres.mission_watch import SETTLE_S, MissionWatch


def tell(offer: Missions, mission_id: int, *changes: int) -> None:
    offer.told = MissionReport(MissionStage.ACTIVE, 1, None, 0.0, mission_id, changes=changes)


def test_another_checksum_is_read_at_once() -> None:
    """PX4 tells it once the upload has ended, and up to 1 s late: no time is left to wait."""
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, KEPT.mission_id, 4)
    watch.step(0.0, 1)
    assert not offer.asked
    tell(offer, KEPT.mission_id + 1, 2)
    watch.step(1.0, 1)
    assert offer.asked == ["download"]
    offer.read.set_result(KeptMission(KEPT.items, "another"))
    watch.step(1.1, 1)
    assert watch.is_other


def test_without_a_checksum_it_is_read_once_the_upload_has_ended() -> None:
    offer = Missions()
    watch = MissionWatch(offer, KEPT)
    tell(offer, 0, 4, 0)
    watch.step(0.0, 1)
    offer.read.set_result(KEPT)
    watch.step(0.1, 1)
    for text in (1, 2, 3):
        tell(offer, 0, 4, text)
        watch.step(1.0 + 0.1 * text, 1)
    assert offer.asked == ["download"]
    watch.step(1.3 + SETTLE_S, 1)
    assert offer.asked == ["download", "download"]
