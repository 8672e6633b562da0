"""Writes the table of ``docs/reference/clients/ros2.md``: the services beside flying, each with its type."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from tools.contract.compiled import ROOT
from tools.contract.ros_comments import trailing
from tools.contract.ros_shapes import Served

PAGE = ROOT / "docs" / "reference" / "clients" / "ros2.md"
_BEGIN = "<!-- The table of services: `make proto` writes it. -->\n"
_END = "<!-- End of the table of services. -->\n"
_HEAD = "\n| below `/uav_1/ual/` | type | |\n|---|---|---|\n"
_MOST_WORDS = 20
_TYPES = "../../../clients/ros2/ual_msgs/srv"


def page(served: Iterable[Served]) -> dict[Path, str]:
    """Returns the page with the table as it follows from the contract, by its path.

    Raises:
        SystemExit: The page has no place for it.

    """
    before, begin, rest = PAGE.read_text(encoding="utf-8").partition(_BEGIN)
    _, end, after = rest.partition(_END)
    if not begin or not end:
        raise SystemExit(f"{PAGE.name} has no lines {_BEGIN.strip()} and {_END.strip()}")
    rows = "".join(_row(each) for each in served if each.is_of_service)
    return {PAGE: f"{before}{begin}{_HEAD}{rows}\n{end}{after}"}


def _row(served: Served) -> str:
    kind = f"[`{served.type}`]({_TYPES}/{served.type}.srv)" if served.type != "Trigger" else "`std_srvs/Trigger`"
    [first, *_] = re.split(r"(?<=[.;]) ", served.head)
    if len(first.split()) > _MOST_WORDS:
        first = first.partition(":")[0]
    return f"| `{served.name}` | {kind} | {trailing(first.rstrip(';'))} |\n"
