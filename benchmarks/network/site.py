"""A site for a measurement: its certificates and files, its routers and listeners, as processes."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from benchmarks.children import Child, Process
from benchmarks.network import router
from benchmarks.network.namespaces import Lan, Loopback
from ual_tools.access import certificates, network_files

_PORT = 7447
ROUTERS = ("router_1", "router_2")


class Site:
    """A network with two routers, UAVs by their publishers, and an observer at the second router."""

    def __init__(
        self,
        directory: Path,
        lan: Lan | Loopback,
        publishers: Sequence[str],
        stack: ExitStack,
        *,
        is_split: bool = True,
    ) -> None:
        """`is_split` keeps the listener at the second router and the UAVs at the first: all crosses both."""
        self.directory = directory
        self.lan = lan
        self._stack = stack
        addresses = [lan.add(name) for name in ROUTERS]
        certificates.make_authority(directory, "benchmark", 1.0)
        for name, address in zip(ROUTERS, addresses, strict=True):
            certificates.make_daemon(directory, name, [address], 1.0)
        for name in publishers:
            certificates.make_daemon(directory, name, ["127.0.0.1"], 1.0)
        certificates.make_caller(directory, "observer", 1.0)
        routers = [
            network_files.Router(name, address, _PORT + i)
            for i, (name, address) in enumerate(zip(ROUTERS, addresses, strict=True))
        ]
        network_files.write(directory, network_files.NetworkSite("benchmark", routers, publishers, ["observer"]))
        if is_split:
            self._keep_router("observer", routers[1].endpoint)
            for name in publishers:
                self._keep_router(name, routers[0].endpoint)

    def _keep_router(self, name: str, endpoint: str) -> None:
        file = self.directory / f"{name}.network.yaml"
        lines = file.read_text().splitlines()
        file.write_text("\n".join(f"connect: [{endpoint}]" if each.startswith("connect:") else each for each in lines))

    def config(self, name: str) -> str:
        """Returns the file by which one joins."""
        return str(self.directory / f"{name}.network.yaml")

    def router(self, name: str) -> Process:
        """Starts a router. Returns it once it says that it routes."""
        file = self.directory / f"{name}.router.json5"
        return self._stack.enter_context(router.start(file, self.lan.prefix(name)))

    def listener(self) -> Child:
        """Starts the listeners, next to the second router."""
        arguments = ("benchmarks.network.listener", self.config("observer"))
        return self._stack.enter_context(Child(*arguments, prefix=self.lan.prefix(ROUTERS[1])))
