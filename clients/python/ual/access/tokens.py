"""Bearer tokens, and the file that has their hashes.

A token is 256 random bits, so a single SHA-256 of it cannot be reversed by trying. A slow password hash would protect
nothing more, and would cost each call of a client milliseconds (docs/evidence/decisions/0034).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

from ual.access import roles
from ual.access.roles import Role
from ual.shared import strict_json, text

PREFIX = "ual_"
"""Prefix by which a token is recognized, also by programs that search for secrets in files."""
NAME_PATTERN = r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,63}"


@dataclass(frozen=True, slots=True)
class Token:
    """Description of a token: never the token itself. Times are UTC; `expires` is None where it never does."""

    name: str
    role: Role
    sha256: str
    created: datetime
    expires: datetime | None = None

    def has_expired(self, now: datetime) -> bool:
        """Returns whether it is not valid any more."""
        return self.expires is not None and now >= self.expires


def make(name: str, role: Role, expires: datetime | None, now: datetime) -> tuple[str, Token]:
    """Makes a token: the secret, to be shown once, and what is stored of it.

    Raises:
        ValueError: The name is not one.

    """
    require_name(name)
    secret = PREFIX + os.urandom(32).hex()
    return secret, Token(name, role, hashed(secret), now, expires)


def require_name(name: str) -> None:
    """Refuses what is no name of a caller or a daemon.

    Raises:
        ValueError: It is none.

    """
    if not re.fullmatch(NAME_PATTERN, name):
        raise ValueError(f"{name!r} is no name: 1 to 64 letters, digits and _.@-, not a sign first")


def hashed(secret: str) -> str:
    """Returns the hash by which a token is found."""
    return hashlib.sha256(secret.encode()).hexdigest()


def find(tokens: Iterable[Token], secret: str) -> Token | None:
    """Returns the token whose secret it is."""
    wanted = hashed(secret)
    return next((token for token in tokens if token.sha256 == wanted), None)


def read(data: bytes) -> tuple[Token, ...]:
    """Reads a file of tokens.

    Raises:
        ValueError: It is none; the message says what is wrong.

    """
    try:
        values = strict_json.parsed(text.decoded(data))
        _require_known(values, ("tokens",))
        found = tuple(_read_one(each) for each in values["tokens"])
    except strict_json.JsonError as error:
        raise ValueError(f"line {error.line}: it is no file of tokens: {error}") from None
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(
            f"it is no file of tokens, as `ual token new` writes it ({type(error).__name__}: {error})"
        ) from None
    _require_twins_alike(found)
    return found


def _require_twins_alike(found: Sequence[Token]) -> None:
    for what in ("name", "sha256"):
        values = [getattr(token, what) for token in found]
        for index, value in enumerate(values):
            if found[values.index(value)] != found[index]:
                raise ValueError(f"two different tokens have the {what} {value!r}")


def _require_known(values: Mapping[str, object], known: Sequence[str]) -> None:
    for key in values:
        if key not in known:
            raise ValueError(f"there is no key {key!r:.80} in a file of tokens ({', '.join(known)})")


def write(tokens: Iterable[Token]) -> bytes:
    """Returns the content of a file of tokens."""
    entries = [
        {
            "name": token.name,
            "role": token.role.text,
            "sha256": token.sha256,
            "created": token.created.isoformat(timespec="seconds"),
            "expires": None if token.expires is None else token.expires.isoformat(timespec="seconds"),
        }
        for token in tokens
    ]
    return (json.dumps({"tokens": entries}, indent=2) + "\n").encode()


def _read_one(entry: dict[str, Any]) -> Token:
    _require_known(entry, ("name", "role", "sha256", "created", "expires"))
    name, expires = entry["name"], entry["expires"]
    if not (isinstance(name, str) and re.fullmatch(NAME_PATTERN, name)):
        raise ValueError(f"{name!r:.80} is no name of a token")
    if not re.fullmatch(r"[0-9a-f]{64}", entry["sha256"]):
        raise ValueError(f"{name}: sha256 is no hash")
    return Token(
        name,
        roles.parse(entry["role"]),
        entry["sha256"],
        _time(entry["created"]),
        None if expires is None else _time(expires),
    )


def _time(written: str) -> datetime:
    time = datetime.fromisoformat(written)
    if time.tzinfo is None:
        raise ValueError(f"{written!r} has no time zone")
    return time.astimezone(timezone.utc)
