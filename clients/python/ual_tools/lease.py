"""`ual lease`: the program that alone may fly a UAV."""

from __future__ import annotations

from datetime import datetime, timezone

from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session


@command("lease", "ual lease", "ual --lease takeoff 3", section=Section.LOOKING, multi=Multi.REACHABLE)
@pass_session
def lease(session: CommandSession) -> None:
    """Print the holder of the lease of the UAV.

    While somebody does, nobody else flies it. `ual --lease COMMAND` holds it for as long as the command takes; `ual
    --take COMMAND` takes it from its holder.
    """
    with session.connect(with_lease=False) as uav:
        found = uav.lease_info()
    if found is None:
        session.emit({"holder": None}, "nobody holds the lease: every pilot may fly")
        return
    since = datetime.fromtimestamp(found.since_s, timezone.utc)
    session.emit(
        {"holder": found.holder, "identity": found.identity, "since": since.isoformat(timespec="seconds")},
        f"{found.holder} ({found.identity}) since {since:%H:%M:%S} UTC",
    )


COMMANDS = (lease,)
