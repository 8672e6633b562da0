"""The processor time of the daemon, over that of gRPC alone (`benchmarks.bare`) for the same."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from benchmarks.children import Child
from benchmarks.ways import BARE_STREAM, BARE_UNARY, STREAM, STREAM_FENCE, UNARY, UNARY_FENCE, Flight, Way, flown

_TRIES = 3
_FLOOD_S, _QUIET_S, _LISTEN_S = 0.6, 0.5, 1.5
_ARRIVAL_S = 0.3
_FIRST = 1_000_000
_STREAMS, _CALLS = (BARE_STREAM, STREAM, STREAM_FENCE), (BARE_UNARY, UNARY, UNARY_FENCE)


def ratios() -> Iterator[tuple[str, float]]:
    """Yields the ratios of setpoints, in a stream and by calls, without and with a fence, and of samples."""
    with Child("benchmarks.vehicle") as vehicle:
        for bare, *ways in (_STREAMS, _CALLS):
            alone_us = _setpoint_us(vehicle, bare)
            for way in ways:
                yield f"{way.name}, setpoint", _setpoint_us(vehicle, way) / alone_us
        alone_us = _sample_us(vehicle, BARE_STREAM)
        yield f"{STREAM.name}, sample", _sample_us(vehicle, STREAM) / alone_us


class _Flood(NamedTuple):
    """What a server used in a flood of setpoints."""

    processor_s: float
    took_s: float
    arrived: int


def _setpoint_us(vehicle: Child, way: Way) -> float:
    """Returns the processor time of a server for a setpoint, µs, without what it needs anyway for telemetry."""
    with flown(vehicle, way) as flight:
        flight.client.ask("flood", first=1, duration_s=_FLOOD_S)  # warm
        quiet_share = min(_quiet_share(flight) for _ in range(_TRIES))
        floods = [_flood(vehicle, flight) for _ in range(_TRIES)]
    return min(1e6 * (each.processor_s - quiet_share * each.took_s) / max(1, each.arrived) for each in floods)


def _flood(vehicle: Child, flight: Flight) -> _Flood:
    vehicle.ask("setpoints")
    began_s, before_s = time.monotonic(), _processor_s(flight)
    flight.client.ask("flood", first=_FIRST, duration_s=_FLOOD_S)
    time.sleep(_ARRIVAL_S)
    took_s, used_s = time.monotonic() - began_s, _processor_s(flight) - before_s
    return _Flood(used_s, took_s, sum(number >= _FIRST for number, _ in vehicle.ask("setpoints")["came"]))


def _quiet_share(flight: Flight) -> float:
    began_s, before_s = time.monotonic(), _processor_s(flight)
    time.sleep(_QUIET_S)
    return (_processor_s(flight) - before_s) / (time.monotonic() - began_s)


def _processor_s(flight: Flight) -> float:
    assert flight.server is not None
    return float(flight.server.processor_s())


def _sample_us(vehicle: Child, way: Way) -> float:
    """Returns the processor time of a server for each position that comes and goes to one reader, µs."""
    with flown(vehicle, way) as flight:
        return min(_listened_us(vehicle, flight) for _ in range(_TRIES))


def _listened_us(vehicle: Child, flight: Flight) -> float:
    vehicle.ask("positions")
    before_s = _processor_s(flight)
    flight.client.ask("listen", subscribers_count=1, duration_s=_LISTEN_S)
    used_s = _processor_s(flight) - before_s
    return 1e6 * used_s / max(1, len(vehicle.ask("positions")["gone"]))
