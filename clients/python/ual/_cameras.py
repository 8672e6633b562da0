"""The cameras of a UAV over gRPC, by their numbers."""

from __future__ import annotations

from collections.abc import Iterator

from typing_extensions import override

from ual import _derived_parts
from ual._derived_parts import Camera


class Cameras(_derived_parts.Cameras):
    """`ual.interface.Cameras`, over gRPC."""

    @override
    def __getitem__(self, number: int) -> Camera:
        return Camera(self._connection, number)

    @override
    def __iter__(self) -> Iterator[Camera]:
        return (self[each.number] for each in self.get_all())
