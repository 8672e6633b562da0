"""The gimbals of a UAV over gRPC, by their numbers."""

from __future__ import annotations

from collections.abc import Iterator

from typing_extensions import override

from ual import _derived_parts
from ual._derived_parts import Gimbal


class Gimbals(_derived_parts.Gimbals):
    """`ual.interface.Gimbals`, over gRPC."""

    @override
    def __getitem__(self, number: int) -> Gimbal:
        return Gimbal(self._connection, number)

    @override
    def __iter__(self) -> Iterator[Gimbal]:
        return (self[each.number] for each in self.get_all())
