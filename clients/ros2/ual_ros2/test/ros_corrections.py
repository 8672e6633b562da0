"""Corrections by the topic and the service of the node."""

from __future__ import annotations

import array
import math
from collections.abc import Callable, Iterable
from typing import Any

from flying import Client, waited
from std_msgs.msg import UInt8MultiArray
from ual_msgs import srv

from ual.corrections import CorrectionsStatus
from ual.interface import Corrections

Call = Callable[..., Any]


class RosCorrections(Corrections):
    """The corrections of one UAV."""

    def __init__(self, client: Client, ns: str, call: Call) -> None:
        self._client = client
        self._topic = f"/{ns}/ual/corrections"
        self._call = call

    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        """Publishes all of it, and waits until the node, which is the sender, has ended its stream."""
        count = self._ask().received_count
        for each in rtcm:
            message = UInt8MultiArray(data=array.array("B", each))
            self._client.publish(UInt8MultiArray, self._topic, message, 100)
            count += 1
        waited(lambda: self._ask().received_count == count and not self._ask().sender)
        return self.status()

    def status(self) -> CorrectionsStatus:
        told = self._ask()
        return CorrectionsStatus(
            told.sender,
            told.messages_count,
            told.bytes_count,
            told.dropped_count,
            told.too_long_count,
            told.skipped_bytes_count,
            None if math.isnan(told.age) else told.age,
        )

    def _ask(self) -> Any:
        return self._call(srv.GetCorrectionsStatus, "get_corrections_status").status
