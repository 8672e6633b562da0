"""Writes small logs as PX4 (ULog) and ArduPilot (dataflash) do."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

GPS_WEEK_0_S = 315_964_800
LEAP_S = 18


class Sample(NamedTuple):
    """One position: time since boot in s; metres and m/s, north, east and down."""

    time_s: float
    north: float
    east: float
    down: float
    speed: float


def write_ulog(file: Path, samples: Sequence[Sample], boot_utc_s: float | None = None) -> None:
    """With `boot_utc_s`, the time of day at boot, it has known that."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    local = "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;bool xy_valid;bool z_valid;"
    satellites = "uint64_t timestamp;uint64_t time_utc_usec;"
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    data += message(b"F", f"vehicle_local_position:{local}".encode())
    data += message(b"F", f"vehicle_gps_position:{satellites}".encode())
    data += message(b"A", struct.pack("<BH", 0, 0) + b"vehicle_local_position")
    data += message(b"A", struct.pack("<BH", 0, 1) + b"vehicle_gps_position")
    for each in samples:
        time_us = round(each.time_s * 1e6)
        row = struct.pack("<HQ6f2B", 0, time_us, each.north, each.east, each.down, each.speed, 0.0, 0.0, 1, 1)
        data += message(b"D", row)
        utc_us = 0 if boot_utc_s is None else time_us + round(boot_utc_s * 1e6)
        data += message(b"D", struct.pack("<HQQ", 1, time_us, utc_us))
    file.write_bytes(data)


def write_dataflash(file: Path, samples: Sequence[Sample], boot_utc_s: float) -> None:
    """The time of day at boot is `boot_utc_s`."""

    def form(kind: int, size: int, name: bytes, layout: bytes, columns: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, size, name, layout, columns)

    data = form(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    data += form(129, 3 + struct.calcsize("<QBBIHf"), b"GPS", b"QBBIHf", b"TimeUS,I,Status,GMS,GWk,Spd")
    data += form(130, 3 + struct.calcsize("<QB6f"), b"XKF1", b"QBffffff", b"TimeUS,C,VN,VE,VD,PN,PE,PD")
    for each in samples:
        time_us = round(each.time_s * 1e6)
        week, rest_s = divmod(boot_utc_s + each.time_s - GPS_WEEK_0_S + LEAP_S, 604_800)
        data += b"\xa3\x95\x81" + struct.pack("<QBBIHf", time_us, 0, 3, round(rest_s * 1e3), int(week), 0.0)
        place = (each.north, each.east, each.down)
        data += b"\xa3\x95\x82" + struct.pack("<QB6f", time_us, 0, each.speed, 0.0, 0.0, *place)
    file.write_bytes(data)
