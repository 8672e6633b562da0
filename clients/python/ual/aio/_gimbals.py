"""The gimbals of a UAV over gRPC, by their numbers."""

from __future__ import annotations

from collections.abc import AsyncIterator

from ual.aio import _derived_parts
from ual.aio._derived_parts import Gimbal


class Gimbals(_derived_parts.Gimbals):
    """`ual.interface.Gimbals`, over gRPC."""

    def __getitem__(self, number: int) -> Gimbal:
        """Returns the gimbal of a number. Asks nothing: whether there is one shows when it is used."""
        return Gimbal(self._connection, number)

    async def __aiter__(self) -> AsyncIterator[Gimbal]:
        """Yields each gimbal that was found."""
        for each in await self.get_all():
            yield self[each.number]

    __iter__ = None  # Python would else count numbers without an end
