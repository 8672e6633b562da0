"""Prints tables: with lines on a terminal, as plain columns into a pipe."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], styles: Sequence[str] = ()) -> None:
    """Prints rows under a header, each in its style (of rich), if one is given for each.

    Into a pipe it prints columns separated by tabs, without the header.
    """
    if not sys.stdout.isatty():
        for row in rows:
            click.echo("\t".join(row))
        return
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, header_style="bold")
    for column in header:
        table.add_column(column, overflow="fold")  # on a narrow terminal nothing is cut: LANDED_… may be either
    for row, style in zip(rows, styles or [""] * len(rows), strict=True):
        table.add_row(*map(Text, row), style=style)
    Console().print(table)
