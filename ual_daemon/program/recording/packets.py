"""Raw packets in a recording: bytes as they were on the wire, so that a flight can be decoded again."""

from __future__ import annotations

from ual.recording.recorder import Entry, Output, SteadyUtc
from ual.recording.topics import Topic
from ual_daemon.backends.values import Packet

_MOST_PEERS = 64
"""Most remote ends of a link that are distinguished; a flood of addresses shares one."""


class PacketTopics:
    """Writes the packets of one UAV's link. A channel for each direction and each other end.

    The time of a message is when the packet was received or had left, on the recorder's clock. The time of its
    publication is the same moment as the computer's clock said it then.
    """

    def __init__(self, ns: str, clock: SteadyUtc) -> None:
        self._ns = ns
        self._clock = clock
        self._topics: dict[tuple[bool, str], Topic] = {}

    def write(self, output: Output, entry: Entry) -> None:
        """Writes a packet."""
        packet: Packet = entry.value
        key = (packet.is_sent, packet.peer)
        if key not in self._topics and len(self._topics) >= _MOST_PEERS:
            key = (packet.is_sent, "")
        topic = self._topics.get(key)
        if topic is None:
            topic = self._topics[key] = self._new(packet.encoding, *key)
        output.write(topic, packet.data, entry.log_ns, round(packet.utc_s * 1e9))

    def _new(self, encoding: str, is_sent: bool, peer: str) -> Topic:
        direction = "sent" if is_sent else "received"
        return Topic(f"/{self._ns}/raw/{direction}", encoding, None, {"direction": direction, "peer": peer})
