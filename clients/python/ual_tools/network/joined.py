"""The network of a command: joined when it is needed first, once for all UAVs of the command."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from ual.credentials import is_this_computer
from ual.discovery import Registration

if TYPE_CHECKING:
    from ual.network import Network, NetworkUav


class Joined:
    """The network, if a command is to use one. Any thread may ask.

    Args:
        config: A file of settings, or ``loopback``.
        say: Takes what was dropped, human-readable.

    """

    def __init__(self, config: str, say: Callable[[str], None]) -> None:
        self._config = config
        self._say = say
        self._lock = threading.Lock()
        self._network: Network | None = None

    def network(self) -> Network:
        """Returns the network, complete: each daemon that is there has announced its UAVs.

        Raises:
            UalError: It cannot be joined.

        """
        with self._lock:
            if self._network is None:
                from ual.network import Network

                self._network = Network(self._config, on_problem=lambda text: self._say(f"ual: network: {text}"))
                self._network.wait_until_complete()
        return self._network

    def registrations(self) -> list[Registration]:
        """Returns the daemons that are there and can be reached from here, each by its best address.

        A name that several of them have is left out, and told.
        """
        from ual.errors import DaemonUnreachableError
        from ual.network.followed import best_address

        found = []
        for why in self.network().unseen:
            self._say(f"ual: network: not all UAVs are seen: {why}")
        for uav in self.network().uavs():
            if uav.gone_s is not None:
                continue
            if uav.is_contested:
                self._say(f"ual: network: left out, because others have its name: {uav.described()}")
                continue
            try:
                address, teller = best_address(uav), uav.teller
                found.append(Registration(uav.ns, teller.pid, address, uav.report.backend, teller.started_s))
            except DaemonUnreachableError as error:
                self._say(f"ual: network: {error}")
        return found


def label(uav: NetworkUav) -> str:
    """Returns the name by which a UAV is shown: with its place where another one has the same name."""
    if not uav.is_contested:
        return uav.ns
    remote = [each for each in uav.addresses if not is_this_computer(each)]
    return f"{uav.ns}@{(remote or uav.addresses or (uav.instance,))[0]}"
