"""One UAV in ROS: its topics, services and actions, and the client behind them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from std_srvs.srv import Empty, Trigger

import ual
from ual.shared.ages import without_seconds
from ual_ros2 import outcome, senders, topics, values
from ual_ros2.about import About
from ual_ros2.cameras import RosCameras
from ual_ros2.command import ActionCommand, RosCommand
from ual_ros2.contact import DaemonContact
from ual_ros2.flights import ACTIONS, SERVICES
from ual_ros2.frames import Frames, Tf
from ual_ros2.goals import ActionGoals
from ual_ros2.health import ConnectionReport
from ual_ros2.late_service import LateService
from ual_ros2.lateness import BEAT_S, COMMAND_S, SETPOINT_S, LatenessCheck, ProgramPulse, steady_s
from ual_ros2.listener import TopicListener
from ual_ros2.messages import Entity, Message
from ual_ros2.outcome import Before, CommandOutcome, CommandRun
from ual_ros2.ros_time import RosTime
from ual_ros2.services.uav_services import UavServices
from ual_ros2.setpoints import Newest, Setpoint, TopicValue, send_value
from ual_ros2.settings import NodeSettings

_log = logging.getLogger(__name__)

RETRY_S = 0.5
SILENT_S = 1.0
"""Without a sample for this long (or three of them), the UAV is told to be unknown."""
STAMPED = ("set_pose", "set_velocity")
"""The setpoints that say in their header for when they are."""
CLOCK_STANDS = "simulated time stands (use_sim_time): nothing new comes on /clock, and stamps are of then"
REFUSED_S = 5.0
"""Seconds for which a refused setpoint stands in the diagnostics."""


@dataclass(frozen=True)
class Shared:
    """State that all UAVs of a node share."""

    node: Entity
    loop: asyncio.AbstractEventLoop
    settings: NodeSettings
    time: RosTime
    tf: Tf
    listener: TopicListener


class UavInterface:
    """One UAV in ROS. Its entities live from construction to `destroy`; it flies and tells between `begin` and `end`.

    ROS' executor constructs and destroys it, and calls what has to do with its entities; all else runs on the event
    loop.
    """

    def __init__(self, shared: Shared, ns: str, address: str) -> None:
        self._shared = shared
        self._ns = ns
        self._loop = shared.loop
        settings = shared.settings
        self._uav = ual.aio.Uav(
            ns, address=address or None, tls_ca=settings.tls_ca, credentials=settings.credentials, network=""
        )
        self._said = ConnectionReport()
        self._lateness = LatenessCheck(settings.refuses_late, is_time_simulated=lambda: shared.time.is_simulated)
        self._pulse = ProgramPulse()
        self._newest: ual.Telemetry | None = None
        self._contact = DaemonContact(self._uav.telemetry, settings.rate_hz, steady_s)
        self._refused_s = 0.0
        self._samples: ual.aio.Subscription | None = None
        self._refusal: ual.UalError | None = None
        """Why the daemon gives no samples at all."""
        self._trouble = ""
        """Why nothing is known of it, while that is so: it is in the log once."""
        self._is_active = False
        self._has_safety_pilot = True
        self._lease: ual.aio.Lease | None = None
        self._not_leased: ual.UalError | None = None
        self._watching: list[asyncio.Task[None]] = []
        self._commands: set[CommandRun] = set()
        self._topics = topics.Topics(shared.node, ns, shared.time, shared.tf.moving)
        self._frames = Frames(self._uav, ns, shared.tf)
        self._cameras = RosCameras(
            shared.node, self._uav, ns, shared.time, shared.tf.publish_moving, settings.camera_rate_hz
        )
        self._about = About(shared.node, self._loop, self._uav, ns, shared.time)
        sending = partial(send_value, self._uav, self)
        self._setpoints: Newest[TopicValue] = Newest(self._loop, sending, self._on_refusal)
        self._external_poses: Newest[TopicValue] = Newest(self._loop, sending, self._on_refusal)
        self._uav_services = UavServices(shared.node, self._loop, settings, shared.time, self._uav, ns, self._serve)
        self._make_inputs()

    # --- For the node: on ROS' executor -------------------------------------------------------------------------------

    def _make_inputs(self) -> None:
        node, prefix = self._shared.node, f"/{self._ns}/ual"
        self._subscriptions = [
            self._subscribe(PoseStamped, "set_pose", self._on_pose),
            self._subscribe(TwistStamped, "set_velocity", self._on_velocity),
            self._subscribe(TwistStamped, "cmd_vel", self._on_stamped_body_velocity)
            if self._shared.settings.has_stamped_cmd_vel
            else self._subscribe(Twist, "cmd_vel", self._on_body_velocity),
            self._subscribe(PoseStamped, "external_pose", self._on_external_pose),
            self._subscribe(PoseWithCovarianceStamped, "external_pose_cov", self._on_external_pose_with_covariance),
        ]
        self._services = [
            LateService(node, each.kind, f"{prefix}/{each.name}", partial(self._serve, each)) for each in SERVICES
        ]
        rate_hz = self._shared.settings.feedback_rate_hz
        self._goals = [
            ActionGoals(node, self._loop, f"{prefix}/{each.name}", each, self, rate_hz)
            for each in (*ACTIONS, *self._uav_services.actions)
        ]

    def _subscribe(self, kind: Entity, name: str, callback: Entity) -> Entity:
        return self._shared.listener.subscribe(
            kind,
            f"/{self._ns}/ual/{name}",
            callback=partial(self._on_input, name, callback),
            **topics.overridable(topics.NEWEST),
        )

    def destroy(self) -> None:
        """Ends its topics, services and actions. The connection ends by `close`."""
        node = self._shared.node
        for goals in self._goals:
            goals.destroy()
        for service in self._services:
            node.destroy_service(service.entity)
        for subscription in self._subscriptions:
            self._shared.listener.unsubscribe(subscription)
        self._topics.destroy()
        self._cameras.destroy()
        self._about.destroy()
        self._uav_services.destroy()

    def _on_input(self, name: str, callback: Entity, message: Message, info: Mapping[str, int]) -> None:
        if not self._is_active:
            return
        # The daemon checks the stamps of poses from outside.
        is_stamped = name in STAMPED or (name == "cmd_vel" and self._shared.settings.has_stamped_cmd_vel)
        stamp_s = self._shared.time.utc_s(message.header.stamp) if is_stamped else 0.0
        try:
            self._lateness.require_setpoint(info["source_timestamp"] / values.NANO, stamp_s)
        except ual.UalError as error:
            self._loop.call_soon_threadsafe(self._refuse, name, error)
        else:
            callback(message)

    def _on_pose(self, message: Message) -> None:
        self._put(self._setpoints, "set_pose", values.pose_stamped(message))

    def _on_velocity(self, message: Message) -> None:
        self._put(self._setpoints, "set_velocity", values.twist_stamped(message))

    def _on_body_velocity(self, message: Message) -> None:
        """Takes a Twist, which names no frame: as ``cmd_vel`` of other robots, along the axes of the body."""
        self._put(self._setpoints, "cmd_vel", ual.TwistStamped(values.twist(message), f"{self._ns}/base_link"))

    def _on_stamped_body_velocity(self, message: Message) -> None:
        """Takes a TwistStamped; one that names no frame is along the axes of the body, too."""
        frame_id = message.header.frame_id or f"{self._ns}/base_link"
        self._put(self._setpoints, "cmd_vel", ual.TwistStamped(values.twist(message.twist), frame_id))

    def _on_external_pose(self, message: Message) -> None:
        stamp_s = self._shared.time.utc_s(message.header.stamp)
        self._put(self._external_poses, "external_pose", values.external_pose(message, stamp_s))

    def _on_external_pose_with_covariance(self, message: Message) -> None:
        stamp_s = self._shared.time.utc_s(message.header.stamp)
        measured = values.external_pose_with_covariance(message, stamp_s)
        self._put(self._external_poses, "external_pose_cov", measured)

    @staticmethod
    def _put(stream: Newest[TopicValue], topic: str, value: Setpoint) -> None:
        stream.put(TopicValue(topic, value, steady_s()))

    def _serve(self, command: RosCommand, request: Message, sent_s: float) -> Future[Message]:
        return self._run(self._answered(command, request, sent_s))

    def _run(self, coroutine: Coroutine[Any, Any, Any]) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop)

    # --- On the event loop --------------------------------------------------------------------------------------------

    async def begin(self) -> None:
        """Begins to tell of the UAV and to fly it."""
        self._is_active = True
        self._pulse = ProgramPulse()
        self._said.address, self._said.failed = self._uav.address, ""
        self._samples = self._refusal = None
        self._contact.note()
        works = [self._watch(), self._check(), self._follow_frames(), self._frames.feed(), self._cameras.follow()]
        works += [self._about.follow(), self._about.follow_route()]
        works.append(self._beat())
        works += self._uav_services.works()
        if self._shared.settings.lease_holder is not None:
            self._not_leased = ual.LeaseLostError("the node has not acquired its lease yet", {"by": "nothing"})
            works.append(self._acquire())
        self._watching = [self._loop.create_task(work) for work in works]
        for each in self._watching:
            each.add_done_callback(self._on_work_ended)

    def _on_work_ended(self, work: asyncio.Task[None]) -> None:
        """A mistake in this program ends no flight, but it is said loudly: what is told may be old from now on."""
        error = None if work.cancelled() else work.exception()
        if error is not None:
            _log.error("%s: the node does not work any more: start it again", self._ns, exc_info=error)
            self._said.failed = f"the node failed, start it again: {error!r}"
            self._tell_unknown(self._said.failed)

    async def end(self, why: str) -> None:
        """Ends what it has begun: a go-to or path ends, and the UAV holds; a take-off or a landing goes on."""
        self._is_active = False
        for stream in (self._setpoints, self._external_poses):
            stream.clear()
        for work in self._watching:
            work.cancel()
        for run in self._commands:
            run.cancel(why)
        await asyncio.gather(*self._watching, *(run.task for run in self._commands), return_exceptions=True)
        self._watching = []
        self._about.end()
        await self._frames.take_back()
        await self._release()
        self._topics.tell_unknown(why, self._said)
        self._newest = None

    async def close(self) -> None:
        """Ends the connection."""
        await self._uav.close()

    @property
    def newest(self) -> ual.Telemetry | None:
        """The newest sample; None while nothing is known."""
        return self._newest

    @property
    def has_safety_pilot(self) -> bool:
        """Whether take-offs and landings are left to a safety pilot to abort: so until the daemon says otherwise."""
        return self._has_safety_pilot

    async def abort(self) -> None:
        """Ends what flies."""
        self._require_lease()
        await self._uav.abort()

    async def running_id(self) -> str:
        """Asks the daemon which task runs; empty: none."""
        task = (await self._uav.telemetry()).task
        return "" if task is None else task.id

    def begin_command(self, command: RosCommand, request: Message, sent_s: float = 0.0) -> CommandRun:
        """Begins a command, which `end` ends. It was sent at a time of UTC (0: not known)."""
        run = CommandRun(lambda: self._perform(command, request, sent_s, run), request)
        self._commands.add(run)
        run.task.add_done_callback(lambda task: self._on_ended(command, run, task.result()))
        return run

    def _on_ended(self, command: RosCommand, run: CommandRun, ended: CommandOutcome) -> None:
        self._commands.discard(run)
        if not ended.is_success:
            _log.warning("%s: %s", self._ns, ended.text_of(command.name))

    async def _answered(self, command: RosCommand, request: Message, sent_s: float) -> Message:
        ended = await self.begin_command(command, request, sent_s).task
        response = command.kind.Response()
        if command.kind is Empty:
            return response
        if command.kind is Trigger:
            return outcome.fill_trigger(response, ended)
        return outcome.fill(response, ended, KeyValue)

    async def _perform(
        self, command: RosCommand, request: Message, sent_s: float, run: CommandRun
    ) -> Mapping[str, Message]:
        if not self._is_active:
            raise ual.WrongStateError("the node is not active: activate it (ros2 lifecycle set)", {"needed": "active"})
        is_of_the_present = not command.may_be_late
        if command.needs_lease:
            self._require_lease()
        if is_of_the_present:
            self._require_present(sent_s)
            await self._contact.require(COMMAND_S)
        await self._frames.provide(command.frames(request))
        if isinstance(command, ActionCommand) and command.flies(request):
            run.before = Before.of(await self._contact.answer_within(COMMAND_S) if is_of_the_present else self._newest)
        if is_of_the_present:  # still, after the daemon and the frames were waited for
            self._require_present(sent_s)
        for stamp in command.stamps(request):
            self._shared.time.make_utc(stamp)
        told = command.told(await command.call(self._uav, request))
        if command.changes_frames:
            await self._frames.publish()
        return told

    @property
    def is_active(self) -> bool:
        """Whether it flies."""
        return self._is_active

    async def require_setpoint(self) -> None:
        """Raises the error of a lease that is lacking, or of a daemon that was not heard of lately."""
        self._require_lease()
        # Not sooner: over a link of one second with jitter each gap would refuse some of a stream.
        await self._contact.require(SETPOINT_S, quiet_s=SETPOINT_S)

    async def provide_frame(self, frame_id: str) -> None:
        """Gives the daemon a frame that only tf knows."""
        await self._frames.provide((frame_id,))

    def _on_refusal(self, given: TopicValue, error: ual.UalError) -> None:
        """A topic has no answer: so its refusal is told in `refusals`, in the diagnostics, and once in the log."""
        self._refuse(given.topic, error)

    def _refuse(self, topic: str, error: ual.UalError) -> None:
        self._about.refuse(topic, error)
        text = f"{error.reason}: {error.message}"
        if without_seconds(text) != without_seconds(self._said.refused):
            _log.warning("%s: a setpoint is refused: %s", self._ns, text)
        self._said.refused = text
        self._said.refused_count += 1
        self._refused_s = self._loop.time()

    def _require_present(self, sent_s: float) -> None:
        if sent_s:
            self._lateness.require_command(sent_s)
        else:
            self._pulse.require_running()

    async def _beat(self) -> None:
        while True:
            self._pulse.beat()
            await asyncio.sleep(BEAT_S)

    def _require_lease(self) -> None:
        if self._not_leased is not None:
            raise self._not_leased

    async def _acquire(self) -> None:
        """Acquires the lease, and tries again until it has it. One that is lost later stays lost until `end`."""
        settings = self._shared.settings
        while True:
            try:
                self._lease = await self._uav.lease(settings.lease_holder or "", take=settings.lease_take)
                self._not_leased = None
                break
            except ual.UalError as error:
                self._not_leased = error
            await asyncio.sleep(RETRY_S)

    async def _release(self) -> None:
        lease, self._lease = self._lease, None
        self._not_leased = None
        try:
            if lease is not None:
                await lease.release()
        except ual.UalError as error:
            _log.warning("%s: the lease is not released: %s", self._ns, error)

    async def _watch(self) -> None:
        """Publishes each sample. A daemon that ends or is not there yet is waited for."""
        rate_hz = self._shared.settings.rate_hz
        while True:
            try:
                info = await self._uav.info()
                self._has_safety_pilot = info.has_safety_pilot
                await self._uav_services.on_connected(info)
                async with self._uav.subscribe(rate_hz) as self._samples:
                    async for sample in self._samples:
                        self._on_sample(sample)
            except ual.UalError as error:
                self._refusal = error
                self._tell_unknown(self._why_silent())
            await asyncio.sleep(RETRY_S)

    def _on_sample(self, sample: ual.Telemetry) -> None:
        if self._trouble:
            _log.info("%s: it tells again", self._ns)
            self._trouble = ""
        self._newest, self._refusal = sample, None
        self._contact.note()
        self._topics.publish(sample)
        self._about.note(sample.task)

    async def _check(self) -> None:
        """Publishes what changes slowly, and says when nothing comes any more."""
        settings = self._shared.settings
        silent_s = max(SILENT_S, 3.0 / settings.rate_hz)
        while True:
            await asyncio.sleep(1.0 / settings.slow_rate_hz)
            self._note_connection()
            if self._contact.silent_s > silent_s:
                self._tell_unknown(self._why_silent())
            elif self._newest is not None:
                self._topics.publish_slow(self._newest, self._said)
                self._about.publish_slow(self._newest)

    def _why_silent(self) -> str:
        """Says why nothing is known of the UAV: a daemon that is away, or that refuses, does not just tell nothing."""
        error = self._refusal or (self._samples.interruption if self._samples is not None else None)
        if error is None:
            return f"the daemon at {self._uav.address} tells nothing"
        return f"{error.reason}: {error.message}"

    def _note_others(self) -> None:
        before, self._said.other_nodes = self._said.other_nodes, self._topics.others_count()
        if self._said.other_nodes > before:
            _log.warning("%s: %s", self._ns, self._said.rivals)
        before_senders = self._said.velocity_senders
        topics_of = [f"/{self._ns}/ual/{name}" for name in senders.VELOCITIES]
        self._said.velocity_senders = senders.names(self._shared.node, topics_of)
        if len(self._said.velocity_senders) > max(1, len(before_senders)):
            _log.warning("%s: %s", self._ns, senders.doubt(self._said.velocity_senders))

    def _note_connection(self) -> None:
        self._said.address = self._uav.address
        self._said.clock = CLOCK_STANDS if self._shared.time.stands() else ""
        self._note_others()
        if self._loop.time() - self._refused_s > REFUSED_S:
            self._said.refused = ""
        if self._lease is not None and self._lease.lost is not None:
            self._said.lease = f"lost: {self._lease.lost.message}"
        elif self._not_leased is not None:
            self._said.lease = f"not held: {self._not_leased.message}"
        else:
            self._said.lease = "none" if self._lease is None else "held"

    def _tell_unknown(self, reason: str) -> None:
        if not self._trouble:
            _log.warning("%s: nothing is known of it: %s", self._ns, reason)
        self._trouble = reason
        self._newest = None
        self._topics.tell_unknown(reason, self._said)

    async def _follow_frames(self) -> None:
        settings = self._shared.settings
        while True:
            try:
                await self._frames.publish()
            except ual.UalError:  # the daemon is not there: `_watch` tells it
                self._frames.has_moving = False
            await asyncio.sleep(1.0 / (settings.rate_hz if self._frames.has_moving else settings.slow_rate_hz))
