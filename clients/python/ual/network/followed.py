"""Address of one UAV in the network, for a client that flies it: found again, and never exchanged for another UAV's."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from ual.credentials import is_this_computer
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.network import computer
from ual.network.values import NetworkUav


class Followed:
    """The address of one UAV, as it is now. Any thread may ask.

    Args:
        ns: Its name; empty where it is the only one of the network.
        called: Returns the UAVs of a name that are known now.
        where: The network, for errors.
        is_settled: Returns whether all that are there have announced themselves. Shortly after the network was joined
            they may not have.
        names: Returns the names of the UAVs that are there.

    """

    def __init__(
        self,
        ns: str,
        called: Callable[[str], Sequence[NetworkUav]],
        where: str,
        is_settled: Callable[[], bool] = lambda: True,
        names: Callable[[], Collection[str]] = tuple,
    ) -> None:
        self.ns = ns
        """Its name; where none was given, that of the only one, once `address` was requested."""
        self._names = names
        self._called = called
        self._where = where
        self._is_settled = is_settled
        self._last: NetworkUav | None = None

    @property
    def is_settled(self) -> bool:
        """Whether its address can be requested: a UAV that is there and was not received yet would count as missing."""
        return self._last is not None or self._is_settled()

    def address(self) -> str:
        """Returns where it is.

        Raises:
            DaemonUnreachableError: The network does not know it, or it can be reached on its own computer only.
            InvalidArgumentError: Several UAVs have this name, it is another one than before, or no name was given and
                there are several.

        """
        self.ns = self.ns or self._only()
        found = self._choose(self._called(self.ns))
        self._last = found
        return best_address(found)

    def close(self) -> None:
        """Does nothing: the network is another's."""

    def _only(self) -> str:
        names = self._names()
        if not names:
            raise DaemonUnreachableError(f"no UAV is on the network ({self._where})")
        if len(names) > 1:
            raise InvalidArgumentError(
                f"ns: {len(names)} UAVs are on the network: choose one by its name (ns, --ns)", {"field": "ns"}
            )
        return next(iter(names))

    def _choose(self, found: Sequence[NetworkUav]) -> NetworkUav:
        same = [each for each in found if self._last is not None and each.instance == self._last.instance]
        if same:
            return same[0]
        if len(found) > 1:
            raise InvalidArgumentError(f"ns: {conflict(found)}", {"field": "ns"})
        if not found:
            if self._last is not None:  # it is gone for long: its daemon, not the network, says whether it is there
                return self._last
            raise DaemonUnreachableError(f"no UAV {self.ns} is on the network ({self._where}): `ual list --network`")
        if self._last is not None and found[0].teller.host != self._last.teller.host:
            raise InvalidArgumentError(
                f"ns: {self.ns} was on {self._last.teller.host} and is now told by {found[0].teller.host}: that is "
                "another UAV. Make a new client if it is meant",
                {"field": "ns"},
            )
        return found[0]


def conflict(found: Sequence[NetworkUav]) -> str:
    """Returns that several UAVs have one name, human-readable."""
    addresses = " and ".join(each.described() for each in found)
    return f"{len(found)} UAVs have the name {found[0].ns}: {addresses}. Give each a name of its own"


def best_address(uav: NetworkUav) -> str:
    """Returns the address by which a program of this computer reaches a UAV best.

    Raises:
        DaemonUnreachableError: It can be reached on its own computer only.

    """
    is_here = uav.teller.computer_id == computer.identifier()
    reachable = [each for each in uav.addresses if is_here or not is_this_computer(each)]
    if not reachable:
        raise DaemonUnreachableError(
            f"{uav.ns} can be reached only on its own computer, {uav.teller.host} "
            f"({', '.join(uav.addresses) or 'no address'}): start its daemon with --listen, or fly it through a gateway"
        )
    return min(reachable, key=lambda each: not is_this_computer(each)) if is_here else reachable[0]
