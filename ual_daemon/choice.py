"""Choice by `backend`: a UAV that a backend flies, or a recording that plays as one.

Both have the members that the class and the server use. Imports are late, for a fast start of the program.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from ual_daemon.backends import registry
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.settings import ConfigError, VehicleSettings

if TYPE_CHECKING:
    from ual_daemon.frames.home_file import HomeFile
    from ual_daemon.replay.vehicle import PlayedVehicle
    from ual_daemon.vehicle.vehicle import Vehicle

    ServedVehicle: TypeAlias = Vehicle | PlayedVehicle


def make(
    backend: str | Backend,
    options: BackendOptions,
    settings: VehicleSettings | None,
    *,
    allow_arming: bool = False,
    watch_only: bool = False,
    home_file: HomeFile | None = None,
) -> ServedVehicle:
    """Makes a UAV of what a name stands for, or over a backend. See `Vehicle` for the other arguments.

    Raises:
        ConfigError: There is no backend of this name, it cannot be imported (an extra is missing), or a setting is not
            valid.

    """
    if backend == registry.PLAYED:
        return _played(options, settings)
    from ual_daemon.vehicle.vehicle import Vehicle

    if isinstance(backend, str):
        backend = registry.make(backend, options)
    return Vehicle(backend, settings, allow_arming=allow_arming, watch_only=watch_only, home_file=home_file)


def _played(options: BackendOptions, settings: VehicleSettings | None) -> PlayedVehicle:
    try:
        from ual_daemon.replay.vehicle import PlayedVehicle
    except ImportError as error:
        raise ConfigError(
            f"a recording cannot be played: {error}; install the extra: pip install 'ual-daemon[record]'", "backend"
        ) from error
    return PlayedVehicle(options, settings)
