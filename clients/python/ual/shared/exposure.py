"""Exposure to other computers: one rule for gRPC and for the network."""

from __future__ import annotations

from collections.abc import Iterable

from ual.credentials import is_this_computer


def exposed(addresses: Iterable[str]) -> list[str]:
    """Returns the addresses, ``HOST:PORT`` or ``unix:PATH``, that are not only for programs of this computer."""
    return [address for address in addresses if not is_this_computer(address)]
