"""Writes the files with which routers, UAVs and observers join a network that is safe beyond one computer.

The certificates are those of `certificates`. What each may do on the network stands in the routers' files, by the name
in its certificate.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ual.network import configuration
from ual.network.keys import is_publisher
from ual.network.settings import NetworkSettings
from ual.shared import whole_file
from ual_tools.access import certificates

DEFAULT_PORT = 7447


@dataclass(frozen=True, slots=True)
class Router:
    """A router: the name of its certificate, and the host and port by which others reach it."""

    name: str
    host: str
    port: int = DEFAULT_PORT

    @property
    def endpoint(self) -> str:
        """Endpoint to which others connect."""
        return f"tls/{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class NetworkSite:
    """A network: its name, its routers, and the publishers and listeners that are allowed, by the names in
    certificates.
    """

    name: str
    routers: Sequence[Router]
    uavs: Sequence[str] = ()
    observers: Sequence[str] = ()


def write(directory: Path, site: NetworkSite) -> list[Path]:
    """Writes all files again, beside the certificates. Returns them.

    Raises:
        OSError: A certificate is missing, or a file cannot be written.
        ValueError: A name is given twice, or is none of a UAV.

    """
    _check(directory, site)
    written = [_write_router(directory, site, number) for number in range(len(site.routers))]
    return written + [_write_member(directory, site, name) for name in (*site.uavs, *site.observers)]


def _check(directory: Path, site: NetworkSite) -> None:
    names = [*(each.name for each in site.routers), *site.uavs, *site.observers]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ValueError(f"{min(twice)} is given twice: a certificate is for one purpose")
    for name in site.uavs:
        if not is_publisher(name):
            raise ValueError(f"{name!r} is no UAV: uav_7, or uav_1-200 for a fleet")
    for name in (certificates.AUTHORITY, *names):
        certificates.files(directory, name).certificate.stat()


def _settings(site: NetworkSite, name: str, connect: Sequence[Router]) -> NetworkSettings:
    """Returns the settings of a member. Its files are named without a directory: they are carried to its computer."""
    files = certificates.files(Path(), name)
    return NetworkSettings(
        site=site.name,
        connect=tuple(each.endpoint for each in connect),
        certificate=files.certificate,
        key=files.key,
        authority=certificates.files(Path(), certificates.AUTHORITY).certificate,
    )


def _write_router(directory: Path, site: NetworkSite, number: int) -> Path:
    """Writes the file of a router; it connects to those before it."""
    router = site.routers[number]
    config = configuration.router(
        _settings(site, router.name, [router]),
        listen=[f"tls/0.0.0.0:{router.port}"],
        connect=[each.endpoint for each in site.routers[:number]],
        publishers=site.uavs,
        observers=site.observers,
        routers=[each.name for each in site.routers if each is not router],
    )
    return _replace(directory / f"{router.name}.router.json5", json.dumps(config, indent=2) + "\n")


def _write_member(directory: Path, site: NetworkSite, name: str) -> Path:
    settings = _settings(site, name, site.routers)
    lines = (
        f"# How {name} joins the network (docs/how-to/network.md).",
        f"site: {settings.site}",
        f"connect: [{', '.join(settings.connect)}]",
        f"certificate: {settings.certificate}",
        f"key: {settings.key}",
        f"authority: {settings.authority}",
    )
    return _replace(directory / f"{name}.network.yaml", "\n".join(lines) + "\n")


def _replace(path: Path, text: str) -> Path:
    whole_file.write(path, text, whole_file.OWNER_PERMISSIONS)
    return path
