"""Commands with the shared options, for one UAV or several, and the errors that end the program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import click
from typing_extensions import override

from ual.errors import UalError
from ual_tools import complete, multi, start
from ual_tools.help import ALIASES, Section, close, no_such_command, write_commands, write_examples
from ual_tools.session import INTERRUPTED, REFUSED, session
from ual_tools.streams import OutputLostError, give_up_output
from ual_tools.values import Number


class Multi(Enum):
    """What a command does where several UAVs are chosen."""

    REFUSED = "it is for one UAV"
    EACH = "each of them gets it, and none where one cannot be reached"
    REACHABLE = "each that can be reached gets it: it ends a flight, or only asks"
    LOOKING = "each that can be reached is asked: the worst comes first"
    ITSELF = "it looks at the choice itself"


SHARED_OPTIONS = (
    "--ns, --all, --network, --network-config, --at, --address, --tls-ca, --token-file, --tls-certificate, --tls-key, "
    "--lease, --take, --timeout, --json"
)


class _SharedOption(click.Option):
    """An option of `Session`. Only the help of `ual` itself describes it."""

    @override
    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        return super().get_help_record(ctx) if ctx.parent is None else None


class _SharedOptions(click.Command):
    """A command or group with the options of `Session`, a section of the help, and examples.

    Args:
        section: Where `ual --help` lists it.
        examples: Calls of it, as they are typed.

    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 (click's)
        section: Section = Section.FLYING,
        examples: Sequence[str] = (),
        **kwargs: Any,  # noqa: ANN401 (click's)
    ) -> None:
        super().__init__(*args, **kwargs)
        self.section = section
        self.examples = examples
        own = {name for param in self.params for name in (param.name, *param.opts)}
        self.params.extend(option for option in _shared_options() if own.isdisjoint((option.name, *option.opts)))

    @override
    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_examples(formatter, self.examples)
        if ctx.parent is not None:
            with formatter.section("Options of every command (see ual --help)"):
                formatter.write_text(SHARED_OPTIONS)
        super().format_epilog(ctx, formatter)

    @override
    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing:
            self._refuse_unknown_options(ctx, args)
        return super().parse_args(ctx, args)

    def _refuse_unknown_options(self, ctx: click.Context, args: list[str]) -> None:
        """Refuses an option that does not exist, which click would take for an argument: see `UalCommand`."""


def _shared_options() -> list[click.Parameter]:
    return [
        _SharedOption(
            ["--ns"],
            metavar="NAME",
            envvar="UAL_NS",
            help="Which UAV, or several: uav_1,uav_3.",
            expose_value=False,
            callback=_store("ns"),
            shell_complete=complete.namespaces,
        ),
        _SharedOption(
            ["--all", "is_all"],
            is_flag=True,
            help="All UAVs of this computer, or of the network.",
            expose_value=False,
            callback=_store("is_all"),
        ),
        _SharedOption(
            ["--network", "uses_network"],
            is_flag=True,
            help="Look for UAVs on the network, not only on this computer.",
            expose_value=False,
            callback=_store("uses_network"),
        ),
        _SharedOption(
            ["--network-config"],
            metavar="FILE",
            envvar="UAL_NETWORK",
            help="The same, on the network of this YAML file; loopback: this computer's.",
            expose_value=False,
            callback=_store("network_config"),
        ),
        _SharedOption(
            ["--at", "begin_utc_s"],
            type=start.Time(),
            metavar="TIME",
            help="When to begin: 14:05, 14:05:30, +10 (seconds from now), or 2026-11-23T14:05:30Z.",
            expose_value=False,
            callback=_store("begin_utc_s"),
        ),
        _SharedOption(
            ["--address"],
            metavar="HOST:PORT|unix:PATH",
            envvar="UAL_ADDRESS",
            help="Where its daemon is, if not on this computer.",
            expose_value=False,
            callback=_store("address"),
        ),
        _SharedOption(
            ["--tls-ca"],
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            envvar="UAL_TLS_CA",
            help="Certificates to trust, for a daemon that uses TLS.",
            expose_value=False,
            callback=_store("tls_ca"),
        ),
        _file_option("token_file", "UAL_TOKEN_FILE", "A token, where the daemon wants to know who calls."),
        _file_option("tls_certificate", "UAL_TLS_CERTIFICATE", "Your certificate, for a daemon that wants one."),
        _file_option("tls_key", "UAL_TLS_KEY", "Its private key."),
        _SharedOption(
            ["--lease", "has_lease"],
            is_flag=True,
            help="Let nobody else fly it meanwhile.",
            expose_value=False,
            callback=_store("has_lease"),
        ),
        _SharedOption(
            ["--take", "takes_lease"],
            is_flag=True,
            help="The same, and take that from who has it.",
            expose_value=False,
            callback=_store("takes_lease"),
        ),
        _SharedOption(
            ["--timeout", "timeout_s"],
            type=Number(min=0.0, min_open=True),
            metavar="SECONDS",
            help="How long to wait; a go-to or path is then cancelled.",
            expose_value=False,
            callback=_store("timeout_s"),
        ),
        _SharedOption(
            ["--json", "as_json"],
            is_flag=True,
            help="Print one JSON object a line.",
            expose_value=False,
            callback=_store("as_json"),
        ),
    ]


def _file_option(name: str, variable: str, help_text: str) -> click.Parameter:
    return _SharedOption(
        [f"--{name.replace('_', '-')}"],
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        envvar=variable,
        help=help_text,
        expose_value=False,
        callback=_store(name),
    )


class UalCommand(_SharedOptions):
    """A command that takes the shared options, and negative numbers as arguments.

    Args:
        multi: What it does where several UAVs are chosen.

    """

    def __init__(self, *args: Any, multi: Multi = Multi.REFUSED, **kwargs: Any) -> None:  # noqa: ANN401 (click's)
        super().__init__(*args, **kwargs)
        self._multi = multi
        # No command has an option like `-1`: so it is an argument.
        self.ignore_unknown_options = True

    @override
    def invoke(self, ctx: click.Context) -> Any:
        if self._multi is Multi.ITSELF or (names := multi.names(session(ctx))) is None:
            return super().invoke(ctx)
        if self._multi is Multi.REFUSED:
            raise click.UsageError(f"ual {self.name} is for one UAV at a time: name it by --ns", ctx)
        return multi.invoke(
            ctx,
            names,
            super().invoke,
            needs_all=self._multi is Multi.EACH,
            is_looking=self._multi is Multi.LOOKING,
        )

    @override
    def _refuse_unknown_options(self, ctx: click.Context, args: list[str]) -> None:
        known = {name for option in self.get_params(ctx) for name in (*option.opts, *option.secondary_opts)}
        for word in args:
            name = word.partition("=")[0]
            if word == "--":
                return
            if name.startswith("--") and name not in known:
                raise click.NoSuchOption(name, possibilities=close(name, known), ctx=ctx)


class UalGroup(_SharedOptions, click.Group):
    """A group of commands. Ends the program with the exit status that fits an error or an interruption."""

    command_class = UalCommand

    @override
    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        found = super().get_command(ctx, cmd_name)
        return super().get_command(ctx, ALIASES.get(cmd_name, "")) if found is None else found

    @override
    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if self.get_command(ctx, name) is None and not (ctx.resilient_parsing or name.startswith("-")):
            ctx.fail(no_such_command(name, self.commands))
        return super().resolve_command(ctx, args)

    @override
    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        if ctx.parent is not None:
            super().format_commands(ctx, formatter)
            return
        sections = {name: each.section for name, each in self.commands.items() if isinstance(each, _SharedOptions)}
        write_commands(formatter, self.commands, sections)

    @override
    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:  # (click's)
        try:
            return super().make_context(*args, **kwargs)
        except KeyboardInterrupt:  # click would print "Aborted!"
            raise click.exceptions.Exit(INTERRUPTED) from None

    @override
    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except UalError as error:
            session(ctx).fail(error)
            ctx.exit(REFUSED)
        except KeyboardInterrupt:
            ctx.exit(INTERRUPTED)
        except OutputLostError as error:
            give_up_output()
            if error.has_reader_left:
                ctx.exit(0)
            session(ctx).note(f"ual: the result cannot be printed: {error}")
            ctx.exit(REFUSED)


def command(
    name: str, *examples: str, section: Section = Section.FLYING, multi: Multi = Multi.REFUSED
) -> Callable[[Callable[..., None]], click.Command]:
    """Makes a command that takes the shared options. `examples` are calls of it, as they are typed."""
    return click.command(name, cls=UalCommand, section=section, examples=examples, multi=multi)


def _store(field: str) -> Callable[[click.Context, click.Parameter, Any], None]:
    def store(context: click.Context, _: click.Parameter, value: object) -> None:
        # An option that is missing after the command's name must not overwrite one that was given before it.
        if value is not None and value is not False:
            source = context.get_parameter_source(field)
            held = session(context)
            if source is click.core.ParameterSource.COMMANDLINE or getattr(held, field) in (None, False):
                setattr(held, field, value)

    return store
