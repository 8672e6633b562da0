"""The rules that keep a safety pilot in charge stand in the engine, and in no backend."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

BACKENDS = Path(__file__).parents[1] / "ual_daemon" / "backends"
RULES = {
    "a limit of silence": r"^_?[A-Z_]*(?:SILENCE|SILENT|HEARD|RECENT_CONTACT|BLIND)[A-Z_]*(?:, _?[A-Z_]+)* = [\d.(]",
    "a silence that is judged": r"- \S*(?:heard|received|reported)_s\b|(?:heard|received|reported)_s\b[^#\n]* [<>]=? ",
    "a repetition": r"^_?[A-Z_]*(?:RESEND|REPEAT|AGAIN|REQUEST_PERIOD)[A-Z_]*(?:, _?[A-Z_]+)* = [\d.(]",
    "a withdrawal that is judged": r"\.cancelled\(\)|\bis_withdrawn\b",
    "a mode of others": r"\bmode_before\b|\bfrom_modes?\b|\bovertak",
}
ALLOWED = {
    "airsim/commands.py": "the calls of a command that was ended",
    "airsim/session.py": "the answer to a command that was ended",
    "crazyflie/commander.py": "a Crazyflie without a pilot, which falls where UAL is silent: it hovers by itself",
    "crazyflie/requests.py": "questions that are repeated, as CRTP loses packets; nothing that flies",
    "crazyflie/telemetry.py": "whether a log packet is of this boot, and the words while no values come yet",
    "dji/cameras.py": "pictures, and orders of a camera, that were given up: nothing that flies",
    "dji/gimbals.py": "after how long a gimbal that tells nothing counts as not connected: nothing that flies",
    "dji/session.py": "a silent topic is subscribed to anew, the confirmation of a landing, and calls that were ended",
    "dji/telemetry.py": "messages that a newer one has overtaken",
    "firmwares/batteries.py": "batteries of which nothing is told any more",
    "firmwares/motor_outputs.py": "after which silence it is not known whether the motors turn: nothing is sent",
    "firmwares/sender_watch.py": "after which silences a target may be an old one of ours: nothing is sent",
    "firmwares/trigger_camera.py": "orders of a camera that were given up: nothing that flies",
    "mavlink/links/connection.py": "when a TCP connection counts as half-open, and when a link works again",
    "mavlink/links/tcp.py": "when another client may take over the port",
    "mavlink/session/discovery.py": "which system is the vehicle, after a stray heartbeat and after its id was changed",
    "mavlink/session/late_messages.py": "messages that are requested once they are late",
    "mavlink/session/session.py": "when streams are requested anew from an autopilot that is heard",
    "mavlink/session/supervision.py": "after how long sequence numbers may have wrapped",
    "mavlink/wire/dialect.py": "constants of MAVLink, by a tool",
    "mavlink/wire/frames.py": "pieces of frames that nobody completes",
    "mavlink/wire/receiver.py": "which of several addresses is answered",
    "mavlink/wire/signing.py": "which signatures are remembered",
    "mavlink/wire/untaken.py": "which other vehicles are named",
    "mavros/discovery.py": "a silent topic is subscribed to anew; answers that were given up",
    "mavros/gimbal.py": "how long a report of a gimbal holds: nothing that flies",
    "mavros/parameters.py": "when parameters are fetched again",
    "mavros/telemetry.py": "whether the estimate is good without the topics that it needs",
    "rosbridge/calls.py": "calls whose caller does not wait any more",
    "rosbridge/connections.py": "when a WebSocket counts as half-open",
    "rosbridge/link.py": "calls that were ended",
}
"""Files with something alike that is no rule of the pilot's, and what it is about."""
BESIDE_FLYING = ("offers/", "mavlink/offers/", "mavlink/protocols/", "mavros/offers/")
"""Folders whose exchanges move no UAV: each is repeated, or given up, as its protocol says."""


def _found(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    lines = [
        (text.count("\n", 0, match.start()) + 1, rule)
        for rule, pattern in RULES.items()
        for match in re.finditer(pattern, text, re.MULTILINE)
    ]
    return [f"{path.relative_to(BACKENDS)}:{line}: {rule}" for line, rule in sorted(lines)]


def _in_room(room: str) -> list[str]:
    paths = sorted((BACKENDS / room).rglob("*.py"))
    judged = [path for path in paths if not str(path.relative_to(BACKENDS)).startswith(BESIDE_FLYING)]
    return [found for path in judged if str(path.relative_to(BACKENDS)) not in ALLOWED for found in _found(path)]


ROOMS = sorted(path.name for path in BACKENDS.iterdir() if (path / "__init__.py").exists() and path.name != "engine")


@pytest.mark.parametrize("room", ROOMS)
def test_no_rule_of_the_pilots_stands_in_a_backend(room: str) -> None:
    assert _in_room(room) == []


@pytest.mark.parametrize("path", sorted(ALLOWED))
def test_what_is_allowed_is_there(path: str) -> None:
    assert _found(BACKENDS / path), f"{path} needs no exception any more"


def test_the_rules_are_in_the_engine() -> None:
    """So the patterns find them where they are written."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in (BACKENDS / "engine").glob("*.py"))
    assert {rule for rule, pattern in RULES.items() if re.search(pattern, text, re.MULTILINE)} >= {
        "a limit of silence",
        "a silence that is judged",
        "a withdrawal that is judged",
        "a mode of others",
    }
