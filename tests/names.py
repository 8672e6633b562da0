"""Finds names that do not say what they name: ``python -m tests.names`` lists them.

Words of a private dialect in names of modules, classes and functions stand for many things. A name has the noun of what
it is, or the verb of what it does: `parse_address` and not `parse_place`.

The name of a module's number ends with the unit or the kind of quantity. Before it stands the noun of what it measures:
`RECONNECT_PERIOD_S` and not `_PERIOD`, `MOST_WAITING_READS` and not `MOST_WAITING`.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import NamedTuple

from tests.openings import files
from tests.sentences import ROOT, outline

PROPOSALS = {
    "told": "reported, report_of",
    "said": "status_text, reported",
    "heard": "received, subscribed",
    "seen": "observed, noticed",
    "given": "passed, issued; given up: abandoned",
    "asked": "requested, queried",
    "judged": "assessed, estimated",
    "flown": "executed, followed, is_in_control",
    "offered": "available, driver",
    "beside": "services, next_to, offset",
    "way": "path, route, direction; on its way: en_route; under way: in_progress",
    "ways": "variants, paths",
    "place": "position, address",
    "places": "positions, addresses",
    "reach": "range, distance_limit",
    "desk": "entrance, queue",
    "line": "row, path, link, message",
    "lines": "rows, paths, messages",
    "look": "poll, update, check",
    "looks": "points, poll",
}
KEPT = re.compile(r"place_on_ground|PlaceOnGround|^(test_)?lines$")
"""The contract keeps its names, and what is derived from it has them. `tools/lines.py` counts lines."""
RENAMED = {"ual_daemon/backends/engine/command_desk.py", "ual_daemon/backends/judged.py"}
"""Old names of modules, which warn until 0.4."""
_UNIT = re.compile(
    r"_(?:[MNU]?S|DAYS|HZ|[KM]?M|M2|M_S2?|RAD(?:_S2?)?|DEG|V|KG|N|PERCENT|PX|BYTES|[KM]IB|BITS|CHARACTERS|DIGITS"
    r"|1_S|M2_S|MIB_S|US_S|BYTES_S)$"
)
_QUANTITY = re.compile(
    r"_(?:SHARE|FACTOR|RATIO|GAIN|COSINE|SINE|SQUARED|HALF|TOLERANCE|SIMILARITY|LIKENESS|DEFLECTION|NORM|GRAVITY|DRAG|VALUE|Z"
    r"|CHANGE|ID|CODE|TYPE|KIND|STATE|STATUS|RESULT|ERROR|LEVEL|LABEL|COMMAND|PARAMETER|FRAME|FIELD|ACTION|VERSION|PROTOCOL"
    r"|POLYNOMIAL|BIT|MASK|FLAG|BYTE|CHANNEL|OFFSET|PORT|BAUD|DESCRIPTOR|NICENESS|COUNT|[A-Z]+S)$"
)
"""Last word of a number without a unit. A plural counts, or a noun before COUNT (`MOST_FRAMES`)."""
_COUNTED = re.compile(r"_(?:PER|WITHOUT)_|_AT_ONCE$")
_ADJECTIVE = re.compile(
    r"MOST|LEAST|(?:LONG|SHORT|LARG|SMALL|FARTH|NEAR|WID|HIGH|LOW|FAST|SLOW|OLD|LAT)(?:E?ST|ER)?E?|MAX|MIN|FAR|NEW"
    r"|FRESH|SAME|LIGHT|FULL|OURS|THEIRS|AGAIN|ANEW|APART|ASIDE|AWAY|AHEAD|BEFORE|BELOW|ABOVE|BACK|WITHIN|AT|EVERY|EACH"
    r"|AROUND|ON|OVER|OF|IN|UP|NOT|YET|NOTHING|NUMBER"
)
"""Words that say how much, when or where, and not of what."""
_VAGUE = re.compile(
    r"PERIOD|PATIENCE|TIMEOUT|TIME|LIMIT|GAP|WINDOW|STEP|PAUSE|MARGIN|INTERVAL|RATE|BATCH|PACE|SLACK|SMOOTHING|MODE|NOISE|DOUBT"
    r"|SILENCE|WAIT|RESTS?|LOOKS?|ASK|ENDS?|TAKE|SETTLES?|GIVE|KEEP|KNOWN|UNKNOWN|QUIET|SILENT|STILL|STUCK|GONE|READY|BUSY"
    r"|IDLE|SOON|SURE|GOOD|USUAL|ODD|STALE|SEVERE|TINY|MUTE|RECENT|EXACT|STEADY|GENTLE|DUE|SEEN|TOLD|HEARD|GIVEN|FLOWN|SHOWN|HELD"
    r"|(?:STAY|STAND|FOLLOW|GAIN|FALL|TILT|BEGIN|BRAKE|DESCEND|CONTINUE|LAST|HOLD|WANDER|SETTLE|SHOW)S"
    r"|(?!SPEED)[A-Z]{3,}ED"
)
"""Words that need another one: a period of what, what was missed?"""
_ENTRY = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]+\b|\b[A-Z][a-z]+[A-Z]\w*\.\w+|`prctl`")
"""The name of a protocol's entry in a docstring: it says what the code is (`MAV_CMD_DO_JUMP`)."""
KEPT_NUMBERS = {
    "clients/python/ual/corrections.py": "MOST_BYTES",
    "clients/python/ual/fences/files.py": "MOST_BYTES",
    "clients/python/ual/logs/files.py": "OVERLAP",
    "clients/python/ual/network/roster.py": "KEEP_GONE_S MOST_OF_PUBLISHER MUTE_S UNHEARD_S UNHEARD_PERIODS",
    "clients/python/ual/network/settings.py": "MOST_RATE_HZ",
    "clients/python/ual/network/values.py": "LEAST_LATE_S",
    "clients/python/ual/parameters/files.py": "MOST_BYTES",
    "clients/python/ual/routes/_files.py": "MOST_BYTES",
}
"""Names that installed programs may use (`tests/data/interface.txt`)."""
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


class Name(NamedTuple):
    """A name with a word that is not used: its line (0: the module itself), the name, and the word."""

    line: int
    name: str
    word: str


def of_module(path: Path, text: str) -> list[Name]:
    """Returns the names that have such a word: of the module, its folder, its classes and its functions."""
    folder = path.parent.name if path.name == "__init__.py" else ""
    named = [(0, folder or path.stem), *outline(text).names]
    return [Name(number, name, word) for number, name in named for word in dialect_of(name)]


def dialect_of(name: str) -> list[str]:
    """Returns the words of a name that are not used in names."""
    words = [word.lower() for word in _WORDS.findall(KEPT.sub("", name))]
    return [word for word in words if word in PROPOSALS]


def unclear_numbers(text: str) -> list[Name]:
    """Returns a module's numbers whose names lack a unit, a kind of quantity, or the noun of what they measure."""
    tree = ast.parse(text)
    return [
        Name(node.lineno, target.id, "")
        for node, after in zip(tree.body, [*tree.body[1:], ast.Pass()], strict=True)
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and _is_number(node.value)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name) and not _ENTRY.search(_docstring(after)) and not is_clear(target.id)
    ]


def is_clear(name: str) -> bool:
    """Returns whether a number's name says of what it is, and in which unit or as which kind of quantity."""
    unit, quantity = _UNIT.search(name), _QUANTITY.search(name)
    if _COUNTED.search(name) or (quantity and quantity[0].endswith("S") and not unit):
        return True
    words = [each for each in _UNIT.sub("", name).split("_") if each and not _ADJECTIVE.fullmatch(each)]
    if unit:
        return len(words) >= 2 or any(not _VAGUE.fullmatch(each) for each in words)
    return quantity is not None and len(words) >= 2


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        is_repeated = isinstance(value.left, ast.Tuple) or isinstance(getattr(value.left, "value", None), str | bytes)
        return not is_repeated and (_is_number(value.left) or _is_number(value.right))
    return isinstance(value, ast.Call) and re.match(r"math\.|int$|float$|round$", ast.unparse(value.func)) is not None


def _docstring(node: ast.stmt) -> str:
    return str(node.value.value) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) else ""


def all_found() -> list[str]:
    """Returns, human-readable, all names that have such a word, with proposals."""
    return [
        f"{path.relative_to(ROOT).as_posix()}:{each.line}: {each.name}: not `{each.word}` but: {PROPOSALS[each.word]}"
        for path in files()
        if path.relative_to(ROOT).as_posix() not in RENAMED
        for each in of_module(path, path.read_text(encoding="utf-8"))
    ]


def all_unclear() -> list[str]:
    """Returns, human-readable, the unclear names of the product's numbers."""
    return [
        f"{path}:{each.line}: {each.name}: add the unit or the quantity, and the noun of what it measures"
        for root in ("ual_daemon", "clients/python")
        for file in sorted((ROOT / root).rglob("*.py"))
        if (path := file.relative_to(ROOT).as_posix()) and "_pb2" not in path
        if not path.endswith("mavlink/wire/dialect.py")  # which has MAVLink's names
        for each in unclear_numbers(file.read_text(encoding="utf-8"))
        if each.name not in KEPT_NUMBERS.get(path, "").split()
    ]


def main() -> None:
    """Prints the names."""
    print(*all_found(), *all_unclear(), sep="\n")


if __name__ == "__main__":
    main()
