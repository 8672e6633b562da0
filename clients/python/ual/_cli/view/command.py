"""``ual view`` serves the page until Ctrl-C."""

from __future__ import annotations

import click

from ual._cli.app import Many, Session, command, pass_session
from ual._cli.help import Section
from ual._cli.view.guard import is_loopback
from ual.errors import InvalidArgumentError, NotSupportedError

_PORT = 8080


@command("view", "ual view", "ual view --control", "ual view --port 9000", section=Section.LOOKING, many=Many.ITSELF)
@click.option(
    "--address",
    "addresses",
    multiple=True,
    metavar="HOST:PORT|unix:PATH",
    help="A daemon that is not on this computer; as often as wanted.",
)
@click.option("--control", is_flag=True, help="Let the page fly, too. Without it, it only shows.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Where the page is served.")
@click.option("--port", type=click.IntRange(0, 65535), default=_PORT, show_default=True, help="0: any that is free.")
@pass_session
def view(session: Session, addresses: tuple[str, ...], control: bool, host: str, port: int) -> None:
    """Show the UAVs in a page of the browser until Ctrl-C.

    These are all UAVs of this computer, or those named by --ns, and those at the given addresses. They appear when
    their daemons start. A UAV that is lost turns grey at once. Needs ual-client[view].
    """
    _require_viser()
    if not is_loopback(host):
        raise InvalidArgumentError(f"--host {host}: only with TLS", {"field": "host"})
    from ual._cli.view import show

    show.show(session, (*filter(None, [session.address]), *addresses), host, port, control=control)


def _require_viser() -> None:
    """Refuses before anything is begun."""
    try:
        import viser  # noqa: F401
    except ImportError:
        raise NotSupportedError("ual view needs viser: pip install 'ual-client[view]'") from None


COMMANDS = (view,)
