"""Context of a command: the choice of the UAV and the other shared options, and the output of results and errors."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ual.errors import InvalidArgumentError, UalError
from ual.shared import environment
from ual.types import TaskInfo
from ual_tools import start
from ual_tools.help import as_typed
from ual_tools.output import error_text, remedy_text, to_json
from ual_tools.streams import OutputKind, write

if TYPE_CHECKING:
    from ual import Uav
    from ual.credentials import Credentials
    from ual.discovery import Registration
    from ual_tools.network.joined import Joined
    from ual_tools.start import CommandMember

LOOPBACK = "loopback"
"""The network of this computer; as in `ual.network.settings`, which only commands of the network load."""
REFUSED_STATUS = 1
"""The exit status of a command that was refused or failed."""
INTERRUPTED_STATUS = 130


@dataclass
class _Shared:
    """State that all UAVs of one command share."""

    joined: Joined | None = None


@dataclass
class CommandSession:
    """The options that all commands take, before or after the command's name."""

    ns: str | None = None
    address: str | None = None
    tls_ca: Path | None = None
    token_file: Path | None = None
    tls_certificate: Path | None = None
    tls_key: Path | None = None
    has_lease: bool = False
    takes_lease: bool = False
    timeout_s: float | None = None
    as_json: bool = False
    network_config: str | None = None
    """A file of the network's settings, or ``loopback``; after `settle`, None where no network is meant."""
    uses_network: bool = False
    is_all: bool = False
    begin_utc_s: float | None = None
    """Time at which the command is to begin, in seconds since the epoch; None: now."""
    typed: set[str] = field(default_factory=set)
    """The names of the fields above that come from the command line, and not from the environment."""
    member: CommandMember | None = None
    """Its place among several UAVs that get the same command."""
    _shared: _Shared = field(default_factory=_Shared)

    def connect(self, *, with_lease: bool = True) -> Uav:
        """Returns the chosen UAV: when its command is to begin, where that is said.

        `with_lease`: with its lease, if one is wanted; False for a command that acquires it later by itself.
        """
        from ual import Uav

        network = "" if self.joined is None else self.joined.network()
        uav = Uav(self.ns, address=self.address, tls_ca=self.tls_ca, credentials=self.credentials, network=network)
        if self.member is not None:
            self.member.meet(uav)
        elif self.begin_utc_s is not None:
            uav.info()  # connected now, it begins on time
            start.wait_until(self.begin_utc_s, self.tell)
        if with_lease and (self.has_lease or self.takes_lease):
            self._lease(uav)
        return uav

    @property
    def joined(self) -> Joined | None:
        """The network, if UAVs are looked for there; it is joined when it is asked first."""
        if self.network_config is None:
            return None
        if self._shared.joined is None:
            from ual_tools.network.joined import Joined

            self._shared.joined = Joined(self.network_config, self.note)
        return self._shared.joined

    def settle(self) -> None:
        """Decides where UAVs are looked for: as a client of the library does, by what was typed and the environment.

        Raises:
            InvalidArgumentError: Both an address and a network are said.

        """
        network = self.network_config if "network_config" in self.typed else None
        if self.uses_network:
            network = self.network_config or LOOPBACK
        self.address, self.network_config = environment.resolve_target(self._if_typed("address"), network)

    def daemons(self) -> list[Registration]:
        """Returns the daemons of this computer, or those of the network that can be reached from here."""
        from ual import discovery

        return discovery.list_daemons() if self.joined is None else self.joined.registrations()

    @property
    def where(self) -> str:
        """Place in which UAVs are searched, as the end of a sentence."""
        return "runs on this computer" if self.joined is None else "is on the network"

    def connect_to(self, daemon: Registration) -> Uav:
        """Returns the UAV of a daemon of this computer."""
        from ual import Uav

        return Uav(daemon.ns, address=daemon.address, tls_ca=self.tls_ca, credentials=self.credentials)

    @property
    def credentials(self) -> Credentials:
        """Credentials for the daemon: from the options, and from the environment where there are none."""
        from ual.credentials import Credentials

        return Credentials.from_environment(
            *(self._if_typed(name) for name in ("token_file", "tls_certificate", "tls_key"))
        )

    def _if_typed(self, name: str) -> Any:  # noqa: ANN401 (an option's value)
        """Returns the value of an option that was typed; None for one of the environment, which the library reads."""
        return getattr(self, name) if name in self.typed else None

    def _lease(self, uav: Uav) -> None:
        try:
            uav.lease("ual", take=self.takes_lease)
        except UalError:
            uav.close()
            raise

    def emit(self, value: object, text: str | None = None) -> None:
        """Prints a result: one JSON object with ``--json``, else the text."""
        self._emit(value, text, OutputKind.DONE if _is_done(value) else OutputKind.RESULT)

    def emit_written(self, value: object, text: str) -> None:
        """Prints what was written into files. They stay written where the output is lost."""
        self._emit(value, text, OutputKind.DONE)

    def _emit(self, value: object, text: str | None, kind: OutputKind) -> None:
        line = json.dumps(self._named(to_json(value)), allow_nan=False) if self.as_json else text
        if line is not None:
            self._say(line if self.as_json else self._prefix + line, kind)

    def fail(self, error: UalError) -> None:
        """Prints in one line why the command was refused or failed, and where its remedy is described."""
        self._say(f"{self._prefix or 'ual: '}{as_typed(error_text(error))} ({remedy_text(error)})", OutputKind.MESSAGE)
        if self.as_json:
            self._say(json.dumps(self._named({"error": to_json(error)}), allow_nan=False), OutputKind.DONE)

    def note(self, text: str) -> None:
        """Prints a message that is not a result, on stderr."""
        self._say(self._prefix + text, OutputKind.MESSAGE)

    def tell(self, text: str) -> None:
        """Prints what the program itself does, on stderr."""
        self.note(f"{'' if self.member else 'ual: '}{text}")

    def _say(self, text: str, kind: OutputKind) -> None:
        if self.member is None:
            write(text, kind)
        else:
            self.member.lines.put((text, kind))

    @property
    def _prefix(self) -> str:
        return "" if self.member is None else f"{self.member.name}: "

    def _named(self, value: object) -> object:
        return value if self.member is None or not isinstance(value, dict) else {"ns": self.member.name, **value}


def fail_usage(error: click.UsageError) -> None:
    """Prints wrong usage as one JSON object. click prints the text, and ends the program with 2."""
    failure = InvalidArgumentError(as_typed(error.format_message()))
    write(json.dumps({"error": to_json(failure)}, allow_nan=False), OutputKind.DONE)


def _is_done(value: object) -> bool:
    """Returns whether a result tells of what the command has done, not of what it was asked to find out."""
    return isinstance(value, TaskInfo) or (isinstance(value, Mapping) and "done" in value)


def session(context: click.Context) -> CommandSession:
    """Returns the session of the running command."""
    return context.find_root().ensure_object(CommandSession)


def pass_session(function: Callable[..., None]) -> Callable[..., None]:
    """Passes the session to a command as its first argument."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (the command's own)
        function(session(click.get_current_context()), *args, **kwargs)

    return run


def note(text: str) -> None:
    """Prints a message of the running command that is not a result, on stderr."""
    session(click.get_current_context()).note(text)
