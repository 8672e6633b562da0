"""Finds backends by name: built-in ones, and those of other packages by entry points (``ual_daemon.backends``)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from ual.geometry import Vector3
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.settings import ConfigError, did_you_mean

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "ual_daemon.backends"

_BUILT_IN = {
    "airsim": ("ual_daemon.backends.airsim", "AirsimBackend"),
    "crazyflie": ("ual_daemon.backends.crazyflie", "CrazyflieBackend"),
    "dji": ("ual_daemon.backends.dji", "DjiBackend"),
    "light": ("ual_daemon.backends.light", "LightBackend"),
    "mavlink": ("ual_daemon.backends.mavlink", "MavlinkBackend"),
    "mavros": ("ual_daemon.backends.mavros", "MavrosBackend"),
}
"""Module and class by name. Entry points are searched for other names only: that takes 30 ms of the start, and 2 MiB.
"""

PLAYED = "replay"
"""The name that is given for a recording. It is no backend: `ual_daemon.replay` plays it as a vehicle."""

_EXTRAS = {"dji": "ros", "mavros": "ros"}
"""The extras of backends that do not have one of their own name."""


def entry_points() -> Iterable[EntryPoint]:
    """Returns the entry points of other packages' backends."""
    from importlib import metadata

    return metadata.entry_points(group=GROUP)


class _Names(Collection[str]):
    def __contains__(self, name: object) -> bool:
        return name in _BUILT_IN or name == PLAYED or name in set(self)

    def __iter__(self) -> Iterator[str]:
        return iter(sorted({*_BUILT_IN, PLAYED, *(point.name for point in entry_points())}))

    def __len__(self) -> int:
        return len(set(self))


NAMES: Collection[str] = _Names()
"""The names of all installed backends, and `PLAYED`."""


def make(name: str, options: BackendOptions) -> Backend:
    """Makes a backend by its name.

    Raises:
        ConfigError: There is no backend of this name, it cannot be imported (an extra is missing), or its settings are
            not valid.
    """
    backend = _kind(name)(options)
    if not isinstance(backend, Backend):
        raise ConfigError(f"the backend {name!r} is not a ual_daemon.backends.base.Backend", "backend")
    return backend


def make_fleet(
    name: str, options: Sequence[BackendOptions], places: Sequence[Vector3], first: int = 0
) -> list[Backend]:
    """Makes the backends of a fleet (see `Backend.fleet`). Raises as `make` does."""
    kind = _kind(name)
    if not issubclass(kind, Backend):
        raise ConfigError(f"the backend {name!r} cannot fly a fleet", "fleet")
    return kind.fleet(options, places, first)


def vehicle_key(name: str, url: str) -> str:
    """Returns which vehicle a URL leads to (see `Backend.vehicle_key`). Raises as `make` does."""
    kind = _kind(name)
    return kind.vehicle_key(url) if issubclass(kind, Backend) else url


def vehicle_urls(name: str, url: str) -> list[str]:
    """Returns a URL for each vehicle behind one (see `Backend.vehicle_urls`). Raises as `make` does."""
    kind = _kind(name)
    return kind.vehicle_urls(url) if issubclass(kind, Backend) else [url]


_AUTOPILOTS = dict.fromkeys(("px4", "ardupilot", "arducopter", "apm"), "mavlink")
"""Autopilots whose names are given for that of their backend."""


def _kind(name: str) -> type:
    """Imports and returns the class of the backend with this name."""
    try:
        if name in _BUILT_IN:
            module, class_name = _BUILT_IN[name]
            kind: type = getattr(import_module(module), class_name)
            return kind
        found = next((point for point in entry_points() if point.name == name), None)
        if found is None:
            spoken = _AUTOPILOTS.get(name.lower(), "")
            meant = f"; {name} is flown by {spoken}" if spoken else did_you_mean(name.lower(), NAMES)
            raise ConfigError(f"there is no backend {name!r}; known are {', '.join(NAMES)}{meant}", "backend")
        kind = found.load()
    except ImportError as error:
        raise ConfigError(
            f"the backend {name!r} cannot be loaded: {error}; "
            f"if it needs an extra, install it: pip install 'ual-daemon[{_EXTRAS.get(name, name)}]'",
            "backend",
        ) from error
    return kind
