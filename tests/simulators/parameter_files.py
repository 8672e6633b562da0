"""Files of simulated autopilots about their parameters: PX4's descriptions, and ArduPilot's packed list."""

from __future__ import annotations

import json
import lzma
import struct
import zlib
from collections.abc import Mapping
from typing import Any

BLOCK = 239
GENERAL = "etc/extras/component_general.json.xz"
PARAMETERS = "etc/extras/parameters.json.xz"
PACKED = "@PARAM/param.pck"
DESCRIBED: dict[str, dict[str, Any]] = {
    "MPC_XY_CRUISE": {"min": 3, "max": 20, "units": "m/s", "shortDesc": "Default horizontal velocity in Missions"},
    "MPC_LAND_SPEED": {"min": 0.6, "units": "m/s", "shortDesc": "Landing descend rate"},
    "EKF2_EV_CTRL": {"min": 0, "max": 15, "shortDesc": "External vision (EV) sensor aiding", "rebootRequired": True},
}


def crc(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def described(descriptions: Mapping[str, dict[str, Any]] = DESCRIBED) -> tuple[dict[str, bytes], int]:
    """Returns PX4's files, and the checksum that COMPONENT_METADATA tells."""
    rows = [{"name": name, "type": "Float", **each} for name, each in descriptions.items()]
    parameters = lzma.compress(json.dumps({"version": 1, "parameters": rows}).encode(), preset=9)
    types = [
        {"type": 4, "uri": "mftp://etc/extras/all_events.json.xz", "fileCrc": 1},
        {"type": 1, "uri": f"mftp://{PARAMETERS}", "fileCrc": crc(parameters), "uriFallback": "https://example.com/x"},
    ]
    general = json.dumps({"version": 1, "metadataTypes": types}).encode()
    return {GENERAL: lzma.compress(general), PARAMETERS: parameters}, crc(general)


def packed(parameters: Mapping[str, float]) -> bytes:
    """Returns the list, as AP_Filesystem_Param.cpp packs it for reads of 239 bytes."""
    data, last = struct.pack("<HHH", 0x671B, len(parameters), len(parameters)), ""
    for name, value in parameters.items():
        kind, content = (3, struct.pack("<i", value)) if isinstance(value, int) else (4, struct.pack("<f", value))
        common = next((at for at in range(15) if name[: at + 1] != last[: at + 1]), 15)
        common = min(common, len(name) - 1)
        rest = name[common:].encode()
        entry = bytes((kind, common | (len(rest) - 1) << 4)) + rest + content
        over = (len(data) + len(entry)) % BLOCK
        pad = len(content) - over if 0 < over < len(content) else 0
        data, last = data + bytes(pad) + entry, name
    return data
