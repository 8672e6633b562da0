"""Runs a team from its first program to its last: in order and when ready, and to its end in the reverse order."""

from __future__ import annotations

import asyncio
import math
import os
import signal
from collections.abc import Callable, Collection, Coroutine
from typing import Any

from ual_tools.launch import descendants
from ual_tools.launch.flying import IN_THE_AIR, abort, land
from ual_tools.launch.log import TeamLog
from ual_tools.launch.supervisor import Supervisor
from ual_tools.launch.team import AtEnd, Team

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
ONE_PRESS_S = 0.3
"""Signals that come closer than this are of one press of Ctrl-C."""
_POLL_PERIOD_S = 0.05
_KILL_AFTER_S = 2.0


async def run(team: Team, log: TeamLog) -> bool:
    """Runs a team until a signal comes, or one of its programs ends it. Returns whether all went well."""
    descendants.adopt_orphans()
    return await _TeamRun(team, log).run()


class Presses:
    """Counts the times that a user has pressed Ctrl-C.

    One press may come as two signals: to the whole group of processes, and again by the program that started this one
    (`ros2 launch` without a terminal, systemd). The second must not end a landing.
    """

    def __init__(self, call: Callable[[int], None], clock: Callable[[], float]) -> None:
        self._call = call
        self._clock = clock
        self._count = 0
        self._counted_s = -math.inf

    def __call__(self) -> None:
        """Takes a signal."""
        now_s = self._clock()
        if now_s - self._counted_s > ONE_PRESS_S:  # not since the last one: repeated presses must have an effect
            self._counted_s = now_s
            self._count += 1
            self._call(self._count)


class _TeamRun:
    def __init__(self, team: Team, log: TeamLog) -> None:
        self._team = team
        self._log = log
        self._all = {each.name: Supervisor(each, log) for each in team.programs}
        self._ending = asyncio.Event()
        self._hurrying = asyncio.Event()
        self._is_good = True

    async def run(self) -> bool:
        _on_signals(self._on_signal)
        running = [asyncio.create_task(self._one(each)) for each in self._all.values()]
        for each in running:
            each.add_done_callback(self._end_by_defect)
        saying = asyncio.create_task(self._say_when_ready())
        await self._ending.wait()
        await self._end()
        for task in (saying, *running):
            task.cancel()
        await asyncio.wait((saying, *running))
        await self._end_descendants()
        return self._is_good

    async def _one(self, one: Supervisor) -> None:
        """Runs one program from when all that it needs is ready."""
        for name in one.program.needs:
            await self._all[name].ready.wait()
        if self._ending.is_set():
            return
        await one.run()
        descendants.reap({each.pid for each in self._all.values() if each.pid is not None})
        if not self._ending.is_set() and (one.program.is_ending_team or not one.ready.is_set()):
            self._end_because(one)

    def _end_by_defect(self, task: asyncio.Task[None]) -> None:
        if self._note_defect(task):
            self._ending.set()

    def _note_defect(self, task: asyncio.Future[None]) -> bool:
        """Notes that something of `ual launch` itself has failed. The team is ended in order all the same."""
        if task.cancelled() or (defect := task.exception()) is None:
            return False
        self._log.note(f"a defect of ual launch: {defect!r}", is_bad=True)
        self._is_good = False
        return True

    def _end_because(self, one: Supervisor) -> None:
        why = one.failure or "has ended"
        self._log.note(f"the team ends, because of {one.program.name}: {why}", is_bad=bool(one.failure))
        self._is_good &= not one.failure
        self._ending.set()

    async def _say_when_ready(self) -> None:
        for one in self._all.values():
            await one.ready.wait()
        self._log.note("all are ready; Ctrl-C ends the team")

    def _on_signal(self, count: int) -> None:
        if count == 1 and not self._ending.is_set():
            self._log.note("ends (Ctrl-C again: hold, and end at once)")
            self._ending.set()
        elif not self._hurrying.is_set():
            self._log.note("holds, and ends at once (Ctrl-C again: kill)", is_bad=True)
            self._hurrying.set()
        else:
            self._log.note("kills all programs", is_bad=True)
            self._is_good = False
            for each in self._all.values():
                each.kill()

    async def _end(self) -> None:
        await self._unless_hurried(
            self._stop({name for name, each in self._all.items() if each.program.is_ended_first})
        )
        if self._team.at_end is AtEnd.LAND:
            await self._unless_hurried(self._land())
        if self._hurrying.is_set():
            await self._for_each_flying(self._abort)
        await self._stop(set(self._all))
        self._is_good &= not any(each.failure for each in self._all.values() if each.program.is_daemon)

    async def _unless_hurried(self, work: Coroutine[Any, Any, None]) -> None:
        working, hurrying = asyncio.ensure_future(work), asyncio.create_task(self._hurrying.wait())
        await asyncio.wait((working, hurrying), return_when=asyncio.FIRST_COMPLETED)
        for task in (working, hurrying):
            task.cancel()
        await asyncio.wait((working, hurrying))
        self._note_defect(working)

    async def _land(self) -> None:
        await self._for_each_flying(self._land_one)
        for uav in (each.uav for each in self._all.values()):
            if uav is not None and uav.state in IN_THE_AIR and not uav.is_in_control:
                self._log.note(f"{uav.ns}: left as it is, {uav.state.name}: UAL does not fly it", is_bad=True)

    async def _for_each_flying(self, work: Callable[[Supervisor], Coroutine[Any, Any, None]]) -> None:
        await asyncio.gather(
            *(each.uav.sample_now(each.address) for each in self._all.values() if each.uav and each.address)
        )
        flying = [each for each in self._all.values() if each.uav is not None and each.uav.is_in_control]
        await asyncio.gather(*(work(each) for each in flying))

    async def _land_one(self, one: Supervisor) -> None:
        assert one.uav is not None
        if one.has_ended:
            self._is_good = False
            self._log.note(f"{one.program.name}: cannot land: its daemon has ended", is_bad=True)
            return
        self._log.note(f"{one.program.name}: lands")
        why = await land(one.uav, lambda: one.address, self._team.land_limit_s)
        if why is not None:
            self._is_good = False
        self._log.note(
            f"{one.program.name}: {'stands' if why is None else f'did not land: {why}'}", is_bad=why is not None
        )

    async def _abort(self, one: Supervisor) -> None:
        if one.address is None:
            return
        why = await abort(one.program.ns, one.address)
        self._log.note(
            f"{one.program.name}: {'holds' if why is None else f'does not hold: {why}'}", is_bad=why is not None
        )

    async def _stop(self, names: Collection[str]) -> None:
        """Ends programs, each once all that need it have ended."""
        stopped = {name: asyncio.Event() for name in names}

        async def stop(one: Supervisor) -> None:
            for other in self._all.values():
                if one.program.name in other.program.needs and other.program.name in stopped:
                    await stopped[other.program.name].wait()
            await one.stop()
            stopped[one.program.name].set()

        await asyncio.gather(*(stop(self._all[name]) for name in names))

    async def _end_descendants(self) -> None:
        """Ends what has left the process group of its program."""
        loop = asyncio.get_running_loop()
        begun_s, number = loop.time(), signal.SIGTERM
        requested: set[int] = set()
        while left := descendants.all_below():
            for pid in left - requested:
                self._log.note(f"process {pid} was left behind: {number.name}")
                _kill(pid, number)
            requested |= left
            if number is signal.SIGTERM and loop.time() - begun_s > _KILL_AFTER_S:
                number, requested = signal.SIGKILL, set()
            await asyncio.sleep(_POLL_PERIOD_S)
            descendants.reap(())


def _kill(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def _on_signals(call: Callable[[int], None]) -> None:
    """Calls back with the number of signals that have come. A signal that is ignored (nohup) stays so."""
    loop = asyncio.get_running_loop()
    on_signal = Presses(call, loop.time)
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, on_signal)
