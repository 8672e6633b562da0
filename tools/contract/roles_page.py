"""Writes the table of ``docs/evidence/security.md``: the role of each method, and whether it needs the lease."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from tools.contract.description import ContractService
from ual.access.roles import Role
from ual.contract.method import Method

_BEGIN = "<!-- The table of methods: `make proto` writes it. -->\n"
_END = "<!-- End of the table of methods. -->\n"
_HEAD = """
| service | observer | pilot | commander | refused while another program holds the lease |
|---|---|---|---|---|
"""
_ROLES = (Role.OBSERVER, Role.PILOT, Role.COMMANDER)
_STANDARD = "| `Health`, `ServerReflection` | all | | | |\n\n"


def page(text: str, services: Sequence[ContractService]) -> str:
    """Returns the page with the table as it follows from the contract.

    Raises:
        SystemExit: The page has no place for it.

    """
    before, begin, rest = text.partition(_BEGIN)
    _, end, after = rest.partition(_END)
    if not begin or not end:
        raise SystemExit(f"docs/evidence/security.md has no lines {_BEGIN.strip()} and {_END.strip()}")
    return before + begin + _HEAD + "".join(map(_row, services)) + _STANDARD + end + after


def _row(service: ContractService) -> str:
    cells = [_names(each for each in service.methods if each.role is role) for role in _ROLES]
    leased = _names(each for each in service.methods if each.needs_lease)
    return f"| `{service.name}` | {' | '.join((*cells, leased))} |\n".replace("  ", " ")


def _names(methods: Iterable[Method]) -> str:
    return ", ".join(f"`{each.name}`" for each in methods)
