"""Finds backends by name: entry points of the group ``ual_daemon.backends``, ours and third parties' alike."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import entry_points

from ual.geometry import Vector3
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.settings import ConfigError

GROUP = "ual_daemon.backends"


def names() -> list[str]:
    """The names of all installed backends."""
    return sorted({point.name for point in entry_points(group=GROUP)})


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
    found = next(iter(entry_points(group=GROUP, name=name)), None)
    if found is None:
        raise ConfigError(f"there is no backend {name!r}; known are {', '.join(names())}", "backend")
    try:
        kind: type = found.load()
    except ImportError as error:
        raise ConfigError(
            f"the backend {name!r} cannot be loaded: {error}; "
            f"if it needs an extra, install it: pip install 'ual-daemon[{name}]'",
            "backend",
        ) from error
    return kind
