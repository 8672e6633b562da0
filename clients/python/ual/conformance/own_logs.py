"""Checks of the logs that the autopilot has written. They are only read."""

from __future__ import annotations

import hashlib

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.logs.values import Log
from ual.types import State

_MOST_CHECKED_LOG_BYTES = 100_000
"""Bytes at the end of a log that are downloaded: more takes minutes over a radio."""


@check()
def lists_the_autopilots_logs(flight: Flight) -> None:
    """Each log is listed once; what is no log, or begins after its end, is refused."""
    listed, logs = _all(flight), flight.uav.logs
    ids = [each.id for each in listed]
    require(len(ids) == len(set(ids)) and all(ids), f"a log is listed twice, or without a name: {ids}")
    require(all(each.size_bytes >= 0 for each in listed), f"a log has no size: {listed}")
    flight.refuses(InvalidArgumentError, lambda: next(logs.download("")), "a log without a name")
    flight.refuses(InvalidArgumentError, lambda: next(logs.download("no such log")), "a log that is not there")
    flight.refuses(InvalidArgumentError, lambda: next(logs.download(ids[0], -1)), "an offset below 0")
    beyond = max(each.size_bytes for each in listed) * 2 + 1_000_000_000
    flight.refuses(InvalidArgumentError, lambda: next(logs.download(ids[0], beyond)), "an offset beyond its end")


@check(State.LANDED_DISARMED)
def downloads_a_log(flight: Flight) -> None:
    """The pieces of a log come in order, without gaps, and the last one has their hash; a part is the same again."""
    log = max(_all(flight), key=lambda each: each.size_bytes)
    if not log.size_bytes:
        raise CannotRunError("all logs are empty")
    begin = max(0, log.size_bytes - _MOST_CHECKED_LOG_BYTES)
    end = _downloaded(flight, log, begin)
    require(len(end) >= log.size_bytes - begin, f"{len(end)} of {log.size_bytes - begin} bytes came")
    end = end[: log.size_bytes - begin]  # it may grow meanwhile, and its end may be half written
    half = len(end) // 2
    again = _downloaded(flight, log, begin + half)[: len(end) - half]
    require(again == end[half:], "a part of it is another one")


def _downloaded(flight: Flight, log: Log, offset: int) -> bytes:
    data, sha256 = bytearray(), ""
    for piece in flight.uav.logs.download(log.id, offset):
        require(piece.offset == offset + len(data), f"a piece begins at {piece.offset}, not at {offset + len(data)}")
        require(not sha256, "a piece came after the last one")
        data += piece.data
        sha256 = piece.sha256
    require(sha256 == hashlib.sha256(data).hexdigest(), "the hash is not that of the pieces")
    return bytes(data)


def _all(flight: Flight) -> list[Log]:
    try:
        listed = flight.uav.logs.get_all()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None
    if not listed:
        raise CannotRunError("the autopilot has no logs")
    return listed


ON_GROUND = (lists_the_autopilots_logs, downloads_a_log)
