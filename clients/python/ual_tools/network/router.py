"""`ual router`: passes on what daemons tell, between computers. What `zenohd` does, without installing it."""

from __future__ import annotations

import os
from pathlib import Path

import click

from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session


@command("router", "ual router certificates/router_1.router.json5", section=Section.TEAMS)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@pass_session
def router(session: CommandSession, file: Path) -> None:
    """Run a router of the network until Ctrl-C.

    FILE is what `ual certificates network` has written, with the certificates next to it; `zenohd --config FILE` takes
    it, too. Needs ual-tools[network].
    """
    from ual.network.session import RouterSession, require

    require("ual router", "ual-tools[network]")
    path = file.resolve()
    os.chdir(path.parent)  # the file names certificates next to it
    with RouterSession(path) as running:
        session.emit({"router": running.identifier, "listen": running.listen}, f"routes at {', '.join(running.listen)}")
        running.run()


COMMANDS = (router,)
