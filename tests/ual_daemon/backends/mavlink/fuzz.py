"""Bytes that no autopilot sends, and some that it might, for a receiver and a session on a clock moved by hand."""

import random
from collections.abc import Callable, Collection
from typing import Any

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, Harness, heartbeat, packer
from tests.ual_daemon.backends.mavlink.traces import load
from ual.types import State
from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire import dialect as mavlink
from ual_daemon.flight.state import estimate

TICK_S = 0.02
STRANGER = ("10.9.8.7", 6)
SYSTEM_ID = 7
"""Of the recorded PX4; the recorded ArduPilot is another system."""
TRACES = ("px4_offboard_manual_recover", "ardupilot_guided_manual_recover")
_NASTY = (b"\xfd\xff\x00", b"\xfd", b"\xfe", b"\xfe\x1c", b"\xfd\xff\0\0\0\1\1\0\0\0", bytes(7))


def with_good_checksum(frame: bytes) -> bytes:
    """Returns a MAVLink 2 frame without a signature, its checksum made anew."""
    message_id = int.from_bytes(frame[7:10], "little")
    kind = mavlink.mavlink_map.get(message_id)
    covered = frame[1:-2]
    return b"\xfd" + covered + checksum.compute(covered, 0 if kind is None else kind.crc_extra)


class Fuzz:
    """One run. The real autopilot is heard once at the start, and now and then."""

    def __init__(self, kind: str, *, is_stream: bool, seed: int = 1) -> None:
        self.harness = Harness(is_stream=is_stream)
        self.bytes_count = 0
        self._pack = packer(SYSTEM_ID)
        self._noise = random.Random(f"{kind} {seed}")
        self._make: Callable[[], bytes] = getattr(self, f"_{kind}")
        self._frames = [data for name in TRACES for _, data in load(name).frames if data[0] == 0xFD and not data[2]]
        self._steps_count = 0
        self.harness.receive(data=self._pack(heartbeat()))

    def step(self) -> None:
        """Receives some datagrams, or pieces of a stream; does what is due."""
        harness = self.harness
        self._steps_count += 1
        harness.now_s += TICK_S
        if self._steps_count % 50 == 0:
            harness.receive(data=self._pack(heartbeat()))
        for _ in range(4):
            data = self._make()
            self.bytes_count += len(data)
            address = STRANGER if self._noise.random() < 0.1 and not harness.link.is_stream else ADDRESS
            harness.receive(data=data, address=address)
        harness.discovery.tick(harness.now_s)
        harness.link.sent.clear()
        state = estimate(harness.snapshot(), harness.session.dialect.freshness).state
        assert isinstance(state, State)
        harness.session.info()

    def _random(self) -> bytes:
        return self._noise.randbytes(self._noise.randrange(1, 1400))

    def _magics(self) -> bytes:
        pieces = self._noise.choices([*_NASTY, *(self._noise.randbytes(3) for _ in range(3))], k=200)
        return b"".join(pieces)[: self._noise.randrange(1, 1400)]

    def _replayed(self) -> bytes:
        return b"".join(self._noise.choices(self._frames, k=self._noise.randrange(1, 4)))

    def _damaged(self) -> bytes:
        frame = bytearray(self._noise.choice(self._frames))
        for _ in range(self._noise.randrange(1, 4)):
            frame[self._noise.randrange(len(frame))] = self._noise.choice((0xFD, 0xFE, self._noise.randrange(256)))
        return bytes(frame[: self._noise.randrange(1, len(frame) + 1)] if self._noise.random() < 0.3 else frame)

    def _mutated(self) -> bytes:
        """Real packets of any system and sequence, with other contents and a right checksum."""
        frame = bytearray(self._noise.choice(self._frames))
        for _ in range(self._noise.randrange(1, 9)):
            at = self._noise.randrange(10, len(frame))
            frame[at] = self._noise.choice((0, 0x7F, 0xFF, self._noise.randrange(256)))
        frame[4] = self._noise.randrange(256)
        if self._noise.random() < 0.2:
            frame[5] = self._noise.randrange(256)
        return with_good_checksum(bytes(frame))

    def _invented(self) -> bytes:
        """Any message that there is, with any content, of our system."""
        message_id = self._noise.choice(sorted(checksum.KNOWN_IDS & mavlink.mavlink_map.keys()))
        if self._noise.random() < 0.5:
            message_id = self._noise.choice(sorted(self.harness.session.decoded_ids))
        longest = min(255, mavlink.mavlink_map[message_id].layout.payload.size + 8)
        content = self._noise.randbytes(self._noise.randint(1, longest))
        header = bytes((0xFD, len(content), 0, 0, self._noise.randrange(256), SYSTEM_ID, 1)) + message_id.to_bytes(
            3, "little"
        )
        return with_good_checksum(header + content + b"\0\0")


KINDS = ("random", "magics", "replayed", "damaged", "mutated", "invented")


def sizes(root: object) -> dict[str, int]:
    """Returns the size of every container and text that is reached from an object of ours by its attributes."""
    found: dict[str, int] = {}
    seen: set[int] = set()

    def visit(value: Any, name: str) -> None:
        if id(value) in seen:
            return
        seen.add(id(value))
        if isinstance(value, (str, bytes, Collection)) and not isinstance(value, type):
            found[name] = len(value)
        elif type(value).__module__.startswith("ual_daemon"):
            names = [*getattr(value, "__dict__", {}), *getattr(type(value), "__slots__", ())]
            for each in names:
                visit(getattr(value, each, None), f"{name}.{each}")

    visit(root, "")
    return found
