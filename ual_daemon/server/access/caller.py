"""Caller of the present command."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass

from ual.access.roles import Role
from ual.errors import PermissionDeniedError

LOCAL = "local"
"""The name of a program on this computer that shows neither a token nor a certificate."""
NOBODY = "nobody"
"""The same, on another computer."""


@dataclass(frozen=True, slots=True)
class Caller:
    """A caller: the name of its token or certificate, and its role."""

    name: str
    role: Role
    is_named: bool = False
    """Whether it has identified itself, by a token or a certificate."""

    def require(self, needed: Role, what: str) -> None:
        """Checks that the caller has a role.

        Raises:
            PermissionDeniedError: It has not.

        """
        if self.role < needed:
            raise PermissionDeniedError(
                f"{what} needs the role {needed.text}, and {self.name} is {_with_article(self.role)}",
                {"needed": needed.text, "role": self.role.text, "identity": self.name},
            )


OF_THIS_COMPUTER = Caller(LOCAL, Role.COMMANDER)
"""The caller of a daemon for which nothing is configured."""
current: ContextVar[Caller] = ContextVar("ual_caller_identity", default=OF_THIS_COMPUTER)


def _with_article(role: Role) -> str:
    return "without a role" if role is Role.NONE else f"{'an' if role is Role.OBSERVER else 'a'} {role.text}"
