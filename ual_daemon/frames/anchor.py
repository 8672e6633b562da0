"""Anchors: points that stay true when the autopilot's local frame moves, or say that they are lost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime, timezone

from ual.errors import FrameLostError
from ual.geometry import Vector3
from ual.types import GeoPoint, GpsFix
from ual_daemon.backends.values import Snapshot
from ual_daemon.geodesy import Projection

_ORIGIN = Vector3()


@dataclass(frozen=True, slots=True)
class Loss:
    """Why it is not known where something is, since when (UTC, ISO 8601), and what makes it known again."""

    why: str
    since: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.why} (since {self.since}): {self.remedy}"

    def error(self, frame_id: str) -> FrameLostError:
        """Returns the error for a command in a frame that is lost."""
        return FrameLostError(
            f"it is not known where {frame_id} is: {self}",
            {"frame_id": frame_id, "since": self.since, "remedy": self.remedy},
        )


@dataclass(frozen=True, slots=True)
class Anchor:
    """A point of the local frame. Where it is known on Earth, it follows when the local frame moves.

    Attributes:
        local: Where it is in the present local frame. While it is lost: the local origin, so that what does not depend
            on the point can still be computed.
        geo: Where it is on Earth; None if nothing ties it to Earth (yet).
        loss: Why it is not known where it is; None while it is known.

    """

    local: Vector3 = _ORIGIN
    geo: GeoPoint | None = None
    loss: Loss | None = None

    def tied(self, projection: Projection) -> Anchor:
        """Returns the anchor with its place on Earth, if it has none yet."""
        if self.geo is not None or self.loss is not None:
            return self
        return replace(self, geo=projection.to_geo(self.local))

    def followed(self, projection: Projection) -> Anchor:
        """Returns the anchor in a local frame that lies elsewhere on Earth; unchanged if nothing ties it to Earth."""
        geo = self.geo
        if geo is None:
            return self
        assert geo.altitude_amsl_m is not None
        local = projection.to_local(geo.latitude_deg, geo.longitude_deg, geo.altitude_amsl_m)
        return Anchor(local, geo)

    def lost(self, why: str, remedy: str) -> Anchor:
        """Returns the anchor without its local position. A loss before keeps its time, but gets the new reason."""
        since = utc_text() if self.loss is None else self.loss.since
        return Anchor(_ORIGIN, self.geo, Loss(why, since, remedy))


def utc_text() -> str:
    """Returns the present time, as `Loss.since` has it."""
    return datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def has_fix(snapshot: Snapshot) -> bool:
    """Returns whether satellites tell the autopilot where it is on Earth.

    An origin alone does not: indoors it can be set by hand, and is then the same after each boot, wherever that is. A
    backend that does not report its satellite receiver is believed.
    """
    return snapshot.condition.gps is None or snapshot.condition.gps.fix >= GpsFix.FIX_3D
