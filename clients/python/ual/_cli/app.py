"""What all commands share: which UAV is meant, how results are printed, how errors end the program."""

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
    """The options that every command takes, before or after its name."""

    ns: str | None = None
    address: str | None = None
    tls_ca: Path | None = None
    timeout_s: float | None = None
    as_json: bool = False

    def connect(self) -> Uav:
        """The UAV that is meant."""
        from ual._client import Uav

        return Uav(self.ns, address=self.address, tls_ca=self.tls_ca)

    def connect_to(self, daemon: Registration) -> Uav:
        """The UAV of a daemon of this computer."""
        from ual._client import Uav

        return Uav(daemon.ns, address=daemon.address, tls_ca=self.tls_ca)

    def emit(self, value: object, text: str | None = None) -> None:
        """Prints a result: one JSON object, or the text for people and pipes."""
        if self.as_json:
            click.echo(json.dumps(to_json(value), allow_nan=False))
        elif text is not None:
            click.echo(text)

    def fail(self, error: UalError) -> None:
        """Prints why it was refused or failed, in one line."""
        click.echo(f"ual: {error_text(error)}", err=True)
        if self.as_json:
            click.echo(json.dumps({"error": to_json(error)}, allow_nan=False))


def session(context: click.Context) -> Session:
    """The session of a running command."""
    return context.find_root().ensure_object(Session)


def pass_session(function: Callable[..., None]) -> Callable[..., None]:
    """Hands the session to a command as its first argument."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (the command's own)
        function(session(click.get_current_context()), *args, **kwargs)

    return run


def note(text: str) -> None:
    """Tells people something that is no result."""
    click.echo(text, err=True)


class _SharedOptions:
    """Adds the options of `Session` to a command or group."""

    params: list[click.Parameter]

    def add_shared_options(self) -> None:
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
        # `-1` is no option of any command; so it is an argument.
        self.ignore_unknown_options = True
        self.add_shared_options()


class UalGroup(_SharedOptions, click.Group):
    """The outermost group: ends the program as errors of the interface and interruptions say."""

    command_class = UalCommand

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (click's)
        super().__init__(*args, **kwargs)
        self.add_shared_options()

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 (click's)
        try:
            return super().invoke(ctx)
        except UalError as error:
            session(ctx).fail(error)
            ctx.exit(REFUSED)
        except KeyboardInterrupt:
            ctx.exit(INTERRUPTED)
        except BrokenPipeError:
            # Whoever read our output has enough. Nothing may be flushed into the pipe at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)


def command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """Makes a command that takes the shared options."""
    return click.command(name, cls=UalCommand)


def _store(field: str) -> Callable[[click.Context, click.Parameter, Any], None]:
    def store(context: click.Context, _: click.Parameter, value: object) -> None:
        # What is not given after the command's name must not hide what was given before it.
        if value is not None and value is not False:
            source = context.get_parameter_source(field)
            held = session(context)
            if source is click.core.ParameterSource.COMMANDLINE or getattr(held, field) in (None, False):
                setattr(held, field, value)

    return store


def _complete_ns(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from ual import _discovery

    return [CompletionItem(each.ns) for each in _discovery.list_daemons() if each.ns.startswith(incomplete)]
