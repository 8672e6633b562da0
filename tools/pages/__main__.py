"""Writes the parts of the pages that follow from the code: ``python -m tools.pages`` (``make pages``).

Pictures of the concepts, the pages of the command line, the settings and Telemetry's fields, and the list of commands
that `ual --help` shows. With ``--check``
nothing is written, and what is out of date fails.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tools.pages import commands, options, settings, telemetry
from tools.pages.pictures import PICTURES

ROOT = Path(__file__).parents[2]
_REFERENCE = ROOT / "docs" / "reference"


def derived() -> dict[Path, str]:
    """Returns all pages and pictures that follow from the code, by path."""
    return {
        ROOT / "clients" / "python" / "ual_tools" / "command_list.py": commands.source(),
        _REFERENCE / "command-line.md": options.page(),
        _REFERENCE / "settings.md": settings.page(),
        _REFERENCE / "telemetry.md": telemetry.page(),
        **{ROOT / "docs" / "figures" / f"{name}.svg": str(draw()) for name, draw in PICTURES.items()},
    }


def out_of_date() -> list[str]:
    """Returns the names of the files that are not as they follow from the code."""
    return [
        path.relative_to(ROOT).as_posix()
        for path, text in derived().items()
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    ]


def main() -> None:
    """Writes them, or says which are out of date."""
    if "--check" in sys.argv[1:]:
        if late := out_of_date():
            raise SystemExit(f"out of date: {', '.join(late)}: make pages")
        return
    for path, text in derived().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
