"""Gives one command to several UAVs at the same moment, each on a thread of its own."""

from __future__ import annotations

import dataclasses
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from ual.discovery import natural_order
from ual.errors import DaemonUnreachableError, UalError
from ual_tools.session import INTERRUPTED_STATUS, REFUSED_STATUS, CommandSession
from ual_tools.start import CommandMember, Gate
from ual_tools.streams import OutputKind, OutputLostError, give_up_output, write

if TYPE_CHECKING:
    from ual_tools.condition import UavCondition

_JOIN_POLL_S = 0.2
_STOP_TIMEOUT_S = 2.0
_PLACE = "{ns}"


def names(session: CommandSession) -> list[str] | None:
    """Returns the UAVs that were chosen, if they are several or may be; None for a single one."""
    if session.is_all and session.ns:
        raise click.UsageError("--all is all UAVs: leave out --ns (UAL_NS)")
    if session.is_all and session.address:
        text = "an address does not tell which UAVs are behind it: leave out --address (UAL_ADDRESS) for those of this"
        raise click.UsageError(f"--all: {text} computer, or name those of a gateway: --ns uav_1,uav_2")
    if session.is_all:
        found = [daemon.ns for daemon in session.daemons()]
        if not found:
            raise DaemonUnreachableError(f"no daemon {session.where}: start one with `ual-daemon`")
        return found
    if session.member is not None or session.ns is None or "," not in session.ns:
        return None
    found = [name.strip() for name in session.ns.split(",")]
    if len(set(found)) < len(found) or not all(found):
        raise click.UsageError(f"--ns: {session.ns}: name each UAV once, separated by commas")
    return found


def invoke(
    context: click.Context,
    uavs: Sequence[str],
    command: Callable[[click.Context], Any],
    *,
    needs_all: bool,
    is_looking: bool = False,
) -> None:
    """Runs a command for each UAV: for none, if it `needs_all` and one of them cannot be reached.

    One that `is_looking` has its results printed once all are there: the worst UAV first, and at the end how many there
    are of each state.

    Ends the program with 1 where one refused or failed, with 130 after Ctrl-C.
    """
    session: CommandSession = context.find_root().obj
    gate = Gate(len(uavs), session.begin_utc_s, needs_all=needs_all, tell=session.tell)
    runs = [
        _UavRun(context, dataclasses.replace(session, ns=name, is_all=False), name, gate, command)
        for name in sorted(uavs, key=natural_order)
    ]
    for run in runs:
        run.thread.start()
    try:
        if is_looking:
            _print_worst_first(runs, session)
        for run in runs:
            _print_until_done(run)
    except KeyboardInterrupt:
        gate.close()
        _stop(runs)
        for run in runs:
            run.print_output()
        context.exit(INTERRUPTED_STATUS)
    for run in runs:
        if run.defect is not None:
            raise run.defect
    context.exit(max(run.status for run in runs))


def _print_until_done(run: _UavRun) -> None:
    """Prints what the command of one UAV prints. The others' lines wait: results come in the order of the names."""
    while run.thread.is_alive():
        run.thread.join(_JOIN_POLL_S)
        run.print_output()
    run.print_output()


def _print_worst_first(runs: Sequence[_UavRun], session: CommandSession) -> None:
    from ual_tools import condition

    for run in runs:
        while run.thread.is_alive():
            run.thread.join(_JOIN_POLL_S)
    for run in condition.worst_first(runs, lambda each: each.condition, lambda each: each.name):
        run.print_output()
    if sys.stdout.isatty() and not session.as_json:
        write(f"{len(runs)} UAVs: {condition.summary(run.condition for run in runs)}", OutputKind.RESULT)


def _stop(runs: Sequence[_UavRun]) -> None:
    """Stops all at once; what each of them does then is reported by its own line."""
    stopping = [threading.Thread(target=run.stop, daemon=True) for run in runs if run.thread.is_alive()]
    for thread in stopping:
        thread.start()
    for thread in stopping:
        thread.join(_STOP_TIMEOUT_S)
    for run in runs:
        run.thread.join(_JOIN_POLL_S)


class _UavRun:
    """The command for one UAV."""

    def __init__(
        self,
        context: click.Context,
        session: CommandSession,
        name: str,
        gate: Gate,
        command: Callable[[click.Context], Any],
    ) -> None:
        self.status = 0
        self.defect: BaseException | None = None
        self._member = session.member = CommandMember(name, gate)
        self._session = session
        self._context = _context(context, session)
        self._command = command
        self.thread = threading.Thread(target=self._run, name=f"ual for {name}", daemon=True)

    @property
    def name(self) -> str:
        """Name of the UAV of this run."""
        return self._member.name

    @property
    def condition(self) -> UavCondition:
        """Condition of the UAV, as its command found it."""
        from ual_tools.condition import UavCondition, Urgency

        return self._member.condition or UavCondition(Urgency.ALARM, "not known")

    def print_output(self) -> None:
        """Prints what its command has printed since."""
        while not self._member.lines.empty():
            try:
                write(*self._member.lines.get())
            except OutputLostError as error:  # the others fly on
                self._session.note(f"ual: the result cannot be printed: {error}")
                give_up_output()
                self.status = REFUSED_STATUS

    def stop(self) -> None:
        """Stops what the command has begun."""
        try:
            self._member.stop()
        except UalError as error:
            self._session.fail(error)

    def _run(self) -> None:
        try:
            with self._context:
                self._command(self._context)
        except UalError as error:
            self.status = REFUSED_STATUS
            self._session.fail(error)
        except click.exceptions.Exit as end:
            self.status = end.exit_code
        except BaseException as error:  # noqa: BLE001 (raised by the main thread)
            self.defect = error
        finally:
            self._member.leave()


def _context(context: click.Context, session: CommandSession) -> click.Context:
    """Returns the command's context for one UAV: with its own session, and its name in the frame."""
    if context.params.get("plot") is not None:
        raise click.UsageError("--plot draws one UAV: name it by --ns", context)
    root = context.find_root()
    own = click.Context(context.command, info_name=context.info_name, parent=click.Context(root.command, obj=session))
    own.params = {**context.params}
    if frame_id := own.params.get("frame_id"):
        if _PLACE not in frame_id:
            text = f"--frame {frame_id} leads all of them to one place; write {_PLACE}/base_link for that of each"
            raise click.UsageError(text, context)
        own.params["frame_id"] = frame_id.replace(_PLACE, session.ns or "")
    return own
