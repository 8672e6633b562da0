"""Messages of RTCM 3 for tests, framed by a second implementation of CRC-24Q: bit by bit, as the standard has it."""

from __future__ import annotations

from itertools import count

POLYNOMIAL = 0x1864CFB


def crc24q(data: bytes) -> int:
    """The remainder of the message, followed by 24 zeros, after division by the polynomial."""
    remainder = 0
    for byte in (*data, 0, 0, 0):
        for bit in range(7, -1, -1):
            remainder = remainder << 1 | byte >> bit & 1
            if remainder & 1 << 24:
                remainder ^= POLYNOMIAL
    return remainder


def framed(content: bytes) -> bytes:
    """A message with this content."""
    head = b"\xd3" + len(content).to_bytes(2, "big")
    return head + content + crc24q(head + content).to_bytes(3, "big")


def message(length: int, seed: int = 0) -> bytes:
    """A message of so many bytes in all, with a content that differs by seed. The number of its type is
    4072, a maker's own, whose content no program looks into."""
    content = (4072 << 4).to_bytes(2, "big") + bytes((seed * 31 + each * 7) % 256 for each in range(length - 8))
    return framed(content)


def messages(lengths: list[int]) -> list[bytes]:
    """Messages of these lengths, each another one."""
    return [message(length, seed) for length, seed in zip(lengths, count(), strict=False)]
