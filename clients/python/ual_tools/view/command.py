"""``ual view`` serves the page until Ctrl-C."""

from __future__ import annotations

from pathlib import Path

import click
from typing_extensions import override

from ual.shared import extras
from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.values import Whole
from ual_tools.view.access import access
from ual_tools.view.map_source import MOST_ZOOM, ZOOM, ground
from ual_tools.view.shown import MODEL_NAMES

_DEFAULT_PORT = 8080
_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


class ModelParam(click.ParamType[tuple[str, str]]):
    """The model of one UAV, or of all of them: (its name or nothing, the model)."""

    name = "model"

    @override
    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        ns, _, model = str(value).rpartition("=")
        if model not in MODEL_NAMES:
            self.fail(f"{model!r} is no model: {', '.join(MODEL_NAMES)}", param, ctx)
        return ns, model


@command("view", "ual view", "ual view --control", "ual view --port 9000", section=Section.LOOKING, multi=Multi.ITSELF)
@click.option(
    "--address",
    "addresses",
    multiple=True,
    metavar="HOST:PORT|unix:PATH",
    help="A daemon that is not on this computer; as often as wanted.",
)
@click.option("--control", is_flag=True, help="Let the page fly, too. Without it, it only shows.")
@click.option(
    "--model",
    "models",
    multiple=True,
    type=ModelParam(),
    metavar="[UAV=]MODEL",
    help=f"{', '.join(MODEL_NAMES)}: of all UAVs, or of one. When not given, it follows from the backend.",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Where the page is served.")
@click.option("--port", type=Whole(0, 65535), default=_DEFAULT_PORT, show_default=True, help="0: any that is free.")
@click.option("--tls-certificate", "certificate", type=_FILE, help="Serve by TLS, other computers, too (PEM).")
@click.option("--tls-key", "key", type=_FILE, help="The key of the certificate (PEM).")
@click.option("--token-file", type=_FILE, help="The token that a browser needs with --control or TLS; else a new one.")
@click.option("--map-tiles", metavar="URL", help="A map below: your own server or cache, with {z}, {x} and {y}.")
@click.option("--map-zoom", type=Whole(0, MOST_ZOOM), default=ZOOM, show_default=True, help="Of the tiles.")
@click.option("--map-picture", type=_FILE, help="A picture below the scene instead, with --map-corners.")
@click.option(
    "--map-corners",
    nargs=4,
    metavar="LAT,LON×4",
    help="Where its corners are: upper left, upper right, lower right, lower left.",
)
@pass_session
def view(
    session: CommandSession,
    addresses: tuple[str, ...],
    control: bool,
    models: tuple[tuple[str, str], ...],
    host: str,
    port: int,
    certificate: Path | None,
    key: Path | None,
    token_file: Path | None,
    map_tiles: str | None,
    map_zoom: int,
    map_picture: Path | None,
    map_corners: tuple[str, ...] | None,
) -> None:
    """Show the UAVs in a page of the browser until Ctrl-C.

    These are all UAVs of this computer, or those named by --ns, and those at the given addresses. They appear when
    their daemons start. A UAV that is lost turns grey at once. With --network they are those of the network: what these
    tell is shown, and with --control each is connected to. Needs ual-tools[view].
    """
    _require_viser()
    below = ground(map_tiles, map_zoom, map_picture, map_corners)
    where = access(host, port, certificate, key, token_file, control=control)
    from ual_tools.view import show

    # With names, it is where these are: see `chosen_daemons`.
    own_address = [session.address] if session.address and not session.ns else []
    fleet = show.Choice((*own_address, *addresses), dict(models), below)
    show.show(session, fleet, where, control=control)


def _require_viser() -> None:
    """Refuses before anything is begun."""
    with extras.needs("ual view", "ual-tools[view]"):
        import viser  # noqa: F401


COMMANDS = (view,)
