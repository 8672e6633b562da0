"""The UAVs of many computers, found without a list: presence and a small telemetry over Zenoh (docs/how-to/network.md).

Needs the package eclipse-zenoh: extra ``network``. Nothing here flies a UAV: that is `ual.Uav`, over gRPC.

>>> from ual import network
>>> for uav in network.discover():
...     print(uav.ns, uav.telemetry.state, uav.addresses)
>>> with network.Network() as site, ual.Uav("uav_7", network=site) as uav:
...     uav.take_off(3.0)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.network.settings import LOOPBACK, NetworkSettings, Scouting
from ual.network.values import NetworkUav
from ual.shared.late import late

if TYPE_CHECKING:
    from ual.network.listening import Network, discover

__all__ = ["LOOPBACK", "Network", "NetworkSettings", "NetworkUav", "Scouting", "discover"]


if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    __getattr__ = late("ual.network", "listening", "Network", "discover")
