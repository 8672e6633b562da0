"""Messages of MAVLink that no dialect of pymavlink has yet. They are added to those that it decodes."""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

COMPONENT_METADATA_ID = 397


class ComponentMetadataMessage(mavlink.MAVLink_message):  # type: ignore[misc]  # pymavlink has no types
    """COMPONENT_METADATA: where the component keeps its general file, and the checksum of that."""

    id = COMPONENT_METADATA_ID
    msgname = name = "COMPONENT_METADATA"
    fieldnames = ordered_fieldnames = ("time_boot_ms", "file_crc", "uri")
    fieldtypes = ("uint32_t", "uint32_t", "char")
    native_format = bytearray(b"<IIc")
    orders = (0, 1, 2)
    lengths = (1, 1, 1)
    array_lengths = (0, 0, 100)
    crc_extra = 182
    unpacker = struct.Struct("<II100s")
    instance_field = None
    instance_offset = -1

    def __init__(self, time_boot_ms: int, file_crc: int, uri: bytes) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field, self._instance_offset = self.instance_field, self.instance_offset
        self.time_boot_ms = time_boot_ms
        self.file_crc = file_crc
        self._uri_raw = uri
        self.uri = uri.split(b"\0", 1)[0].decode("ascii", errors="replace")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: ANN401  (pymavlink's own)
        """Returns the bytes, as pymavlink's messages do."""
        payload = self.unpacker.pack(self.time_boot_ms, self.file_crc, self._uri_raw)
        packed: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return packed


mavlink.mavlink_map.setdefault(COMPONENT_METADATA_ID, ComponentMetadataMessage)
