"""Hears topics on a thread of its own, whose wait set is kept.

rclpy's executor gathers all services, actions, timers and events of the node in Python, for each message that comes.
With many UAVs that costs more than all else that the node does. This module waits for its subscriptions only, in the
way of `rclpy.wait_for_message`: by rclpy's binding to the layer below. That is not a public interface. So it is tried
first, and where this rclpy does not have it in the known form, the executor hears the topics.
"""

from __future__ import annotations

import asyncio
import inspect
import threading
import time
from contextlib import ExitStack
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.callback_groups import CallbackGroup
from rclpy.guard_condition import GuardCondition

from ual_ros2.messages import Entity
from ual_ros2.values import NANO

EVENTS_S = 1.0
"""Seconds between two looks at the events of subscriptions."""


class TopicListener:
    """The topics that a node hears often. Their callbacks run on the thread of `spin`, one after the other.

    Any thread may call it.
    """

    def __init__(self, node: Entity) -> None:
        self._node = node
        self._lock = threading.Lock()
        self._subscriptions: tuple[Entity, ...] = ()
        self._has_ended = False
        self._changed = GuardCondition(None, None, node.context)
        self.waits_itself = _can_wait(node)
        """Whether `spin` calls back, and not the executor."""
        self._group = _OnListenersThread() if self.waits_itself else None

    def subscribe(self, kind: Entity, topic: str, callback: Entity, qos_profile: Entity, **options: Any) -> Entity:  # noqa: ANN401 (rclpy's own)
        """Begins to hear a topic."""
        options["callback_group"] = self._group
        subscription = self._node.create_subscription(kind, topic, callback, qos_profile, **options)
        with self._lock:
            self._subscriptions += (subscription,)
        self._changed.trigger()
        return subscription

    def unsubscribe(self, subscription: Entity) -> None:
        """Ends it."""
        self.forget(subscription)
        self._node.destroy_subscription(subscription)

    def forget(self, subscription: Entity) -> None:
        """Hears it no more. From then on it may be destroyed."""
        with self._lock:
            self._subscriptions = tuple(each for each in self._subscriptions if each is not subscription)
        self._changed.trigger()

    def spin(self) -> None:
        """Calls back until `end` is called. What a callback raises ends it."""
        while self.waits_itself and not self._has_ended:
            self._spin_same()

    def end(self) -> None:
        """Ends `spin`."""
        self._has_ended = True
        self._changed.trigger()

    def _spin_same(self) -> None:
        """Calls back for as long as the subscriptions are the same. They are kept from being destroyed meanwhile."""
        context = self._node.context
        with ExitStack() as kept:
            with self._lock:
                subscriptions = self._subscriptions
                for each in (*subscriptions, context):
                    kept.enter_context(each.handle)
            waiting = _TopicWait(subscriptions, self._changed, context)
            while self._subscriptions is subscriptions and not self._has_ended:
                waiting.wait()
                waiting.call_back()
                if waiting.is_time_for_events():
                    self._tell_events(waiting, subscriptions)

    def _tell_events(self, waiting: _TopicWait, subscriptions: tuple[Entity, ...]) -> None:
        with self._lock:  # none of them is forgotten and destroyed meanwhile
            if self._subscriptions is subscriptions:
                waiting.tell_events()


class _OnListenersThread(CallbackGroup):
    """Keeps subscriptions and their events from the executor."""

    def can_execute(self, entity: Entity) -> bool:
        return False

    def beginning_execution(self, entity: Entity) -> bool:
        return False

    def ending_execution(self, entity: Entity) -> None:
        """Nothing has begun."""


class _TopicWait:
    """Waits for messages of some subscriptions, and rarely asks for their events: rclpy logs what does not fit.

    Events have a set of their own, because a wait for an event of a subscription also ends with each of its messages.
    """

    def __init__(self, subscriptions: tuple[Entity, ...], changed: GuardCondition, context: Entity) -> None:
        from rclpy.impl.implementation_singleton import rclpy_implementation

        self._subscriptions = subscriptions
        self._arguments_counts = [_arguments_count(each.callback) for each in subscriptions]
        self._changed = changed
        self._set = rclpy_implementation.WaitSet(len(subscriptions), 1, 0, 0, 0, 0, context.handle)
        self._events = [event for each in subscriptions for event in each.event_handlers]
        self._event_set = rclpy_implementation.WaitSet(0, 1, 0, 0, 0, len(self._events), context.handle)
        self._next_s = 0.0

    def wait(self) -> None:
        """Waits for a message or a change, and not for longer than until events are asked for again."""
        self._set.clear_entities()
        for each in self._subscriptions:
            self._set.add_subscription(each.handle)
        self._set.add_guard_condition(self._changed.handle)
        self._set.wait(round(EVENTS_S * NANO))

    def call_back(self) -> None:
        """Hands over what has come."""
        ready = self._set.get_ready_entities("subscription")
        for each, arguments_count in zip(self._subscriptions, self._arguments_counts, strict=True):
            if each.handle.pointer in ready:
                taken = each.handle.take_message(each.msg_type, each.raw)
                if taken is not None:
                    each.callback(*taken[:arguments_count])

    def is_time_for_events(self) -> bool:
        """Returns whether to ask for events again."""
        return time.monotonic() >= self._next_s

    def tell_events(self) -> None:
        """Asks for events and tells those that came."""
        self._next_s = time.monotonic() + EVENTS_S
        self._event_set.clear_entities()
        for each in self._events:
            each.add_to_wait_set(self._event_set)
        self._event_set.add_guard_condition(self._changed.handle)  # rcl waits for no empty set
        self._event_set.wait(0)
        for each in self._events:
            if each.is_ready(self._event_set):
                asyncio.run(each.execute(each.take_data()))


def _arguments_count(callback: Entity) -> int:
    """Returns 2 for a callback that takes what is known of a message, beside it, and 1 for others."""
    try:
        inspect.signature(callback).bind("message", "info")
    except TypeError:
        return 1
    return 2


def _can_wait(node: Entity) -> bool:
    """Returns whether this rclpy has all that is needed: tries it with a subscription that hears nothing."""
    subscription = node.create_subscription(ParameterEvent, "/parameter_events", lambda _: None, 1)
    changed = GuardCondition(None, None, node.context)
    changed.trigger()
    try:
        with subscription.handle, node.context.handle:
            waiting = _TopicWait((subscription,), changed, node.context)
            waiting.wait()
            waiting.call_back()
            waiting.tell_events()
            subscription.handle.take_message(subscription.msg_type, subscription.raw)
    except (ImportError, AttributeError, TypeError, RuntimeError):  # the last one is rcl's
        return False
    else:
        return True
    finally:
        node.destroy_subscription(subscription)
        changed.destroy()
