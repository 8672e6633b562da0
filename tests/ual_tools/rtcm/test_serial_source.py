"""Corrections from a serial port, which is a pseudo-terminal here: what is written at its other end comes out."""

from __future__ import annotations

import os
import tty
from collections import deque
from collections.abc import Iterator
from contextlib import closing
from typing import NamedTuple

import pytest

from tests import rtcm
from tests.waiting import until
from ual_tools.rtcm.reader import CorrectionsReader
from ual_tools.rtcm.source import SerialSource, SourceError, serial_source

SENT = rtcm.messages([30, 300, 1029])


class LinkStub(NamedTuple):
    """A receiver's end of a serial line, and the path of the other one."""

    end: int
    path: str


@pytest.fixture
def serial_link_stub() -> Iterator[LinkStub]:
    end, other = os.openpty()
    tty.setraw(other)
    try:
        yield LinkStub(end, os.ttyname(other))
    finally:
        os.close(other)
        if end >= 0:
            _close(end)


def _close(end: int) -> None:
    try:
        os.close(end)
    except OSError:
        return  # the test has closed it


def read(source: SerialSource, count: int, serial_link_stub: LinkStub, data: bytes) -> bytes:
    """Writes data once the port is open, and returns what comes, up to so many bytes."""
    found = bytearray()
    with closing(source.chunks()) as chunks:
        next(chunks)  # it is open, and nothing has come
        written = 0
        while len(found) < count:
            written += os.write(serial_link_stub.end, data[written : written + 500])  # the terminal takes 4 kB at most
            found += next(chunks)
    return bytes(found)


def test_what_a_base_sends_comes_whole_and_in_order(serial_link_stub: LinkStub) -> None:
    data = b"".join(SENT)
    source = serial_source(f"{serial_link_stub.path}:9600")
    assert source.name == f"{serial_link_stub.path}:9600"
    assert read(source, len(data), serial_link_stub, data) == data
    assert read(source, len(data), serial_link_stub, data) == data  # it can be opened again


def test_without_a_rate_it_is_the_usual_one(serial_link_stub: LinkStub) -> None:
    assert serial_source(serial_link_stub.path).name == f"{serial_link_stub.path}:115200"


def test_an_unplugged_or_absent_port_is_reported_and_tried_again(serial_link_stub: LinkStub) -> None:
    with closing(serial_source(serial_link_stub.path).chunks()) as chunks:
        assert next(chunks) == b""
        os.close(serial_link_stub.end)
        with pytest.raises(SourceError):
            deque(chunks, maxlen=0)
    with (
        closing(serial_source("/dev/no such port").chunks()) as chunks,
        pytest.raises(SourceError, match="No such file"),
    ):
        next(chunks)
    told: list[str] = []
    with CorrectionsReader(serial_source("/dev/no such port"), told.append, first_pause_s=0.01):
        until(lambda: len(told) > 1, "a second try")
    assert told[0].startswith("/dev/no such port:115200: ")
    assert "; trying again in " in told[0]


def test_a_port_that_another_program_has_is_not_read(serial_link_stub: LinkStub) -> None:
    with (
        closing(serial_source(serial_link_stub.path).chunks()) as mine,
        closing(serial_source(serial_link_stub.path).chunks()) as theirs,
    ):
        next(mine)
        with pytest.raises(SourceError):
            next(theirs)
