"""Commands that are imported when they are used: `ual takeoff` needs neither missions nor certificates."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, MutableMapping
from typing import Any

import click
from typing_extensions import override

from ual_tools.app import UalGroup
from ual_tools.help import ListedCommand, write_commands


class LazyGroup(UalGroup):
    """A group of commands that are imported when they are used. Its help lists them in sections."""

    def __init__(self, *args: Any, listed: Mapping[str, ListedCommand], **kwargs: Any) -> None:  # noqa: ANN401 (click's)
        super().__init__(*args, **kwargs)
        self.commands: MutableMapping[str, click.Command] = _LazyCommands(listed)
        self._listed = listed

    @override
    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_commands(formatter, self._listed)


class _LazyCommands(MutableMapping[str, click.Command]):
    """Commands by name. Reading one imports its module; reading the names does not."""

    def __init__(self, listed: Mapping[str, ListedCommand]) -> None:
        self._listed = listed
        self._imported: dict[str, click.Command] = {}

    @override
    def __getitem__(self, name: str) -> click.Command:
        if name not in self._imported:
            module = importlib.import_module(self._listed[name].module)
            self._imported.update((each.name, each) for each in module.COMMANDS)
        return self._imported[name]

    @override
    def __setitem__(self, name: str, command: click.Command) -> None:
        self._imported[name] = command

    @override
    def __delitem__(self, name: str) -> None:
        del self._imported[name]

    @override
    def __iter__(self) -> Iterator[str]:
        return iter(self._listed)

    @override
    def __len__(self) -> int:
        return len(self._listed)
