"""What a command is given: the choice of the UAV and the other shared options; and how it prints results and errors."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ual.errors import UalError
from ual.types import TaskInfo
from ual_tools import start
from ual_tools.help import as_typed
from ual_tools.output import error_text, to_json
from ual_tools.streams import Line, write

if TYPE_CHECKING:
    from ual import Uav
    from ual.credentials import Credentials
    from ual.discovery import Registration
    from ual_tools.start import Member

REFUSED = 1
"""The exit status of a command that was refused or failed."""
INTERRUPTED = 130


@dataclass
class Session:
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
    is_all: bool = False
    begin_utc_s: float | None = None
    """When its command is to begin, in seconds since the epoch; None: now."""
    member: Member | None = None
    """Its place among several UAVs that get the same command."""

    def connect(self, *, with_lease: bool = True) -> Uav:
        """Returns the chosen UAV: when its command is to begin, where that is said.

        `with_lease`: with its lease, if one is wanted; False for a command that acquires it later by itself.
        """
        from ual import Uav

        uav = Uav(self.ns, address=self.address, tls_ca=self.tls_ca, credentials=self.credentials)
        if self.member is not None:
            self.member.meet(uav)
        elif self.begin_utc_s is not None:
            uav.info()  # connected now, it begins on time
            start.wait_until(self.begin_utc_s, self.tell)
        if with_lease and (self.has_lease or self.takes_lease):
            self._lease(uav)
        return uav

    def connect_to(self, daemon: Registration) -> Uav:
        """Returns the UAV of a daemon of this computer."""
        from ual import Uav

        return Uav(daemon.ns, address=daemon.address, tls_ca=self.tls_ca, credentials=self.credentials)

    @property
    def credentials(self) -> Credentials:
        """What shows a daemon who calls: the options, and the environment where there are none."""
        from ual.credentials import Credentials, read

        if self.token_file is None and self.tls_certificate is None and self.tls_key is None:
            return Credentials.from_environment()
        token = None if self.token_file is None else read(self.token_file, "--token-file").decode(errors="replace")
        return Credentials(token, self.tls_certificate, self.tls_key)

    def _lease(self, uav: Uav) -> None:
        try:
            uav.lease("ual", take=self.takes_lease)
        except UalError:
            uav.close()
            raise

    def emit(self, value: object, text: str | None = None) -> None:
        """Prints a result: one JSON object with ``--json``, else the text."""
        line = json.dumps(self._named(to_json(value)), allow_nan=False) if self.as_json else text
        if line is not None:
            self._say(line if self.as_json else self._prefix + line, Line.DONE if _is_done(value) else Line.RESULT)

    def fail(self, error: UalError) -> None:
        """Prints in one line why the command was refused or failed."""
        self._say(f"{self._prefix or 'ual: '}{as_typed(error_text(error))}", Line.MESSAGE)
        if self.as_json:
            self._say(json.dumps(self._named({"error": to_json(error)}), allow_nan=False), Line.DONE)

    def note(self, text: str) -> None:
        """Prints a message that is not a result, on stderr."""
        self._say(self._prefix + text, Line.MESSAGE)

    def tell(self, text: str) -> None:
        """Prints what the program itself does, on stderr."""
        self.note(f"{'' if self.member else 'ual: '}{text}")

    def _say(self, text: str, kind: Line) -> None:
        if self.member is None:
            write(text, kind)
        else:
            self.member.lines.put((text, kind))

    @property
    def _prefix(self) -> str:
        return "" if self.member is None else f"{self.member.name}: "

    def _named(self, value: object) -> object:
        return value if self.member is None or not isinstance(value, dict) else {"ns": self.member.name, **value}


def _is_done(value: object) -> bool:
    """Whether a result tells of what the command has done, not of what it was asked to find out."""
    return isinstance(value, TaskInfo) or (isinstance(value, Mapping) and "done" in value)


def session(context: click.Context) -> Session:
    """Returns the session of the running command."""
    return context.find_root().ensure_object(Session)


def pass_session(function: Callable[..., None]) -> Callable[..., None]:
    """Passes the session to a command as its first argument."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (the command's own)
        function(session(click.get_current_context()), *args, **kwargs)

    return run


def note(text: str) -> None:
    """Prints a message of the running command that is not a result, on stderr."""
    session(click.get_current_context()).note(text)
