"""Finds backends by name: ours, and third parties' by entry points of the group ``ual_daemon.backends``."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from ual.geometry import Vector3
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "ual_daemon.backends"

_OURS = {
    "light": ("ual_daemon.backends.light", "LightBackend"),
    "mavlink": ("ual_daemon.backends.mavlink", "MavlinkBackend"),
}
"""By module and class. To search all installed packages takes 30 ms of the start and 2 MiB: only for other names."""


def entry_points() -> Iterable[EntryPoint]:
    """The backends of other packages."""
    from importlib import metadata

    return metadata.entry_points(group=GROUP)


class _Names(Collection[str]):
    def __contains__(self, name: object) -> bool:
        return name in _OURS or name in set(self)

    def __iter__(self) -> Iterator[str]:
        return iter(sorted({*_OURS, *(point.name for point in entry_points())}))

    def __len__(self) -> int:
        return len(set(self))


NAMES: Collection[str] = _Names()
"""The names of all installed backends."""


def make(name: str, options: BackendOptions) -> Backend:
    """Makes a backend by its name.

    Raises `ConfigError` for a name that nobody has, a backend that cannot be imported (a missing extra), and settings
    that the backend cannot take.
    """
    backend = _kind(name)(options)
    if not isinstance(backend, Backend):
        raise ConfigError(f"the backend {name!r} is no ual_daemon.backends.base.Backend", "backend")
    return backend


def make_fleet(name: str, options: Sequence[BackendOptions], places: Sequence[Vector3]) -> list[Backend]:
    """Makes the backends of a fleet (see `Backend.fleet`). Raises as `make` does."""
    kind = _kind(name)
    if not issubclass(kind, Backend):
        raise ConfigError(f"the backend {name!r} cannot fly a fleet", "fleet")
    return kind.fleet(options, places)


def _kind(name: str) -> type:
    """What makes the backend of that name."""
    try:
        if name in _OURS:
            module, class_name = _OURS[name]
            kind: type = getattr(import_module(module), class_name)
            return kind
        found = next((point for point in entry_points() if point.name == name), None)
        if found is None:
            raise ConfigError(f"there is no backend {name!r}; known are {', '.join(NAMES)}", "backend")
        kind = found.load()
    except ImportError as error:
        raise ConfigError(
            f"the backend {name!r} cannot be loaded: {error}; "
            f"if it needs an extra, install it: pip install 'ual-daemon[{name}]'",
            "backend",
        ) from error
    return kind
