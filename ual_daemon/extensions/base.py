"""Interface of extensions to the daemon, for packages of others."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, cast

from ual.access.roles import Role
from ual.interface import Uav
from ual_daemon.backends.payload import Payload
from ual_daemon.settings import Settings, convert

S = TypeVar("S", bound=Settings)


class RequireLease(Protocol):
    """See `ExtensionContext`."""

    def __call__(self, command: str, lease_id: str | None = None) -> None:
        """Raises `LeaseHeldError` or `LeaseLostError`, or returns."""


class CallContext(Protocol):
    """Context of a method of a service, in addition to its request."""

    lease_id: str
    """The lease by which the call is made; empty where it has none."""


def lease_of(context: object) -> str:
    """Returns the lease by which a call is made, from the context that a method of a service gets."""
    return cast("CallContext", context).lease_id


@dataclass(frozen=True)
class ExtensionContext:
    """Context of an extension.

    Args:
        uav: The UAV in this process, to read, to subscribe to and to command. It is closed by its opener.
        settings: Its section of the configuration, ``extensions.NAME``.
        require_lease: Checks that a call may move things: raises `LeaseHeldError` while another program holds the lease
            of the UAV. To be called by whatever moves, with the name of the command and, in a service, with
            `lease_of` its context. Without that, the lease of `uav` counts.
        payload: What the backend offers for what the UAV carries: commands and messages of the autopilot that do not
            fly. None where it offers nothing, and in a daemon that only watches.
    """

    uav: Uav
    settings: Mapping[str, Any]
    require_lease: RequireLease
    payload: Payload | None = None

    def settings_as(self, kind: type[S]) -> S:
        """Returns the settings as a struct of the extension's own.

        Raises:
            ConfigError: One of them is unknown, or not valid.

        """
        return convert(self.settings, kind)


@dataclass(frozen=True, slots=True)
class Service:
    """A gRPC service of an extension.

    Args:
        name: Its full name, ``package.Service``.
        add_to_server: What generated code calls ``add_..._to_server``, with the servicer in it already. The servicer's
            methods are coroutines, or asynchronous generators for streams of responses; they run on the daemon's event
            loop, and so must not block. They get the request and a `CallContext`, and raise the errors of `ual.errors`.
        roles: The role that each method needs. A method that is not named needs a pilot.

    """

    name: str
    add_to_server: Callable[[Any], None]
    roles: Mapping[str, Role]


class Extension(ABC):
    """An extension of one UAV. A package has a class of it for each entry point ``ual_daemon.extensions``.

    It is made before the UAV is opened, with an `ExtensionContext`, and may raise `ConfigError`.
    """

    @abstractmethod
    def __init__(self, context: ExtensionContext) -> None:
        """Checks the settings. Begins nothing."""

    @property
    @abstractmethod
    def services(self) -> Sequence[Service]:
        """The services that it adds. They appear in reflection and health."""

    @property
    @abstractmethod
    def interface(self) -> object:
        """Interface that `UAL.extension` returns: the same members as the package's client has."""

    @abstractmethod
    def start(self) -> None:
        """Begins, once the UAV is open. Returns soon."""

    @abstractmethod
    def close(self) -> None:
        """Ends its threads and tasks. To be called before the UAV is closed."""
