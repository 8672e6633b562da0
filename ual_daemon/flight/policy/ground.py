"""The ground from which the UAV took off: what the floor and the ceiling are measured from."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ual.geometry import Vector3
from ual.types import State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import Estimate
from ual_daemon.geodesy import Projection

MEASURED_NOISE_M = 0.7
"""Error of the estimated height in metres: PX4's wanders by 0.3 to 0.7 m within a minute or two on the ground."""
ASSUMED_NOISE_M = 2.0
"""The same where the ground is assumed: PX4 corrects the altitude of its home by up to 1.7 m in flight."""
_SAME_ORIGIN_M = 0.01
_GROUND_CONFIRMATION_S = 1.0
"""Seconds for which the autopilot must have reported that it stands, where UAL flies by references: it may err for a
moment.
"""


class Datum(NamedTuple):
    """The ground: its z in the local frame, its human-readable name, and how far it may be off."""

    z_m: float
    name: str
    noise_m: float


class Ground:
    """The ground of the present or the last take-off, as the autopilot's data have shown it.

    It is not known after the daemon was started in flight or the link was lost: the UAV may have landed and taken off
    elsewhere in the meantime. Nor is it known after the local frame has moved. The autopilot's home is then taken for
    it.
    """

    def __init__(self) -> None:
        self.place: Vector3 | None = None
        """Position at which the UAV last stood on the ground, in the local frame; None if that is not known."""
        self._origin: Projection | None = None
        self._stands_s: float | None = None
        """Since when it stands armed; None while it does not."""

    @property
    def z_m(self) -> float | None:
        """Its z in the local frame; None if it is not known."""
        return None if self.place is None else self.place.z

    def observe(
        self,
        snapshot: Snapshot,
        raw: Estimate,
        *,
        is_taking_off: bool = False,
        is_on_way: bool = False,
        is_led: bool = False,
    ) -> None:
        """Notes what an update says of the ground. `is_led` is whether UAL flies by references, on a way or not.

        In a take-off the autopilot says for a while that it stands, though it rises already: then the ground stays. So
        it does on a way of UAL: ArduPilot whose motors are stopped in the air says that it stands, and 0.1 s later that
        it is not armed. Under other references it has to stand for a second.
        """
        if raw.state is not State.LANDED_ARMED:
            self._stands_s = None
        elif self._stands_s is None:
            self._stands_s = snapshot.time_s
        if is_taking_off and self.place is not None and raw.is_link_up:
            return
        if raw.state is State.LANDED_DISARMED or (not is_on_way and self._stands(snapshot, is_led=is_led)):
            assert snapshot.motion.pose is not None
            self.place, self._origin = snapshot.motion.pose.value.position, snapshot.earth.projection
        elif self.place is not None and (not raw.is_link_up or self._has_origin_moved(snapshot)):
            self.place = None

    def _stands(self, snapshot: Snapshot, *, is_led: bool) -> bool:
        """Returns whether it stands armed, for long enough to believe that."""
        needed_s = _GROUND_CONFIRMATION_S if is_led and self.place is not None else 0.0
        return self._stands_s is not None and snapshot.time_s - self._stands_s >= needed_s

    def estimate_jumped(self, jump: Vector3) -> None:
        """Notes that the autopilot's estimate has jumped: the ground has not."""
        if self.place is not None:
            self.place += jump

    def _has_origin_moved(self, snapshot: Snapshot) -> bool:
        before, now = self._origin, snapshot.earth.projection
        if now is before or before is None or now is None:
            return False
        return abs(now.altitude_amsl_m - before.altitude_amsl_m) > _SAME_ORIGIN_M

    def datum(self, snapshot: Snapshot, odom_z_m: Callable[[], float]) -> Datum:
        """Returns what heights are measured from. `odom_z_m` returns the z of the origin of ``<ns>/odom``."""
        if (z_m := self.z_m) is not None:
            return Datum(z_m, "the ground of the take-off", MEASURED_NOISE_M)
        home_m, projection = snapshot.earth.home_altitude_amsl_m, snapshot.earth.projection
        if home_m is not None and projection is not None:
            home_z_m = home_m - projection.altitude_amsl_m
            return Datum(home_z_m, "the autopilot's home (UAL has not seen the take-off)", ASSUMED_NOISE_M)
        return Datum(odom_z_m(), "the origin of odom (UAL has not seen the take-off, nor a home)", ASSUMED_NOISE_M)
