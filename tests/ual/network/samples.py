"""Reports as daemons send them, for tests."""

from __future__ import annotations

from ual.geometry import IDENTITY, Transform, Vector3
from ual.network.keys import Source
from ual.network.values import Report, Teller, UavReport
from ual.types import Battery, State, Telemetry

SOURCE = Source("farm", "uav_1", "00000000000000aa")


def source(publisher: str = "uav_1", instance: int = 0xAA, site: str = "farm") -> Source:
    return Source(site, publisher, f"{instance:016x}")


def telemetry(ns: str = "uav_1", state: State = State.FLYING_AUTO) -> Telemetry:
    place = Transform(Vector3(1.0, 2.0, 3.0), IDENTITY, "map", f"{ns}/base_link", 12.5)
    return Telemetry(state=state, stamp_s=12.5, transform=place, battery=Battery(80.0), armed=True, sequence=7)


def uav(ns: str = "uav_1", address: str = "10.0.0.1:50051", state: State = State.FLYING_AUTO) -> UavReport:
    return UavReport(ns, telemetry(ns, state), "light", (address,), needed_role="pilot")


def report(
    *uavs: UavReport,
    host: str = "a",
    computer_id: str = "",
    started_s: float = 1.0,
    count: int = 0,
    rate_hz: float = 1.0,
) -> Report:
    told = uavs or (uav(),)
    return Report(Teller("0.2.0", host, computer_id or host, 4711, started_s, rate_hz, count or len(told)), told)
