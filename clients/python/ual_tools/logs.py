"""`ual logs`: the logs that the autopilot has written."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual.errors import (
    DaemonUnreachableError,
    InvalidArgumentError,
    LinkLostError,
    RejectedByAutopilotError,
    UalTimeoutError,
)
from ual.logs import Log, fetch, file_name
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session
from ual_tools.tables import print_table
from ual_tools.values import Number

if TYPE_CHECKING:
    from ual import Uav

_FILE = click.Path(path_type=Path, dir_okay=False)
_DOWNLOAD_RETRY_S = 1.0
_BROKEN = (DaemonUnreachableError, LinkLostError, UalTimeoutError)
"""After these a download goes on by itself."""


@click.group(
    "logs",
    cls=UalGroup,
    section=Section.AUTOPILOT,
    examples=("ual logs list", "ual logs fetch --last", "ual logs fetch 2026-11-25/13_22_11.ulg -o flight.ulg"),
)
def logs() -> None:
    """List and download the logs that the autopilot has written."""


@logs.command("list", cls=UalCommand, examples=("ual logs list",))
@pass_session
def list_logs(session: CommandSession) -> None:
    """List the logs, the oldest first."""
    with session.connect() as uav:
        found = uav.logs.get_all()
    if session.as_json:
        for each in found:
            session.emit(each)
    elif found:
        print_table(
            ("log", "MB", "written (UTC)"),
            [
                (each.id, "not listed" if each.is_missing else f"{each.size_bytes / 1e6:.2f}", _written(each))
                for each in found
            ],
        )
    else:
        click.echo("the autopilot has no logs")


@logs.command("fetch", cls=UalCommand, examples=("ual logs fetch --last", "ual logs fetch 7 -o flight.bin"))
@click.argument("log_id", metavar="[ID]", required=False)
@click.option("--last", is_flag=True, help="The newest one.")
@click.option("-o", "--output", "file", type=_FILE, metavar="FILE", help="Where to; named after the log otherwise.")
@click.option(
    "--patience",
    "patience_s",
    type=Number(min=0.0),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Go on after a broken link, unless nothing has come for so long.",
)
@pass_session
def fetch_log(session: CommandSession, log_id: str | None, last: bool, file: Path | None, patience_s: float) -> None:
    """Download the log ID, as `logs list` shows it, or the newest one.

    It grows as FILE.part. After a broken link it goes on. If this command ends before, the next one for the same log
    goes on with FILE.part.
    """
    if (log_id is None) is not last:
        raise click.UsageError("say which log: its ID or --last")
    with session.connect() as uav:
        log, doubt = _chosen(uav, log_id)
        if doubt:
            session.tell(doubt)
        target = Path(file_name(log, uav.ns)) if file is None else file
        with _shown(log) as show:
            sha256 = _patiently(uav, log, target, show, patience_s)
    values = {"log": log.id, "file": str(target), "size_bytes": log.size_bytes, "sha256": sha256}
    session.emit_written(values, f"{target}: {log.size_bytes} bytes, SHA-256 {sha256}")


def _chosen(uav: Uav, log_id: str | None) -> tuple[Log, str]:
    """Returns a log, and why it may not be the newest one; empty where it is, or was named."""
    found = uav.logs.get_all()
    if not found:
        raise InvalidArgumentError("the autopilot has no logs", {"field": "log_id"})
    missing = [each.id for each in found if each.is_missing]
    if log_id is None and missing:
        text = (
            f"the autopilot does not describe these logs, so it is not known which is the newest: {', '.join(missing)}"
        )
        raise RejectedByAutopilotError(f"{text}; try again, or name one", {"field": "log_id"})
    log = found[-1] if log_id is None else next((each for each in found if each.id == log_id), None)
    if log is None:
        raise InvalidArgumentError(
            f"the autopilot has no log {log_id}; `ual logs list` shows them", {"field": "log_id"}
        )
    return log, doubt_of_last(log, found) if log_id is None else ""


def doubt_of_last(log: Log, found: Sequence[Log]) -> str:
    """Returns why a log that was taken for the newest of those that were found may not be it; empty where it is."""
    untimed = [each.id for each in found if each.time_s is None and each is not log]
    if len(found) == 1 or (log.time_s is not None and not untimed):
        return ""
    if log.time_s is None:
        return f"the autopilot does not say when its logs were written: {log.id} is taken for the newest"
    return f"{log.id} is the newest that has a time; when these were written is not known: {', '.join(untimed)}"


def _patiently(uav: Uav, log: Log, file: Path, show: Callable[[int, int], None], patience_s: float) -> str:
    """Downloads, and goes on after a broken link as long as something comes."""
    newest_s = time.monotonic()

    def on_progress(done: int, size: int) -> None:
        nonlocal newest_s
        newest_s = time.monotonic()
        show(done, size)

    while True:
        try:
            return fetch(uav.logs, log, file, on_progress)
        except _BROKEN as error:
            if time.monotonic() - newest_s > patience_s:
                text = f"{error.message}; what has come is in {file}.part: the same command goes on"
                raise type(error)(text, error.metadata) from None
            time.sleep(_DOWNLOAD_RETRY_S)


@contextmanager
def _shown(log: Log) -> Iterator[Callable[[int, int], None]]:
    """Shows the progress during the block, on stderr if that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda _done, _size: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn, TransferSpeedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        shown = bar.add_task(log.id, total=log.size_bytes)
        yield lambda done, _size: bar.update(shown, completed=done)


def _written(log: Log) -> str:
    return "" if log.time_s is None else time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(log.time_s))


COMMANDS = (logs,)
