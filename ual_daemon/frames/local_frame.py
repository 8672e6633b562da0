"""The autopilot's local frame over time: where home and the place of the start are in it, as it moves.

An autopilot begins a local frame of its own with each boot, and may move it in flight. What was tied to Earth follows.
What was not is lost, until it is set again. `Anchor` is one such point.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import partial

from ual.errors import WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import GeoPoint
from ual_daemon import logs
from ual_daemon.backends.values import Snapshot
from ual_daemon.frames.anchor import Anchor, Loss, has_fix, utc_text
from ual_daemon.frames.home_file import HomeFile, SavedHome
from ual_daemon.geodesy import Projection

_log = logging.getLogger(__name__)

SET_HOME = "set_home makes the place where the UAV stands the new origin"
WAIT = "it is known again once the autopilot has its satellite fix; or " + SET_HOME
_NO_FIX_S = 3.0
"""Seconds without a reported satellite receiver after which a backend has none to report (MAVLink sends it at 2 Hz)."""
OLDEST_HOME_S = 12 * 3600.0
"""A home that was saved longer ago is of another day, and is forgotten."""
FARTHEST_HOME_M = 1000.0
"""Metres between a UAV and its saved home beyond which it was brought to another field."""
_NOTICED_MOVE_M = 0.05


def _nothing() -> None:
    """Nothing else moves with the local frame."""


class LocalFrame:
    """Home and the place of the start, in the present local frame. Any thread may read; see each method for the rest.

    Attributes:
        lock: Held while it moves, also by a reader of values that belong together. What it waits for then is no update.
        home: The origin of ``<ns>/odom``.
        start: Where the origin of the local frame was at first.
        map_loss: Why it is not known where a ``map`` with an origin on Earth is; None while it is known, and before it
            was known for the first time.

    """

    def __init__(
        self,
        home_file: HomeFile | None = None,
        identity: Callable[[], str] = str,
        on_moved: Callable[[], None] = _nothing,
    ) -> None:
        """`identity` returns which vehicle it is; empty while that is not known.

        `on_moved` is called with each change, with the lock held: it moves what a reader must see moved as well.
        """
        self.home = Anchor()
        self.start = Anchor()
        self.map_loss: Loss | None = None
        self.projection: Projection | None = None
        """Projection that places the anchors; None while the local frame's position on Earth is not known."""
        self.lock = threading.RLock()
        self._file, self._identity, self._on_moved = home_file, identity, on_moved
        self._saved: SavedHome | None = None
        self._boots_count = 0
        self._is_new_boot = False
        self._has_begun = False
        self._is_settled = False
        self._is_kept, self._must_save, self._saves_count = False, False, 0
        self._began_s: float | None = None
        self._home_followed = logs.RecurringEvent(_log, logging.WARNING, "home_followed")

    def open(self) -> None:
        """Reads the file. To be called once, before the first update."""
        self._saved = None if self._file is None else self._file.read()
        if self._saved is not None:
            self.home, self.start = _not_placed(self._saved)

    # --- The update thread --------------------------------------------------------------------------------------------

    def update(self, snapshot: Snapshot) -> bool:
        """Follows the local frame. Returns whether anything may have changed. Called at each update."""
        projection, boots_count = snapshot.earth.projection, snapshot.link.boots_count
        if self._is_settled and projection is self.projection and boots_count == self._boots_count:
            return False
        with self.lock:
            has_changed = self._follow(snapshot)
            if has_changed:
                self._on_moved()
            to_save = self._take_to_save()
        if to_save is not None:  # not on this thread, which flies the UAV
            threading.Thread(target=to_save, name="home file").start()
        return has_changed

    def estimate_jumped(self, jump: Vector3) -> None:
        """Notes that the autopilot's estimate has jumped: what nothing ties to Earth is lost."""
        with self.lock:
            if not self._has_begun:  # it finds its position for the first time
                return
            why = f"the autopilot's position jumped by {jump.norm():.1f} m, and nothing ties the frame to Earth"
            if self.home.geo is None:
                home = self.home.lost(why, SET_HOME)
                self.home = home if self.home.loss is not None else _noticed(home)  # jumps may come one after another
            if self.start.geo is None:
                self.start = self.start.lost(why, SET_HOME)

    # --- Any thread ---------------------------------------------------------------------------------------------------

    def set_home(self, position: Vector3, snapshot: Snapshot, *, set_z: bool) -> None:
        """Makes a position home (its height only with `set_z`, or if the height was lost).

        Raises:
            WrongStateError: The position is of an earlier boot.

        """
        with self.lock:
            if snapshot.link.boots_count != self._boots_count:  # taken just before the reboot, or just after
                raise WrongStateError("set_home: the autopilot has just rebooted; try again")
            self._follow(snapshot)
            before = self.home
            at = position if set_z or before.loss is not None else Vector3(position.x, position.y, before.local.z)
            if self._saved is not None:  # not placed yet, and perhaps another vehicle's
                self._saved, self.start = None, Anchor()
            elif self.start.loss is not None and self.start.geo is None:
                self.start = Anchor(at)  # nothing but the new home says where it is
            self.home = Anchor(at)
            self._is_kept = self._must_save = True
            self._tie(snapshot)
            self._is_settled = False
            self._on_moved()
            to_save = self._take_to_save()
        if to_save is not None:  # before the caller hears that home is set: the daemon may be killed then
            to_save()

    # --- Called with the lock held ------------------------------------------------------------------------------------

    def _follow(self, snapshot: Snapshot) -> bool:
        before = (self.home, self.start, self.map_loss, self.projection)
        if snapshot.link.boots_count != self._boots_count:
            self._begin_boot(snapshot)
        self._begun(snapshot)
        self._follow_origin(snapshot)
        self._restore(snapshot)
        self._tie(snapshot)
        self._is_settled = self._home_followed.settle(snapshot.time_s) and self._is_all_known(snapshot)
        return before != (self.home, self.start, self.map_loss, self.projection)

    def _begin_boot(self, snapshot: Snapshot) -> None:
        self._boots_count = snapshot.link.boots_count
        self._began_s = None
        if self._has_begun:
            self._is_new_boot = True
            self._lose("the autopilot rebooted")
        elif self._saved is None:  # nobody has seen a position yet
            self.home = self.start = Anchor()
            self.projection = None

    def _begun(self, snapshot: Snapshot) -> None:
        if self._began_s is None:
            self._began_s = snapshot.time_s
        estimator = snapshot.motion.estimator
        if snapshot.motion.pose is not None and estimator is not None and estimator.value.is_good:
            self._has_begun = True

    def _lose(self, what: str) -> None:
        """Loses what the present local frame gave a place."""
        self.projection = None
        wait = f"{what}, and has not said yet where its local frame is on Earth"
        for_good = f"{what}, and nothing ties the frame to Earth (no satellite fix)"
        home, start = (
            each.lost(for_good, SET_HOME) if each.geo is None else each.lost(wait, WAIT)
            for each in (self.home, self.start)
        )
        self.home, self.start = _noticed(home), start
        self.map_loss = Loss(wait, utc_text(), "it is known again once the autopilot has its satellite fix")

    def _follow_origin(self, snapshot: Snapshot) -> None:
        """Follows to where the local frame is on Earth now."""
        new, old = snapshot.earth.projection, self.projection
        if new is None:
            if old is not None:  # the backend doubts it
                self._is_new_boot = False
                self._lose_tied("the autopilot's local frame has moved")
            return
        if new is old or (self._is_new_boot and not self._has_fix(snapshot)):
            return
        self.projection = new
        if new == old:
            return
        self.home, self.start = self._home_in(new, snapshot.time_s), self._followed(self.start, new)
        self._is_new_boot, self.map_loss = False, None

    def _lose_tied(self, what: str) -> None:
        self.projection = None
        why = f"{what}, and it has not said yet where to"
        self.home, self.start = (each if each.geo is None else each.lost(why, WAIT) for each in (self.home, self.start))
        self.map_loss = Loss(why, utc_text(), "it is known again once the autopilot has said so")

    def _home_in(self, projection: Projection, now_s: float) -> Anchor:
        """Returns home in a local frame that lies elsewhere on Earth now."""
        before, home = self.home, self._followed(self.home, projection)
        if home is not before and (before.loss is not None or (home.local - before.local).norm() > _NOTICED_MOVE_M):
            x, y, z = home.local
            self._home_followed.note(now_s, x=round(x, 2), y=round(y, 2), z=round(z, 2))
            if not self._is_kept:  # it stays where it is on Earth: it is saved once
                self._is_kept = self._must_save = True
        return home

    def _followed(self, anchor: Anchor, projection: Projection) -> Anchor:
        is_tied = anchor.geo is not None and self._saved is None
        return anchor.followed(projection) if is_tied else anchor

    def _has_fix(self, snapshot: Snapshot) -> bool:
        if snapshot.condition.gps is not None:
            return has_fix(snapshot)
        return self._began_s is not None and snapshot.time_s - self._began_s > _NO_FIX_S

    def _tie(self, snapshot: Snapshot) -> None:
        projection = self.projection
        if projection is None or self._saved is not None or not self._has_begun or not self._has_fix(snapshot):
            return
        was_tied = self.home.geo is not None
        self.home, self.start = self.home.tied(projection), self.start.tied(projection)
        if self._is_kept and not was_tied:
            self._must_save = True

    def _is_all_known(self, snapshot: Snapshot) -> bool:
        """Returns whether nothing changes before the local frame, or the boot, does."""
        if not self._has_begun or self._saved is not None or self._must_save:
            return False
        if snapshot.earth.projection is not self.projection:  # waits for a fix
            return False
        return self.projection is None or all(
            each.geo is not None or each.loss is not None for each in (self.home, self.start)
        )

    # --- The file, called with the lock held --------------------------------------------------------------------------

    def _take_to_save(self) -> Callable[[], None] | None:
        """Returns the function that writes what must be saved, to be called without the lock; None if nothing must."""
        if self._file is None:
            self._must_save = False
        vehicle = self._identity() if self._must_save else ""
        if self._file is None or not vehicle:
            return None
        self._must_save = False
        self._saves_count += 1
        return partial(self._file.write, vehicle, self.home.geo, self.start.geo, self._saves_count)

    def _restore(self, snapshot: Snapshot) -> None:
        """Uses what was saved if it still holds."""
        saved, vehicle = self._saved, self._identity()
        if saved is None or not vehicle or snapshot.motion.pose is None or not self._has_begun:
            return
        is_landed = _is_landed(snapshot)
        why_not = _why_not(saved, vehicle, is_landed=is_landed)
        if why_not:
            logs.event(_log, logging.WARNING, "home_ignored", why=why_not)
            self._saved, self.home, self.start = None, Anchor(), Anchor()
        elif saved.home is None:
            self._saved = None
            self._give_up("home was set before the daemon was restarted, and nothing tied it to Earth")
        elif self.projection is not None and self._has_fix(snapshot):
            self._saved = None
            self._restore_saved(
                saved.home, saved.start, self.projection, snapshot.motion.pose.value, is_landed=is_landed
            )

    def _give_up(self, why: str) -> None:
        """Loses what was saved: only a new home helps."""
        self.home, self.start = _noticed(Anchor().lost(why, SET_HOME)), Anchor().lost(why, SET_HOME)

    def _restore_saved(
        self, home: GeoPoint, start: GeoPoint | None, projection: Projection, here: Pose, *, is_landed: bool
    ) -> None:
        placed = Anchor(geo=home).followed(projection)
        distance_m = (placed.local - here.position).norm()
        if is_landed and distance_m > FARTHEST_HOME_M:
            distance_km = distance_m / 1000.0
            self._give_up(f"home was set {distance_km:.1f} km from here, before the daemon was restarted")
            return
        self.home, self.start = placed, Anchor() if start is None else Anchor(geo=start).followed(projection)
        self._is_kept = self._must_save = True
        logs.event(
            _log,
            logging.WARNING,
            "home_restored",
            latitude_deg=home.latitude_deg,
            longitude_deg=home.longitude_deg,
            distance_m=round(distance_m, 1),
        )


def _not_placed(saved: SavedHome) -> tuple[Anchor, Anchor]:
    """Returns home and the start as long as it is not known whether what was saved still holds."""
    why = "the home that was set before the daemon was restarted is not placed yet"
    return Anchor(geo=saved.home).lost(why, WAIT), Anchor(geo=saved.start).lost(why, WAIT)


def _noticed(anchor: Anchor) -> Anchor:
    assert anchor.loss is not None
    logs.event(_log, logging.WARNING, "frame_lost", why=anchor.loss.why, remedy=anchor.loss.remedy)
    return anchor


def _why_not(saved: SavedHome, vehicle: str, *, is_landed: bool) -> str:
    """Returns why a saved home does not hold any more; empty if it does."""
    if saved.vehicle != vehicle:
        return f"it is the home of another vehicle ({saved.vehicle}, not {vehicle})"
    if is_landed and abs(saved.age_s) > OLDEST_HOME_S:
        return f"it was set {saved.age_s / 3600.0:.0f} hours ago"
    return ""


def _is_landed(snapshot: Snapshot) -> bool:
    is_armed = snapshot.control.armed is None or snapshot.control.armed.value
    return not is_armed or snapshot.control.is_on_ground
