"""Runs one program of a team: starts it when it may, says when it is ready, and starts it again when it has died."""

from __future__ import annotations

import asyncio
import signal
import time

from ual.shared.waiting import ends_within
from ual.types import State
from ual_tools.launch.flying import Watched
from ual_tools.launch.log import TeamLog
from ual_tools.launch.process import TeamProcess
from ual_tools.launch.ready import address_of, until_ready
from ual_tools.launch.team import Program, ReadyCondition, Restart

_PAUSES_S = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Before each new start. A daemon that dies in flight is missed at once; one that dies repeatedly is given up."""
_STABLE_RUN_S = 60.0
"""Seconds of running after which a program begins with the first pause again."""
_CONFIG_STATUS = 2


class Supervisor:
    """Keeps one program running until it is stopped, or has ended for good. `run` may be called once.

    Attributes:
        ready: Set when it was ready for the first time.
        failure: Why it has ended, if that was not well; else empty.
        has_ended: Whether it has ended for good.

    """

    def __init__(self, program: Program, log: TeamLog) -> None:
        self.program = program
        self.ready = asyncio.Event()
        self.failure = ""
        self.has_ended = False
        self.uav = Watched(program.ns, self._on_state) if program.is_daemon else None
        self.address: str | None = None
        self._log = log
        self._process: TeamProcess | None = None
        self._is_stopping = False
        self._stopping = asyncio.Event()
        self._starting = asyncio.Lock()
        """Held while a process is started: what is stopped then is stopped, too."""

    @property
    def pid(self) -> int | None:
        """The process id of the program while it runs."""
        return self._process.pid if self._process is not None and self._process.status is None else None

    async def run(self) -> None:
        """Starts the program, and starts it again as its file says; returns when it has ended for good."""
        try:
            await self._keep_running()
        finally:
            self.has_ended = True

    async def _keep_running(self) -> None:
        restarts = 0
        while not self._is_stopping:
            begun_s = time.monotonic()
            status = await self._once()
            if self._is_stopping or not self._is_restarted(status):
                return
            restarts = 0 if time.monotonic() - begun_s > _STABLE_RUN_S else restarts
            if restarts == len(_PAUSES_S):
                self.failure = f"it has ended {restarts + 1} times: given up"
                self._show("given up")
                return
            await self._pause(_PAUSES_S[restarts])
            restarts += 1

    async def stop(self) -> None:
        """Ends the program. It is not started again."""
        self._is_stopping = True
        self._stopping.set()
        async with self._starting:
            process = self._process
        if process is not None and process.status is None:
            self._show("ending")
            await process.stop()
            self._show(f"ended ({_text(process.status)})")
            if self.program.is_daemon and process.status:
                self.failure = f"ended ({_text(process.status)})"  # 3: it had to leave its UAV in motion
                self._log.note(f"{self.program.name}: {self.failure}", is_bad=True)

    def kill(self) -> None:
        """Kills the program. It is not started again."""
        self._is_stopping = True
        self._stopping.set()
        if self._process is not None:
            self._process.signal(signal.SIGKILL)

    async def _once(self) -> int | None:
        """Runs the program once. Returns its exit status; None if it could not be started."""
        try:
            async with self._starting:
                if self._is_stopping:
                    return None
                self._process = process = await TeamProcess.start(self.program, self._log)
        except OSError as error:
            self.failure = f"cannot be started: {error}"
            self._show("cannot start")
            return None
        self.failure = ""
        self._show("starting")
        following = asyncio.create_task(self._follow(process))
        status = await process.wait()
        following.cancel()
        await asyncio.wait((following,))
        process.signal(signal.SIGKILL)  # what it has left behind: a program that is started again needs its ports
        self.address = None
        self._judge(process, status)
        return status

    def _judge(self, process: TeamProcess, status: int) -> None:
        if self._is_stopping:
            return
        if process.watch.seen.is_set():
            self.ready.set()  # it has ended at once
        self._show(f"ended ({_text(status)})")
        is_done = status == 0 and self.program.ready.condition is ReadyCondition.EXIT
        if is_done:
            self.ready.set()
        is_bad = status != 0 or not self.ready.is_set()
        self.failure = f"ended ({_text(status)})" if is_bad else ""
        if is_bad and not self.ready.is_set():
            self.failure += " before it was ready"
        self._log.note(f"{self.program.name}: {self.failure or ('ready' if is_done else 'has ended')}", is_bad=is_bad)

    def _is_restarted(self, status: int | None) -> bool:
        if status is None or not self.ready.is_set() or (self.program.is_daemon and status == _CONFIG_STATUS):
            return False
        if status == 0:
            return self.program.restart is Restart.ALWAYS and self.program.ready.condition is not ReadyCondition.EXIT
        return self.program.restart is not Restart.NO

    async def _pause(self, pause_s: float) -> None:
        self._log.note(f"{self.program.name}: starts again" + (f" in {pause_s:g} s" if pause_s else ""))
        await ends_within(self._stopping.wait(), pause_s)

    async def _follow(self, process: TeamProcess) -> None:
        """Says when it is ready, and follows the UAV of a daemon."""
        following = asyncio.create_task(self._follow_uav(process))
        try:
            await self._until_ready(process)
            await following
        finally:
            following.cancel()
            await asyncio.wait((following,))

    async def _until_ready(self, process: TeamProcess) -> None:
        limit_s = self.program.ready_limit_s
        if not await ends_within(until_ready(self.program, process.pid, process.watch), limit_s):
            self._log.note(f"{self.program.name}: not ready after {limit_s:g} s, ended", is_bad=True)
            await process.stop()
            return
        self.ready.set()
        self._log.note(f"{self.program.name}: ready")
        if self.uav is None:
            self._show("ready")

    async def _follow_uav(self, process: TeamProcess) -> None:
        if self.uav is None:
            return
        self.address = await address_of(self.program.ns, process.pid)
        await self.uav.follow(self.address)

    def _on_state(self, state: State) -> None:
        self._show(state.name)  # the daemon's own line in the log has the reason

    def _show(self, state: str) -> None:
        self._log.state(self.program.name, state)


def _text(status: int | None) -> str:
    if status is not None and status < 0:
        return f"killed by {signal.Signals(-status).name}"
    return f"exit status {status}"
