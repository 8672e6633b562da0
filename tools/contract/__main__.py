"""Writes what follows from the contract: ``python -m tools.contract`` (``make proto``). Decision 48 says why.

With ``--check`` it writes nothing, and fails where something is out of date.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tools.contract import methods, roles_page
from tools.contract.compiled import ROOT, compiled
from tools.contract.description import services
from tools.contract.formatting import formatted
from tools.contract.stubs import stubs

CLIENT = ROOT / "clients" / "python" / "ual"


def derived() -> dict[Path, str]:
    """Returns all that follows from the contract, by path."""
    contract = compiled()
    described = services(contract)
    page = ROOT / "docs" / "evidence" / "security.md"
    return {
        **stubs(contract),
        CLIENT / "contract" / "methods.py": formatted(methods.source(described)),
        page: roles_page.page(page.read_text(encoding="utf-8"), described),
    }


def out_of_date() -> list[Path]:
    """Returns the files that are not as they follow from the contract, and stubs of what is not in it any more."""
    wanted = derived()
    left_over = [path for path in (CLIENT / "v1").glob("*_pb2*") if path not in wanted]
    return left_over + [each for each, text in wanted.items() if not each.exists() or each.read_text("utf-8") != text]


def main() -> None:
    """Writes them, or says which are out of date."""
    if "--check" in sys.argv[1:]:
        if late := out_of_date():
            names = ", ".join(path.relative_to(ROOT).as_posix() for path in late)
            raise SystemExit(f"out of date: {names}: make proto")
        return
    for path, text in derived().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
