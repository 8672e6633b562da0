"""Where messages end."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.airsim.framing import MalformedError, message_end

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
