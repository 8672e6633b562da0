"""A base of classes that can neither be copied nor pickled."""

from __future__ import annotations

from typing import NoReturn, SupportsIndex

from typing_extensions import override


class Uncopied:
    """Refuses `copy`, `deepcopy` and `pickle`: a copy would share what it holds open, and close that as it ends."""

    __slots__ = ()

    @override
    def __reduce_ex__(self, protocol: SupportsIndex) -> NoReturn:
        raise TypeError(f"{self!r} cannot be copied or pickled: make another one, by its name or address")
