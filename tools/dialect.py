"""Writes the messages and constants of MAVLink that UAL has: ``python -m tools.dialect`` (`make dialect`).

They are those of pymavlink's module `all`, which its generator has made of MAVLink's definitions: every message, and
each enum of which the mavlink backend uses a constant. That module takes 7.8 MB; this one takes 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

import pymavlink
from pymavlink.dialects.v20 import all as mavlink

from tools.contract.formatting import formatted

BACKEND = Path(__file__).resolve().parents[1] / "ual_daemon" / "backends" / "mavlink"
DIALECT = BACKEND / "wire" / "dialect.py"
_NEWER = {
    397: 'MessageKind(397, "COMPONENT_METADATA", 182, "time_boot_ms:I file_crc:I uri:100s")',
    410: 'MessageKind(410, "EVENT", 160, "destination_component:B destination_system:B id:I event_time_boot_ms:I '
    'sequence:H log_levels:B arguments:40B")',
}
"""Messages that pymavlink does not have."""
_NEWER_FIELDS = {
    "MISSION_ACK": "opaque_id:I",
    "MISSION_COUNT": "opaque_id:I",
    "MISSION_CURRENT": "mission_id:I fence_id:I rally_points_id:I",
}
"""Extensions that pymavlink does not have yet. They are 0 where an autopilot does not send them, as all extensions."""
_NAMED_ENUMS = {"MAV_AUTOPILOT", "MAV_CMD", "MAV_PARAM_ERROR", "MAV_RESULT", "MAV_TYPE"}
"""Enums whose members are named to people, whatever an autopilot sends."""
_CODES = {
    "char": "s", "uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i",
    "uint64_t": "Q", "int64_t": "q", "float": "f", "double": "d",
}  # fmt: skip


def source() -> str:
    """Returns the module."""
    kinds = {**{each: _kind(kind) for each, kind in mavlink.mavlink_map.items()}, **_NEWER}
    lines = [
        '"""Messages and constants of MAVLink. ``make dialect`` writes this file: do not edit it.',
        "",
        f"Of pymavlink {pymavlink.__version__}, whose generated code is under the MIT licence.",
        '"""',
        "# ruff: noqa: E501",
        "from __future__ import annotations",
        "from ual_daemon.backends.mavlink.wire.kinds import MessageKind",
        *(f"{name} = {number}" for name, number in _constants()),
    ]
    names = {each: re.findall(r'"(\w+)"', kind)[0] for each, kind in sorted(kinds.items())}
    lines += [f"MAVLINK_MSG_ID_{name} = {each}" for each, name in names.items()]
    lines += [f"MAVLink_{name.lower()}_message = {kinds[each]}" for each, name in names.items()]
    lines += ["mavlink_map = {each.id: each for each in list(globals().values()) if isinstance(each, MessageKind)}"]
    return formatted("\n".join(lines) + "\n")


def _kind(kind: Any) -> str:  # noqa: ANN401  pymavlink has no types
    sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    fields = [
        f"{name}:{sizes[name] or ''}{_CODES[each]}" for name, each in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]
    parameters = list(signature(kind.__init__).parameters.values())[1:]
    # the version has a default, too, which is no sign of an extension
    further = [each.default is not Parameter.empty and each.name != "mavlink_version" for each in parameters]
    base_count = further.index(True) if True in further else len(fields)
    newer = [each for each in _NEWER_FIELDS.get(kind.msgname, "").split() if each not in fields]
    extensions = " ".join([*fields[base_count:], *newer])
    definition = " ".join(fields[:base_count]) + (f"|{extensions}" if extensions else "")
    return f'MessageKind({kind.id}, "{kind.msgname}", {kind.crc_extra}, "{definition}")'


def _constants() -> Iterator[tuple[str, int]]:
    text = "".join(file.read_text() for file in BACKEND.rglob("*.py"))
    used = set(re.findall(r"\bmavlink\.([A-Z]\w+)", text))
    for name, entries in sorted(mavlink.enums.items()):
        members = [(entry.name, number) for number, entry in entries.items() if not entry.name.endswith("_ENUM_END")]
        if name in _NAMED_ENUMS or used.intersection(member for member, _ in members):
            yield from members


if __name__ == "__main__":
    DIALECT.write_text(source())
