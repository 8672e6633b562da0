"""Network namespaces on one switch, each with an address of its own, as computers on a LAN."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

_SUBNET = "10.199.0"
_SWITCH = "switch"


class Lan:
    """Computers by name, each a network namespace. What runs there is run by `prefix`."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._tag = f"ualb{os.getpid()}"
        self._ports: dict[str, str] = {}
        self._add_namespace(_SWITCH)
        self._ip("-n", self._name(_SWITCH), "link", "add", "br0", "type", "bridge")
        self._ip("-n", self._name(_SWITCH), "link", "set", "br0", "up")

    def add(self, name: str) -> str:
        """Adds a computer. Returns its address."""
        number = len(self._ports) + 1
        address, port = f"{_SUBNET}.{number}", f"port{number}"
        self._ports[name] = port
        self._add_namespace(name)
        here, there = self._name(name), self._name(_SWITCH)
        pair = ("link", "add", "eth0", "type", "veth", "peer", "name", port, "netns", there)
        self._ip("-n", here, *pair)
        self._ip("-n", there, "link", "set", port, "master", "br0", "up")
        self._ip("-n", here, "addr", "add", f"{address}/24", "dev", "eth0")
        for link in ("lo", "eth0"):
            self._ip("-n", here, "link", "set", link, "up")
        return address

    def prefix(self, name: str) -> tuple[str, ...]:
        """Returns what a command begins with that runs on a computer."""
        return ("ip", "netns", "exec", self._name(name))

    def cut(self, name: str, *, is_up: bool) -> None:
        """Lets nothing to and from a computer pass, as a radio out of range does, or lets it pass again."""
        to = ("master", "br0") if is_up else ("nomaster",)
        self._ip("-n", self._name(_SWITCH), "link", "set", self._ports[name], *to)

    def _name(self, name: str) -> str:
        return f"{self._tag}-{name}"

    def _add_namespace(self, name: str) -> None:
        self._ip("netns", "add", self._name(name))
        self._stack.callback(self._ip, "netns", "del", self._name(name))

    @staticmethod
    def _ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True)


class Loopback:
    """The same on one computer, where namespaces cannot be made: all have the address of loopback."""

    def add(self, name: str) -> str:
        return "127.0.0.1"

    def prefix(self, name: str) -> tuple[str, ...]:
        return ()


@contextmanager
def lan() -> Iterator[Lan | Loopback]:
    """A LAN for the time of the block; `Loopback` where the machine does not allow it."""
    with ExitStack() as stack:
        try:
            made: Lan | Loopback = Lan(stack)
        except (subprocess.CalledProcessError, OSError):
            print("no network namespaces here (root, iproute2): all is on loopback")
            made = Loopback()
        yield made
