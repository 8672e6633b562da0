"""Tries the built site as its readers use it: ``python -m tools.site build/docs`` (``make docs`` does).

Each search of ``tests/data/docs`` finds its page among the first three, and in a window of 1280 px nothing is wider
than the text of its page. Without Chromium the widths are not measured, which is said.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tools.site.searches import missed
from tools.site.widths import too_wide


def main() -> None:
    """Tries it, and fails with what was found."""
    site = Path(sys.argv[1])
    found = [f"search {each}" for each in missed(site)]
    wide = too_wide(site)
    if wide is None:
        print("NO CHROMIUM: whether tables and code are wider than the text is NOT TESTED: apt-get install chromium")
    if found := [*found, *(wide or ())]:
        raise SystemExit("\n".join(found))


if __name__ == "__main__":
    main()
