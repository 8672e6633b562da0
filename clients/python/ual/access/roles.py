"""The roles, each of which includes the one before."""

from __future__ import annotations

from enum import IntEnum


class Role(IntEnum):
    """Rights of a caller.

    An observer reads. A pilot flies, too. A commander also arms and disarms where the daemon allows it, moves home,
    acts on a simulation, and takes the lease from others.
    """

    NONE = 0
    OBSERVER = 1
    PILOT = 2
    COMMANDER = 3

    @property
    def text(self) -> str:
        """Its name in files and messages."""
        return self.name.lower()


def parse(text: str) -> Role:
    """Returns the role of a name.

    Raises:
        ValueError: There is no such role.

    """
    try:
        return Role[text.upper()] if text == text.lower() else Role[""]
    except KeyError:
        known = ", ".join(role.text for role in Role)
        raise ValueError(f"there is no role {text!r}: one of {known}") from None
