"""What all commands share: the choice of the UAV, the output of results, and errors that end the program."""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem
from typing_extensions import override

from ual._cli.output import error_text, to_json
from ual._cli.values import Number
from ual.errors import UalError

if TYPE_CHECKING:
    from ual._client import Uav
    from ual._discovery import Registration

REFUSED = 1
INTERRUPTED = 130


@dataclass
class Session:
    """The options that all commands take, before or after the command's name."""

    ns: str | None = None
    address: str | None = None
    tls_ca: Path | None = None
    timeout_s: float | None = None
    as_json: bool = False

    def connect(self) -> Uav:
        """Returns the chosen UAV."""
        from ual._client import Uav

        return Uav(self.ns, address=self.address, tls_ca=self.tls_ca)

    def connect_to(self, daemon: Registration) -> Uav:
        """Returns the UAV of a daemon of this computer."""
        from ual._client import Uav

        return Uav(daemon.ns, address=daemon.address, tls_ca=self.tls_ca)

    def emit(self, value: object, text: str | None = None) -> None:
        """Prints a result: one JSON object with ``--json``, else the text."""
        if self.as_json:
            click.echo(json.dumps(to_json(value), allow_nan=False))
        elif text is not None:
            click.echo(text)

    def fail(self, error: UalError) -> None:
        """Prints in one line why the command was refused or failed."""
        click.echo(f"ual: {error_text(error)}", err=True)
        if self.as_json:
            click.echo(json.dumps({"error": to_json(error)}, allow_nan=False))


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
    """Prints a message that is not a result, on stderr."""
    click.echo(text, err=True)


class _SharedOptions:
    """Adds the options of `Session` to a command or group."""

    params: list[click.Parameter]

    def add_shared_options(self) -> None:
        """Adds them."""
        self.params.extend(
            [
                click.Option(
                    ["--ns"],
                    metavar="NAME",
                    envvar="UAL_NS",
                    help="Which UAV.",
                    expose_value=False,
                    callback=_store("ns"),
                    shell_complete=_complete_ns,
                ),
                click.Option(
                    ["--address"],
                    metavar="HOST:PORT|unix:PATH",
                    envvar="UAL_ADDRESS",
                    help="Where its daemon is, if not on this computer.",
                    expose_value=False,
                    callback=_store("address"),
                ),
                click.Option(
                    ["--tls-ca"],
                    type=click.Path(exists=True, dir_okay=False, path_type=Path),
                    envvar="UAL_TLS_CA",
                    help="Certificates to trust, for a daemon that uses TLS.",
                    expose_value=False,
                    callback=_store("tls_ca"),
                ),
                click.Option(
                    ["--timeout", "timeout_s"],
                    type=Number(min=0.0, min_open=True),
                    metavar="SECONDS",
                    help="How long to wait; a go-to or path is then cancelled.",
                    expose_value=False,
                    callback=_store("timeout_s"),
                ),
                click.Option(
                    ["--json", "as_json"],
                    is_flag=True,
                    help="Print one JSON object a line.",
                    expose_value=False,
                    callback=_store("as_json"),
                ),
            ]
        )


class UalCommand(_SharedOptions, click.Command):
    """A command that takes the shared options, and negative numbers as arguments."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (click's)
        super().__init__(*args, **kwargs)
        # No command has an option like `-1`: so it is an argument.
        self.ignore_unknown_options = True
        self.add_shared_options()


class UalGroup(_SharedOptions, click.Group):
    """A group of commands. Ends the program with the exit status that fits an error or an interruption."""

    command_class = UalCommand

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (click's)
        super().__init__(*args, **kwargs)
        self.add_shared_options()

    @override
    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except UalError as error:
            session(ctx).fail(error)
            ctx.exit(REFUSED)
        except KeyboardInterrupt:
            ctx.exit(INTERRUPTED)
        except BrokenPipeError:
            # The reader of the output has closed the pipe. Python must not flush into it at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)


def command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """Makes a command that takes the shared options."""
    return click.command(name, cls=UalCommand)


def _store(field: str) -> Callable[[click.Context, click.Parameter, Any], None]:
    def store(context: click.Context, _: click.Parameter, value: object) -> None:
        # An option that is missing after the command's name must not overwrite one that was given before it.
        if value is not None and value is not False:
            source = context.get_parameter_source(field)
            held = session(context)
            if source is click.core.ParameterSource.COMMANDLINE or getattr(held, field) in (None, False):
                setattr(held, field, value)

    return store


def _complete_ns(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from ual import _discovery

    return [CompletionItem(each.ns) for each in _discovery.list_daemons() if each.ns.startswith(incomplete)]
