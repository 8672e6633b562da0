"""The framing of RTCM 3: whole messages are found in any stream, and nothing else is."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from tests import rtcm
from tests.rtcm import framed
from ual_daemon.services.rtcm import MOST_FALSE_STARTS, RtcmFramer, crc24q

END = bytes(1029)
"""Longer than any message: after it, nothing is waited for."""

contents = st.binary(min_size=2, max_size=300) | st.binary(min_size=1023, max_size=1023)
garbage = st.binary(max_size=40)


def found_in(stream: bytes, cuts: list[int]) -> tuple[list[bytes], int]:
    framer = RtcmFramer()
    edges = [0, *sorted(each % (len(stream) + 1) for each in cuts), len(stream)]
    found = [message for a, b in pairwise(edges) for message in framer.feed(stream[a:b])]
    return found, framer.skipped_count


def test_a_message_of_the_standard_is_known() -> None:
    """Message 1005 of an example that many decoders are tested with (RTCM 10403, section 4.2)."""
    known = bytes.fromhex("d300133ed7d30202980edeef34b4bd62ac0941986f33360b98")
    assert crc24q(known) == 0
    assert crc24q(known[:-3]) == rtcm.crc24q(known[:-3]) == 0x360B98
    assert RtcmFramer().feed(known) == [known]


@given(st.binary(max_size=200))
def test_the_checksum_is_that_of_the_standard(data: bytes) -> None:
    assert crc24q(data) == rtcm.crc24q(data)


@given(st.lists(contents, max_size=5), st.lists(st.integers(0, 10_000), max_size=6))
def test_messages_are_found_however_the_stream_is_cut(contents: list[bytes], cuts: list[int]) -> None:
    messages = [framed(each) for each in contents]
    assert found_in(b"".join(messages), cuts) == (messages, 0)


@given(
    st.lists(st.tuples(garbage, contents, st.integers(0, 2), st.integers(1, 1000)), max_size=5),
    st.lists(st.integers(0, 10_000), max_size=6),
)
def test_whole_messages_are_found_between_garbage_and_cut_and_damaged_ones(
    parts: list[tuple[bytes, bytes, int, int]], cuts: list[int]
) -> None:
    stream, whole = b"", []
    for between, content, fate, where in parts:
        message = framed(content)
        at = where % len(message)
        if fate == 0:
            whole.append(message)
        elif fate == 1:
            message = message[:at]
        else:
            message = message[:at] + bytes([message[at] ^ 0x55]) + message[at + 1 :]
        stream += between + message
    found, skipped_count = found_in(stream + END, cuts)
    assert found == _whole_in(stream)
    assert set(whole) <= set(found)
    assert len(stream) <= skipped_count + sum(map(len, found)) <= len(stream + END)


def _whole_in(stream: bytes) -> list[bytes]:
    """The same by brute force: at each place, whether a frame with a right checksum begins there."""
    found, at = [], 0
    padded = stream + END
    while at < len(stream):
        length = int.from_bytes(padded[at + 1 : at + 3], "big")
        end = at + 6 + length
        if (
            padded[at] == 0xD3
            and 2 <= length <= 1023
            and rtcm.crc24q(padded[at : end - 3]) == int.from_bytes(padded[end - 3 : end], "big")
        ):
            found.append(padded[at:end])
            at = end
        else:
            at += 1
    return found


def test_a_filler_and_a_head_with_wrong_bits_are_skipped() -> None:
    framer, message = RtcmFramer(), rtcm.message(50)
    assert framer.feed(framed(b"") + framed(b"x") + b"\xd3\xff\x00" + message) == [message]
    assert framer.skipped_count == 6 + 7 + 3


def test_what_is_not_whole_is_waited_for() -> None:
    framer, message = RtcmFramer(), rtcm.message(50)
    assert [framer.feed(bytes([each])) for each in message[:-1]] == [[]] * 49
    assert framer.feed(message[-1:]) == [message]
    assert framer.skipped_count == 0


def test_a_flood_of_false_starts_costs_little() -> None:
    framer = RtcmFramer()
    assert framer.feed(b"\xd3\x03\xff" * 1365) == []
    assert framer.skipped_count == 3 * 1365
    assert MOST_FALSE_STARTS * 1029 < 70_000  # bytes whose checksum is computed for one element of a stream
    assert framer.feed(rtcm.message(60)) == [rtcm.message(60)]
