"""Finds backends by name: entry points of the group ``ual_daemon.backends``, ours and third parties' alike."""

from __future__ import annotations

from importlib.metadata import entry_points

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
    found = next(iter(entry_points(group=GROUP, name=name)), None)
    if found is None:
        raise ConfigError(f"there is no backend {name!r}; known are {', '.join(names())}", "backend")
    try:
        kind = found.load()
    except ImportError as error:
        raise ConfigError(
            f"the backend {name!r} cannot be loaded: {error}; "
            f"if it needs an extra, install it: pip install 'ual-daemon[{name}]'",
            "backend",
        ) from error
    backend = kind(options)
    if not isinstance(backend, Backend):
        raise ConfigError(f"the backend {name!r} ({found.value}) is no ual_daemon.backends.base.Backend", "backend")
    return backend
