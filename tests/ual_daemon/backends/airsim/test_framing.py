"""Ends of messages."""

from __future__ import annotations

import struct

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.airsim.framing import MalformedError, least_end, message_end

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(VALUES, st.binary(max_size=3))
def test_a_message_ends_where_its_encoding_does(value: object, after: bytes) -> None:
    message = msgspec.msgpack.encode(value)
    assert message_end(message + after) == len(message)


@given(VALUES)
def test_no_part_of_a_message_is_taken_for_all_of_it(value: object) -> None:
    message = msgspec.msgpack.encode(value)
    for length in {0, len(message) // 2, len(message) - 1}:
        assert message_end(message[:length]) is None


@given(st.lists(st.floats(width=32) | st.integers(0, 300), min_size=1, max_size=60), st.floats(0.0, 1.0))
def test_what_an_incomplete_message_needs_at_least_is_more_than_it_has_and_no_more_than_it_is(
    values: list[float], part: float
) -> None:
    message = msgspec.msgpack.encode([as_float32(values), b"x" * 40, "end"])
    length = int(part * (len(message) - 1))
    assert length < least_end(message[:length]) <= len(message)
    assert least_end(message + b"\xca" * 9) == len(message)


def as_float32(values: list[float]) -> msgspec.Raw:
    """An array as rpclib sends it: floats of 32 bits, and here other numbers between them."""
    head = struct.pack(">BI", 0xDD, len(values))
    floats = (struct.pack(">Bf", 0xCA, each) for each in values if isinstance(each, float))
    return msgspec.Raw(head + b"".join(floats) + b"\x05" * sum(isinstance(each, int) for each in values))


def test_the_depths_of_a_picture_are_not_looked_at_one_by_one() -> None:
    message = msgspec.msgpack.encode([as_float32([1.5] * 400_000), b"end"])
    looks_count, received = 0, 0
    while received < len(message):
        received = least_end(message[:received]) if received else 1
        looks_count += 1
    assert least_end(message) == len(message)
    assert looks_count < 80


@pytest.mark.parametrize("length", [1, 31, 32, 255, 256, 65535, 65536])
def test_lengths_of_each_size(length: int) -> None:
    for value in ("x" * length, b"x" * length, [None] * length, dict.fromkeys(range(length))):
        message = msgspec.msgpack.encode(value)
        assert message_end(message) == len(message)


def test_extensions() -> None:
    for length in (1, 2, 4, 8, 16, 17, 256, 65536):
        message = msgspec.msgpack.encode(msgspec.msgpack.Ext(5, b"x" * length))
        assert message_end(message) == len(message)


def test_what_is_no_messagepack_is_refused() -> None:
    with pytest.raises(MalformedError, match="0xc1"):
        message_end(b"\xc1")
