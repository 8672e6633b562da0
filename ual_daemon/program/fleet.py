"""Many UAVs in one daemon (``--fleet``): their names, addresses and positions, and the open files that they need."""

from __future__ import annotations

import itertools
import os
import resource
from collections.abc import Callable, Sequence

from msgspec import structs

from ual import discovery
from ual.geometry import Vector3
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.settings import LONGEST_NAMESPACE_CHARACTERS, ConfigError, VehicleSettings

UAVS_PER_ROW = 10
"""UAVs in a row, from west to east. The next row is to the north."""

_FILES_PER_UAV = 2
"""File descriptors of a UAV without callers and with one address: its lock and the address. One more for each further
address.
"""
_FILES_PER_PROCESS = 64
_CALLERS_FILES_PER_UAV = 4


def names(first: str, count: int) -> list[str]:
    """Returns the namespaces of a fleet: numbered on from a name that ends in ``_N``, else from ``_1``.

    Raises:
        ConfigError: The names are too long.
    """
    base, number = discovery.split_number(first)
    begin = 1 if number is None else number
    if len(f"{base}_{begin + count}") > LONGEST_NAMESPACE_CHARACTERS:
        raise ConfigError(
            f"{first}: the names of a fleet of {count} are longer than {LONGEST_NAMESPACE_CHARACTERS}", "ns"
        )
    return [f"{base}_{begin + i}" for i in range(count)]


def urls(count: int | None, wanted: Sequence[str], key: Callable[[str], str] = str) -> list[str | None]:
    """Returns the URL of each vehicle; None for each of a simulated fleet. `key` says which vehicle a URL leads to.

    Raises:
        ConfigError: There are more or fewer URLs than UAVs, or two UAVs would be one vehicle.
    """
    if not wanted:
        return [None] * (count or 0)
    if count is not None and count != len(wanted):
        raise ConfigError(f"{count} UAVs, but {len(wanted)} --fleet-url: leave out --fleet", "fleet")
    owners: dict[str, str] = {}
    for url in wanted:
        vehicle = key(url)
        if vehicle in owners:
            first = owners[vehicle]
            twice = f"{url} is given twice" if first == url else f"{first} and {url} lead to the same vehicle"
            raise ConfigError(f"{twice}: two UAVs cannot be one vehicle", "fleet_url")
        owners[vehicle] = url
    return list(wanted)


def grid_positions(urls: Sequence[str | None], spacing_m: float) -> list[Vector3]:
    """Returns where simulated UAVs stand, relative to the first one: in rows of `UAVS_PER_ROW`, so that a UAV's
    position does not depend on how many there are. Vehicles with a URL stand where they stand: all get the same place.
    """
    return [
        Vector3(i % UAVS_PER_ROW * spacing_m, i // UAVS_PER_ROW * spacing_m, 0.0) if url is None else Vector3()
        for i, url in enumerate(urls)
    ]


def placed(settings: VehicleSettings, position: Vector3) -> VehicleSettings:
    """Returns the settings of the UAV at a place, made from the settings of the first UAV."""
    x, y, z = settings.home_pose
    return structs.replace(settings, home_pose=(x + position.x, y + position.y, z + position.z))


def addresses(templates: Sequence[str], ns: str) -> list[str]:
    """Returns the addresses of one UAV: replaces ``{ns}`` by its namespace and ``{port}`` by its port, 50050 + N.

    Raises:
        ConfigError: All UAVs would share the address, or the port would be above 65535.
    """
    found = []
    for template in templates:
        if "{ns}" not in template and "{port}" not in template and not template.endswith(":0"):
            raise ConfigError(
                f"{template}: each UAV of a fleet needs an address of its own: "
                "HOST:{port} for port 50050 + N, or unix:DIRECTORY/{ns}.sock",
                "listen",
            )
        if "{port}" in template and not discovery.has_own_port(ns):
            raise ConfigError(
                f"{ns} has no port, because 50050 + N is above 65535; use unix sockets for so many UAVs", "fleet"
            )
        found.append(template.replace("{ns}", ns).replace("{port}", str(discovery.default_port(ns))))
    return found


def parts(settings: DaemonSettings) -> list[range]:
    """Returns which UAVs each process flies, counted from 0: one part for all, unless there are `workers`.

    Raises:
        ConfigError: What is flown cannot be spread over processes.
    """
    if settings.workers is None:
        return [range(len(settings.fleet_url) or settings.fleet or 1)]
    if settings.fleet_url:
        raise ConfigError(
            "vehicles with URLs of their own share a radio or a simulator: one process flies them", "workers"
        )
    if settings.fleet is None:
        raise ConfigError("one UAV is flown by one process: give --fleet, too", "workers")
    wanted = _usable_processors() if settings.workers == "auto" else settings.workers
    count = min(wanted, settings.fleet)
    bounds = [settings.fleet * i // count for i in range(count + 1)]
    return [range(begin, end) for begin, end in itertools.pairwise(bounds)]


def _usable_processors() -> int:
    """Returns how many processors this process may use; the system may have more."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def allow_files(count: int, listening: int) -> None:
    """Raises the process's limit of open files to what a fleet needs.

    Raises:
        ConfigError: The system does not permit so many.
    """
    least = _FILES_PER_PROCESS + count * (_FILES_PER_UAV + listening - 1)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < least:
        raise ConfigError(
            f"{count} UAVs need {least} open files, and this process may have {hard}: raise that limit "
            "(ulimit -Hn, LimitNOFILE= of systemd)",
            "fleet",
        )
    wanted = least + count * _CALLERS_FILES_PER_UAV
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
