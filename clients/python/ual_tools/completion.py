"""``ual completion`` prints the script that completes commands in a shell."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from ual_tools.app import command
from ual_tools.help import Section


@command(
    "completion",
    'eval "$(ual completion bash)"    # in ~/.bashrc',
    'eval "$(ual completion zsh)"     # in ~/.zshrc',
    "ual completion fish | source     # in ~/.config/fish/config.fish",
    section=Section.TOOLS,
)
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the script that completes commands in a shell.

    It also completes options, and the names of UAVs and frames.
    """
    kind = get_completion_class(shell)
    assert kind is not None
    click.echo(kind(context.find_root().command, {}, "ual", "_UAL_COMPLETE").source())


COMMANDS = (completion,)
