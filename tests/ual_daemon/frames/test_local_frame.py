"""Home and the place of the start while the autopilot's local frame moves: from hand-made snapshots."""

from __future__ import annotations

import pytest

from ual.errors import WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import GpsFix, GpsInfo
from ual_daemon.backends.values import Condition, EarthReference, Estimator, LinkState, MotionState, Sample, Snapshot
from ual_daemon.frames.local_frame import LocalFrame
from ual_daemon.geodesy import FlatProjection

ORIGIN = FlatProjection(47.0, 8.0, 400.0)
FIX, NO_FIX = GpsInfo(GpsFix.FIX_3D), GpsInfo(GpsFix.NONE)
HOME = Vector3(10.0, 0.0, 0.0)


def moved(x: float, y: float = 0.0, z: float = 0.0) -> FlatProjection:
    """The projection of a local frame whose origin is elsewhere."""
    point = ORIGIN.to_geo(Vector3(x, y, z))
    return FlatProjection(point.latitude_deg, point.longitude_deg, 400.0 + z)


def at(
    time_s: float,
    projection: FlatProjection | None = ORIGIN,
    boots_count: int = 0,
    gps: GpsInfo | None = FIX,
    *,
    is_good: bool = True,
) -> Snapshot:
    return Snapshot(
        time_s,
        motion=MotionState(estimator=Sample(Estimator(is_good), time_s), pose=Sample(Pose.at(0.0, 0.0, 0.0), time_s)),
        earth=EarthReference(projection=projection),
        condition=Condition(gps=gps),
        link=LinkState(boots_count=boots_count),
    )


def near(x: float, y: float = 0.0, z: float = 0.0) -> object:
    return pytest.approx((x, y, z), abs=0.01)


@pytest.fixture
def frame() -> LocalFrame:
    """With home 10 m east of the local origin."""
    frame = LocalFrame()
    frame.update(at(0.0))
    frame.set_home(HOME, at(0.1), set_z=False)
    frame.update(at(0.2))
    return frame


def test_it_follows_a_new_boot_once_the_satellites_have_placed_it(frame: LocalFrame) -> None:
    for snapshot in (at(1.0, None, 1, NO_FIX), at(2.0, moved(10.0), 1, NO_FIX)):  # an origin alone may be a made-up one
        frame.update(snapshot)
        assert frame.home.loss is not None
        assert "satellite fix" in frame.home.loss.remedy
    frame.update(at(3.0, moved(10.0), 1))
    assert frame.home.loss is None
    assert tuple(frame.home.local) == near(0.0)
    assert tuple(frame.start.local) == near(-10.0)


def test_it_follows_an_origin_that_moves_at_once(frame: LocalFrame) -> None:
    frame.update(at(1.0, moved(3.0, 4.0, -2.0), gps=NO_FIX))
    assert tuple(frame.home.local) == near(7.0, -4.0, 2.0)


def test_it_does_not_drift_when_the_origin_moves_often(frame: LocalFrame) -> None:
    for count in range(200):
        frame.update(at(1.0 + count, moved(100.0 * (count % 7), 50.0 * (count % 3))))
    frame.update(at(300.0))
    assert tuple(frame.home.local) == pytest.approx((10.0, 0.0, 0.0), abs=1e-6)


def test_while_its_origin_is_doubted_it_is_lost_and_then_as_before(frame: LocalFrame) -> None:
    frame.update(at(1.0, None))
    assert None not in (frame.home.loss, frame.map_loss)
    frame.update(at(1.1))
    assert [frame.home.loss, frame.map_loss] == [None, None]
    assert tuple(frame.home.local) == near(10.0)


def test_a_loss_keeps_its_time_when_its_reason_changes(frame: LocalFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter(["2026-01-01T00:00:00Z", "2026-01-01T00:01:00Z", "2026-01-01T00:02:00Z", "2026-01-01T00:03:00Z"])
    monkeypatch.setattr("ual_daemon.frames.anchor.utc_text", lambda: next(times))
    frame.update(at(1.0, None))
    assert frame.home.loss is not None
    since = frame.home.loss.since
    frame.update(at(2.0, None, 1, NO_FIX))
    assert frame.home.loss.since == since
    assert "rebooted" in frame.home.loss.why


def test_without_satellites_a_boot_loses_it_for_good() -> None:
    frame = LocalFrame()
    frame.update(at(0.0, None, gps=NO_FIX))
    frame.update(at(1.0, None, 1, NO_FIX))
    frame.update(at(9.0, moved(5.0), 1))  # outdoors now: home is still not known
    assert frame.home.loss is not None
    assert frame.home.geo is None
    frame.set_home(Vector3(1.0, 2.0, 0.3), at(10.0, moved(5.0), 1), set_z=False)
    assert frame.home.loss is None
    assert tuple(frame.home.local) == (1.0, 2.0, 0.3)  # its height was lost, too
    assert tuple(frame.start.local) == (1.0, 2.0, 0.3)


def test_an_origin_that_was_set_by_hand_ties_nothing() -> None:
    frame = LocalFrame()
    frame.update(at(0.0, gps=NO_FIX))
    frame.update(at(1.0, None, 1, NO_FIX))
    assert frame.home.loss is not None
    assert frame.home.geo is None


def test_a_boot_before_the_first_position_loses_nothing() -> None:
    frame = LocalFrame()
    frame.update(at(0.0, is_good=False))
    frame.update(at(1.0, None, 1, NO_FIX, is_good=False))
    frame.update(at(2.0, moved(50.0), 1))
    assert frame.home.loss is None
    assert tuple(frame.home.local) == (0.0, 0.0, 0.0)


def test_a_backend_that_reports_no_receiver_is_believed_after_a_while() -> None:
    frame = LocalFrame()
    frame.update(at(0.0, gps=None))
    assert frame.home.geo is None
    frame.update(at(4.0, gps=None))
    assert frame.home.geo is not None


def test_jumps_one_after_another_lose_a_frame_once(caplog: pytest.LogCaptureFixture) -> None:
    indoors = LocalFrame()
    indoors.update(at(0.0, None, gps=NO_FIX))
    for _ in range(5):
        indoors.estimate_jumped(Vector3(5.0, 0.0, 0.0))
    assert [each.split()[0] for each in caplog.messages] == ["frame_lost"]


def test_a_jump_of_the_estimate_loses_only_what_nothing_ties_to_earth(frame: LocalFrame) -> None:
    frame.estimate_jumped(Vector3(5.0, 0.0, 0.0))
    assert frame.home.loss is None
    indoors = LocalFrame()
    indoors.estimate_jumped(Vector3(5.0, 0.0, 0.0))  # it finds its position for the first time
    assert indoors.home.loss is None
    indoors.update(at(0.0, None, gps=NO_FIX))
    indoors.estimate_jumped(Vector3(5.0, 0.0, 0.0))
    assert indoors.home.loss is not None
    assert "5.0 m" in indoors.home.loss.why


def test_a_home_of_the_boot_before_is_refused(frame: LocalFrame) -> None:
    frame.update(at(1.0, moved(10.0), 1))
    with pytest.raises(WrongStateError, match="rebooted"):
        frame.set_home(Vector3(), at(0.9), set_z=True)
    assert tuple(frame.home.local) == near(0.0)


def test_what_is_known_costs_nothing(frame: LocalFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: Snapshot) -> bool:
        raise AssertionError("nothing has changed")

    assert not frame.update(at(0.3))
    monkeypatch.setattr(frame, "_follow", fail)
    for count in range(10):
        assert not frame.update(at(1.0 + count))
