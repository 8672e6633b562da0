"""Actions: goals that fly on the event loop, with feedback and cancel."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Protocol

from diagnostic_msgs.msg import KeyValue
from rclpy.action import ActionServer, CancelResponse

import ual
from ual_ros2 import contact, outcome, values
from ual_ros2.command import ActionCommand
from ual_ros2.messages import Entity, Message
from ual_ros2.outcome import Before, CommandOutcome, CommandRun

CANCELLED_BY = "the ROS client"


class GoalPilot(Protocol):
    """Pilot of the goals of one UAV."""

    @property
    def newest(self) -> ual.Telemetry | None:
        """The newest sample."""
        ...

    @property
    def has_safety_pilot(self) -> bool:
        """Whether take-offs and landings are left to a safety pilot to abort."""
        ...

    def begin_command(self, command: ActionCommand, request: Message) -> CommandRun:
        """Begins to fly a goal."""
        ...

    async def abort(self) -> None:
        """Ends what flies."""
        ...

    async def running_id(self) -> str:
        """Asks the daemon which task runs; empty: none."""
        ...


class ActionGoals:
    """One action of one UAV."""

    def __init__(
        self,
        node: Entity,
        loop: asyncio.AbstractEventLoop,
        name: str,
        action: ActionCommand,
        pilot: GoalPilot,
        feedback_rate_hz: float,
    ) -> None:
        self._loop = loop
        self._action = action
        self._pilot = pilot
        self._feedback_s = 1.0 / feedback_rate_hz
        self._flying: dict[bytes, CommandRun] = {}
        self._server = _LoopActionServer(loop, node, action.kind, name, self._fly, cancel_callback=self._on_cancel)

    def destroy(self) -> None:
        """Ends the action."""
        self._server.destroy()

    def _on_cancel(self, goal_handle: Entity) -> CancelResponse:
        """Runs on the executor's thread. The flight ends at once, before ROS has noted that it is asked for."""
        if self._goes_on_without_caller(goal_handle) and self._pilot.has_safety_pilot:
            return CancelResponse.REJECT
        asyncio.run_coroutine_threadsafe(self._cancel(goal_handle), self._loop)
        return CancelResponse.ACCEPT

    def _goes_on_without_caller(self, goal_handle: Entity) -> bool:
        """Returns whether it takes off or lands. A goal that only asks does not, whatever flies meanwhile."""
        newest = self._pilot.newest
        if not self._action.flies(goal_handle.request):
            return False
        return not self._action.can_be_cancelled or (newest is not None and newest.state is ual.State.LANDING)

    async def _cancel(self, goal_handle: Entity) -> None:
        """A task of the loop, as the flight is: so it begins after the flight, however busy the loop is."""
        flying = self._flying.get(_key(goal_handle))
        if flying is not None and self._goes_on_without_caller(goal_handle):
            await flying.abort(CANCELLED_BY, self._pilot.abort)
        elif flying is not None:
            flying.cancel(CANCELLED_BY)

    async def _fly(self, goal_handle: Entity) -> Message:
        flying = self._pilot.begin_command(self._action, goal_handle.request)
        self._flying[_key(goal_handle)] = flying
        try:
            task_id = await self._give_feedback(goal_handle, flying)
        finally:
            flying.cancel("the node failed")  # of one that has ended, this does nothing
            del self._flying[_key(goal_handle)]
        ended = flying.task.result()
        if flying.before is not None and _is_cancelled(ended):  # else nothing was sent
            ended = await contact.confirmed(ended, self._pilot.running_id, task_id, flying.before.task_id)
        result = await self._end(goal_handle, ended)
        if self._action.is_task:
            result.task_id = result.task_id or task_id
        return result

    async def _give_feedback(self, goal_handle: Entity, flying: CommandRun) -> str:
        """Publishes how the task stands until it has ended; returns its identifier, which is empty where none was seen.

        A task that ran before the goal was sent is not its own, nor is one that has replaced it.
        """
        feedback, own_id = self._action.kind.Feedback(), ""
        while not flying.task.done():
            await asyncio.wait((flying.task,), timeout=self._feedback_s)
            is_known = True
            if self._action.is_task:
                own_id, is_known = self._fill(feedback, flying.before, own_id)
            if is_known and self._action.also(feedback, goal_handle.request):
                goal_handle.publish_feedback(feedback)
        return own_id

    def _fill(self, feedback: Message, before: Before | None, own_id: str) -> tuple[str, bool]:
        """Returns the identifier of the goal's own task, and whether it is that which runs."""
        sample = self._pilot.newest
        task = None if before is None else before.later_task(sample)
        if sample is None or task is None:
            return own_id, False
        own_id = own_id or task.id
        if task.id == own_id:
            values.fill_feedback(feedback, sample, task)
        return own_id, task.id == own_id

    async def _end(self, goal_handle: Entity, ended: CommandOutcome) -> Message:
        if ended.is_success:
            goal_handle.succeed()
        elif _is_cancelled(ended) and await _is_canceling(goal_handle):
            goal_handle.canceled()
        else:
            goal_handle.abort()
        return outcome.fill(self._action.kind.Result(), ended, KeyValue)


class _LoopActionServer(ActionServer):
    """An action server whose goals are coroutines of the event loop.

    rclpy would resume them on its executor again and again until they end, which costs a whole core.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        node: Entity,
        kind: Entity,
        name: str,
        fly: Callable[[Entity], Awaitable[Message]],
        *,
        cancel_callback: Callable[[Entity], CancelResponse],
    ) -> None:
        self._event_loop = loop
        super().__init__(node, kind, name, fly, cancel_callback=cancel_callback)

    def notify_execute(self, goal_handle: Entity, execute_callback: Entity) -> None:
        """Begins to execute an accepted goal."""
        coroutine = self._execute_goal(execute_callback or self._execute_callback, goal_handle)
        asyncio.run_coroutine_threadsafe(coroutine, self._event_loop)


async def _is_canceling(goal_handle: Entity) -> bool:
    """Waits until ROS has noted that the goal is to be cancelled; it does so right after the callback."""
    for _ in range(200):
        if goal_handle.is_cancel_requested:
            return True
        await asyncio.sleep(0.005)
    return False


def _is_cancelled(ended: CommandOutcome) -> bool:
    return ended.reason == "TASK_ABORTED" and ended.metadata.get("by") == CANCELLED_BY


def _key(goal_handle: Entity) -> bytes:
    return bytes(goal_handle.goal_id.uuid)
