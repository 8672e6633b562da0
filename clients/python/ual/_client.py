"""The client: one UAV, flown through its daemon."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from typing_extensions import override

from ual import _calls, interface
from ual._connection import Connection
from ual._derived import SimulationMembers, UavMembers
from ual._derived_parts import PartMembers, Parts
from ual._lease import Lease
from ual._setpoints import EXTERNAL_POSES, Setpoints
from ual._subscription import Subscription, Subscriptions
from ual._target import DaemonTarget
from ual._task import Task
from ual.credentials import Credentials
from ual.shared.uncopied import Uncopied
from ual.types import Info, Plan, TaskRequest, Telemetry

if TYPE_CHECKING:
    from ual.network import Network, NetworkSettings

T = TypeVar("T")


class Uav(Uncopied, PartMembers, UavMembers):
    """One UAV, flown through its daemon. Its members are those of `ual.interface.Uav`.

    Nothing is connected until the first call. A daemon that was restarted is found again.

    Args:
        ns: The namespace of a daemon on this computer, such as ``uav_2``. Default: ``$UAL_NS``.
        address: Where the daemon is, ``host:50051`` or ``unix:/run/ual/uav_2.sock``. Default: ``$UAL_ADDRESS``. Where
            neither is given, it is the only UAV of this computer.
        tls_ca: A file with the certificates to trust, for a daemon that uses TLS. Default: ``$UAL_TLS_CA``; empty: no
            TLS, whatever that says.
        credentials: Credentials that the daemon checks. Default: the environment's (`Credentials.from_environment`).
        network: Where `ns` is looked for instead of on this computer: a `ual.network.Network`, which stays open
            meanwhile, or the name or file that `ual --network-config` takes. Default: ``$UAL_NETWORK``; empty: this
            computer, whatever that says.

    Example:
        >>> with ual.Uav("uav_1") as uav:
        ...     uav.take_off(3.0)
        ...     uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0))
        ...     uav.land()

    """

    def __init__(
        self,
        ns: str | None = None,
        *,
        address: str | None = None,
        tls_ca: str | Path | None = None,
        credentials: Credentials | None = None,
        network: Network | NetworkSettings | str | Path | None = None,
    ) -> None:
        self._connection = Connection(DaemonTarget(ns, address, tls_ca, credentials, network))
        self._lease: Lease | None = None
        self._setpoints = Setpoints(self._connection)
        self._external_poses = Setpoints(self._connection, kind=EXTERNAL_POSES)
        self._dry_run = interface.DryRun(lambda motion: self._connection.run(_calls.dry_run(motion)))
        self._simulation = Simulation(self._connection)
        self._parts = Parts(self._connection)
        self._is_simulation = False
        self._subscriptions = Subscriptions(self._connection)

    def __repr__(self) -> str:
        return f"<ual.Uav {self._connection.described}>"

    @property
    @override
    def ns(self) -> str:
        """The namespace. Asks the daemon where none was given."""
        return self._connection.target.ns or self.info().namespace

    @property
    def address(self) -> str:
        """Address of the daemon, even while it does not run."""
        return self._connection.target.address()

    @override
    def close(self) -> None:
        """Ends the setpoints, the subscriptions, the lease and the connection.

        A task of the UAV goes on, unless there was a lease; a velocity does not.
        """
        self._setpoints.settle()
        try:
            if self._lease is not None:
                self._lease.release()
        finally:  # also where Ctrl-C ends the wait for the daemon: threads and connections must not stay
            self._external_poses.settle()
            self._subscriptions.close()
            self._connection.close()

    @override
    def info(self) -> Info:
        info = super().info()
        self._connection.target.note_ns(info.namespace)
        return info

    @override
    def subscribe(self, callback: Callable[[Telemetry], None], rate_hz: float = 0.0) -> Subscription:
        return self._subscriptions.open(callback, _calls.rate(rate_hz))

    @override
    def _begin(self, request: TaskRequest, blocking: bool, timeout_s: float | None) -> Task:
        return Task(self._connection, self._command(_calls.begin_task(request, blocking), timeout_s))

    @override
    def lease(self, holder: str = "", *, take: bool = False) -> Lease:
        self._lease = Lease(self._connection, holder, take=take, settle=self._setpoints.settle)
        return self._lease

    @override
    def extension(self, name: str) -> Any:
        from ual import extension

        return extension.client_of(name, self._connection)

    @override
    def task(self, task_id: str) -> Task:
        return Task(self._connection, self._connection.run(_calls.get_task(task_id)))

    @property
    @override
    def dry_run(self) -> interface.DryRun[Plan]:
        return self._dry_run

    @property
    @override
    def simulation(self) -> Simulation:
        if not self._is_simulation:
            self._simulation.parts()
            self._is_simulation = True
        return self._simulation

    @override
    def _command(self, call: _calls.Call[T], timeout_s: float | None = None) -> T:
        """Makes a call that comes after the setpoints given before it: none of them may overtake an abort."""
        self._setpoints.settle()
        return self._connection.run(call, timeout_s)


class Simulation(SimulationMembers):
    """The world around a simulated UAV, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Simulation of {self._connection.described}>"
