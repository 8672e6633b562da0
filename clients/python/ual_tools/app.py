"""Commands with the shared options, for one UAV or several, and the errors that end the program."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any

import click
from typing_extensions import override

from ual.errors import UalError
from ual_tools import multi, options
from ual_tools.help import ALIASES, Section, close, no_such_command, write_examples
from ual_tools.session import INTERRUPTED_STATUS, REFUSED_STATUS, fail_usage, session
from ual_tools.streams import OutputLostError, end_without_output


class Multi(Enum):
    """Behaviour of a command where several UAVs are chosen."""

    REFUSED = "it is for one UAV"
    EACH = "each of them gets it, and none where one cannot be reached"
    REACHABLE = "each that can be reached gets it: it ends a flight, or only asks"
    LOOKING = "each that can be reached is asked: the worst comes first"
    ITSELF = "it looks at the choice itself"


SHARED_OPTIONS = ", ".join(option.flag for option in options.SHARED)


def _write_unbroken(formatter: click.HelpFormatter, text: str) -> None:
    """Writes lines that end between words only: click also ends them after a hyphen, amid an option."""
    width = formatter.width - formatter.current_indent
    indent = " " * formatter.current_indent
    formatter.write(textwrap.indent(textwrap.fill(text, width, break_on_hyphens=False), indent) + "\n")


class SharedOptions(click.Command):
    """A command or group with the options of `CommandSession`, a section of the help, and examples.

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
        self.params.extend(option for option in options.shared() if own.isdisjoint((option.name, *option.opts)))

    @override
    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_examples(formatter, self.examples)
        if ctx.parent is not None:
            with formatter.section("Options of every command (see ual --help)"):
                _write_unbroken(formatter, SHARED_OPTIONS)
        super().format_epilog(ctx, formatter)

    @override
    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing:
            self._refuse_unknown_options(ctx, args)
        return super().parse_args(ctx, args)

    def _refuse_unknown_options(self, ctx: click.Context, args: list[str]) -> None:
        """Refuses an option that does not exist, which click would take for an argument: see `UalCommand`."""


class UalCommand(SharedOptions):
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
        session(ctx).settle()
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


def _has_json(words: Sequence[str]) -> bool:
    """Returns whether what was typed has ``--json``: where it is wrong usage, click may not have come to it."""
    return "--json" in words[: words.index("--")] if "--" in words else "--json" in words


_IS_JSON = "ual_tools.is_json"


class UalGroup(SharedOptions, click.Group):
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
    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        is_json = parent is None and _has_json(args)
        try:
            context = super().make_context(info_name, args, parent, **extra)
        except click.UsageError as error:
            if is_json:
                fail_usage(error)
            raise
        except KeyboardInterrupt:  # click would print "Aborted!"
            raise click.exceptions.Exit(INTERRUPTED_STATUS) from None
        except OutputLostError as error:  # of help or version
            raise click.exceptions.Exit(0 if end_without_output(error) else REFUSED_STATUS) from None
        context.meta.setdefault(_IS_JSON, is_json)
        return context

    @override
    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except UalError as error:
            session(ctx).fail(error)
            ctx.exit(REFUSED_STATUS)
        except click.UsageError as error:
            if ctx.parent is None and ctx.meta[_IS_JSON]:
                fail_usage(error)
            raise
        except KeyboardInterrupt:
            ctx.exit(INTERRUPTED_STATUS)
        except OutputLostError as error:
            ctx.exit(0 if end_without_output(error) else REFUSED_STATUS)


def command(
    name: str, *examples: str, section: Section = Section.FLYING, multi: Multi = Multi.REFUSED
) -> Callable[[Callable[..., None]], click.Command]:
    """Makes a command that takes the shared options. `examples` are calls of it, as they are typed."""
    return click.command(name, cls=UalCommand, section=section, examples=examples, multi=multi)
