"""Choice of UAVs on a page: all, one, or several. Pure."""

from __future__ import annotations

from collections.abc import Sequence

ALL = "all UAVs"


def chosen(text: str, names: Sequence[str]) -> tuple[str, ...]:
    """Returns the UAVs that a text names, in the order of `names`: all where it is empty or says so.

    What is no UAV names none: a text that is still being typed must not choose all.
    """
    wanted = {name.strip() for name in text.split(",")}
    if wanted <= {"", ALL}:
        return tuple(names)
    return tuple(name for name in names if name in wanted)


def title(found: Sequence[str], names: Sequence[str]) -> str:
    """Returns what several chosen UAVs are called on a button."""
    if len(found) == len(names):
        return f"all {len(found)}"
    return ", ".join(found) if len(found) <= 3 else f"{len(found)} chosen"
