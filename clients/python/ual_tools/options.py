"""The options that many commands have: those of every command (`SHARED`), and those that a command picks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem
from typing_extensions import override

from ual import credentials
from ual.shared import environment
from ual_tools import complete, start, values
from ual_tools.session import session

F = TypeVar("F", bound=Callable[..., Any])

_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
_ANY_FILE = click.Path(dir_okay=False, path_type=Path)


@dataclass(frozen=True)
class Option:
    """An option: its flag, the name of its value, its help, and what reads its value. Without that it is a switch."""

    flag: str
    name: str
    help: str
    type: click.ParamType[Any] | Callable[[str], Any] | None = None
    metavar: str | None = None
    variable: str | None = None
    default: Any = None
    complete: Callable[[click.Context, click.Parameter, str], list[CompletionItem]] | None = None

    @property
    def attributes(self) -> dict[str, Any]:
        """Keyword arguments for click."""
        options = {
            "help": self.help,
            "type": self.type,
            "metavar": self.metavar,
            "envvar": self.variable,
            "default": self.default,
            "shell_complete": self.complete,
            "show_default": self.default not in (None, "") or None,
        }
        kind = {"is_flag": True} if self.type is None else {}  # with False, click lets the value be left out
        return {**kind, **{name: value for name, value in options.items() if value is not None}}

    def __call__(self, command: F) -> F:
        """Adds it to a command, as a decorator."""
        return click.option(self.flag, self.name, **self.attributes)(command)


SHARED = (
    Option(
        "--ns",
        "ns",
        "Which UAV, or several: uav_1,uav_3.",
        click.STRING,
        "NAME",
        environment.NS_VARIABLE,
        None,
        complete.namespaces,
    ),
    Option("--all", "is_all", "All UAVs of this computer, or of the network."),
    Option("--network", "uses_network", "Look for UAVs on the network, not only on this computer."),
    Option(
        "--network-config",
        "network_config",
        "The same, on the network of this YAML file; loopback: this computer's.",
        click.STRING,
        "FILE",
        environment.NETWORK_VARIABLE,
    ),
    Option(
        "--at",
        "begin_utc_s",
        "When to begin: 14:05, 14:05:30, +10 (seconds from now), or 2026-11-23T14:05:30Z.",
        start.Time(),
        "TIME",
    ),
    Option(
        "--address",
        "address",
        "Where its daemon is, if not on this computer.",
        click.STRING,
        "HOST:PORT|unix:PATH",
        environment.ADDRESS_VARIABLE,
    ),
    Option(
        "--tls-ca", "tls_ca", "Certificates to trust, for a daemon that uses TLS.", _FILE, None, environment.CA_VARIABLE
    ),
    Option(
        "--token-file",
        "token_file",
        "A token, where the daemon wants to know who calls.",
        _FILE,
        None,
        credentials.TOKEN_FILE_VARIABLE,
    ),
    Option(
        "--tls-certificate",
        "tls_certificate",
        "Your certificate, for a daemon that wants one.",
        _FILE,
        None,
        credentials.CERTIFICATE_VARIABLE,
    ),
    Option("--tls-key", "tls_key", "Its private key.", _FILE, None, credentials.KEY_VARIABLE),
    Option("--lease", "has_lease", "Let nobody else fly it meanwhile."),
    Option("--take", "takes_lease", "The same, and take that from who has it."),
    Option(
        "--timeout",
        "timeout_s",
        "How long to wait; a go-to or path is then cancelled.",
        values.Number(min=0.0, min_open=True),
        "SECONDS",
    ),
    Option("--json", "as_json", "Print one JSON object a line."),
)
"""The options of `CommandSession`, by the names of its fields."""

yaw = Option(
    "--yaw",
    "yaw",
    "Heading, counter-clockwise from x (0 is east, 90deg north): 90deg, 1.57rad or 1.57. Kept when not given.",
    values.heading,
)
frame = Option(
    "--frame",
    "frame_id",
    "The frame of the coordinates; <ns>/odom when not given.",
    click.STRING,
    default="",
    complete=complete.frames,
)
max_speed = Option(
    "--max-speed",
    "max_speed_m_s",
    "The highest speed in any direction (m/s); the UAV's limits when not given.",
    values.number,
    "M_S",
)
corner_radius = Option(
    "--corner-radius",
    "corner_radius_m",
    "Round each corner within this distance (m); 0 stops at each.",
    values.number,
    default=0.0,
)
altitude = Option(
    "--altitude",
    "altitude_m",
    "Fly all of a KML, KMZ, GPX or GeoJSON file at this altitude above home.",
    values.number,
    "M",
)
altitude_reference = Option(
    "--reference",
    "altitude_reference",
    "What the altitudes of a GPX or GeoJSON file count from.",
    values.altitude_reference,
    "home|amsl|ellipsoid",
)
plot = Option(
    "--plot",
    "plot",
    "Draw the flown path and the wanted one (.png, .svg, .pdf); needs ual-tools[plot].",
    _ANY_FILE,
    "FILE",
)
dry_run = Option("--dry-run", "dry_run", "Only print what would happen; nothing moves.")


def shared() -> list[click.Parameter]:
    """Returns the options of `CommandSession` for a command. Each stores its value there."""
    return [
        _SharedOption([each.flag, each.name], expose_value=False, callback=_store(each.name), **each.attributes)
        for each in SHARED
    ]


class _SharedOption(click.Option):
    """An option of `CommandSession`. Only the help of `ual` itself describes it."""

    @override
    def resolve_envvar_value(self, ctx: click.Context) -> str | None:
        return environment.value(self.envvar) if isinstance(self.envvar, str) else None

    @override
    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        return super().get_help_record(ctx) if ctx.parent is None else None


def _store(field: str) -> Callable[[click.Context, click.Parameter, Any], None]:
    def store(context: click.Context, _: click.Parameter, value: object) -> None:
        # An option that is missing after the command's name must not overwrite one that was given before it.
        if value is not None and value is not False:
            source = context.get_parameter_source(field)
            held = session(context)
            if source is click.core.ParameterSource.COMMANDLINE or getattr(held, field) in (None, False):
                setattr(held, field, value)
                if source is click.core.ParameterSource.COMMANDLINE:
                    held.typed.add(field)

    return store
