"""`ual gateway`: keeps the list of a gateway's upstreams as the network says (deploy/gateway)."""

from __future__ import annotations

import ipaddress
import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual.credentials import is_this_computer
from ual.discovery import natural_order
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.shared import whole_file
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session

if TYPE_CHECKING:
    from ual.network import NetworkUav

_POLL_PERIOD_S = 0.5


@command(
    "gateway",
    "ual --network gateway uavs.map --pid nginx.pid",
    "ual --network gateway uavs.map --once",
    section=Section.TEAMS,
)
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--pid",
    "pid_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File with the process id of nginx, which reloads after each change.",
)
@click.option("--once", is_flag=True, help="Write the file once, and end.")
@pass_session
def gateway(session: CommandSession, file: Path, pid_file: Path | None, once: bool) -> None:
    """Keep a gateway's list of UAVs as the network says.

    It does so until Ctrl-C.

    FILE is the list that nginx reads (deploy/gateway). nginx reloads after each change, and its calls go on. A UAV that
    is gone from the network stays in the list: whether its daemon is there, the call will tell. Where two UAVs have one
    name, the one that was there first stays, and both are left out where neither was.
    """
    if session.joined is None:
        raise InvalidArgumentError("a gateway learns its UAVs from the network: give --network or --network-config")
    network = session.joined.network()
    upstreams = Upstreams(session.tell)
    has_changed, failure = once, ""
    while True:
        has_changed = upstreams.update(network.uavs()) or has_changed
        if has_changed:
            before, failure = failure, _write(file, upstreams.text())
            if failure and once:
                raise InvalidArgumentError(failure, {"field": "file"})
            if failure and not before:
                session.tell(f"{failure}; it is tried again, and nginx has the UAVs of before")
        if has_changed and not failure:
            has_changed = False
            session.emit({"uavs": dict(upstreams.addresses)}, f"{file}: {len(upstreams.addresses)} UAVs")
            _tell_nginx(pid_file, session.tell)
        if once:
            return
        time.sleep(_POLL_PERIOD_S)


def _write(file: Path, text: str) -> str:
    """Writes the list. Returns why it cannot be written now; empty if it is."""
    try:
        whole_file.write(file, text, whole_file.READABLE_PERMISSIONS)
    except OSError as error:
        return f"cannot write {file}: {error.strerror}"
    return ""


class Upstreams:
    """Address of each UAV's daemon.

    Args:
        say: Takes why a UAV is left out, human-readable; each reason once.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._logged: set[str] = set()
        self._held: dict[str, tuple[str, str]] = {}
        """The instance that tells of each UAV, and the address."""

    @property
    def addresses(self) -> Mapping[str, str]:
        """The address of each UAV, by name."""
        return {ns: address for ns, (_, address) in sorted(self._held.items(), key=lambda each: natural_order(each[0]))}

    def text(self) -> str:
        """Returns the list as nginx reads it."""
        lines = (f"{ns} {address};\n" for ns, address in self.addresses.items())
        return "# Written by `ual gateway`: the daemon of each UAV.\n" + "".join(lines)

    def update(self, uavs: Iterable[NetworkUav]) -> bool:
        """Takes what the network says. Returns whether an address has changed."""
        before = dict(self.addresses)
        for uav in uavs:
            if uav.gone_s is None and self._may_stand_for_its_name(uav):
                self._hold(uav)
        return before != self.addresses

    def _may_stand_for_its_name(self, uav: NetworkUav) -> bool:
        if not uav.is_contested:
            return True
        self._tell(f"several UAVs have the name {uav.ns}: {uav.described()}")
        return self._held.get(uav.ns, ("", ""))[0] == uav.instance

    def _hold(self, uav: NetworkUav) -> None:
        try:
            self._held[uav.ns] = uav.instance, _upstream(uav)
        except (DaemonUnreachableError, InvalidArgumentError) as error:
            self._held.pop(uav.ns, None)
            self._tell(error.message)

    def _tell(self, text: str) -> None:
        if text not in self._logged:
            self._logged.add(text)
            self._say(text)


def _upstream(uav: NetworkUav) -> str:
    """Returns an address that nginx takes without asking for names while it runs."""
    from ual.network.followed import best_address

    address = best_address(uav)
    host = address.rpartition(":")[0].strip("[]")
    if address.startswith("unix:"):
        return address
    try:
        ipaddress.ip_address(host)
    except ValueError:
        if not is_this_computer(address):
            raise InvalidArgumentError(
                f"{uav.ns} is at {address}: nginx wants an IP address: set `host` in its network's file"
            ) from None
    return address


def _tell_nginx(pid_file: Path | None, say: Callable[[str], None]) -> None:
    """Has nginx read the list again. Calls that are in progress go on."""
    if pid_file is None:
        return
    try:
        os.kill(int(pid_file.read_text(encoding="ascii")), signal.SIGHUP)
    except (OSError, ValueError) as error:
        say(f"nginx cannot be told by {pid_file} ({error}): it reads the list when it starts")


COMMANDS = (gateway,)
