"""Puts fields into messages of ROS, and makes commands whose answers are fields."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from typing import Any

from ual_ros2.command import RosCommand, Serves, Service
from ual_ros2.messages import Entity, Message
from ual_ros2.ros_time import RosTime
from ual_ros2.services.fields import Fields, Stamp

_SEQUENCE = re.compile(r"sequence<(\w+)/(\w+)(?:, \d+)?>")


class Filling:
    """Fills messages, whose stamps are those of a node's clock; without one, only messages that have none."""

    def __init__(self, time: RosTime | None = None) -> None:
        self._time = time

    def filled(self, message: Message, fields: Fields) -> Message:
        """Puts fields into a message, and returns it."""
        for name, value in fields.items():
            self._put(message, name, value)
        return message

    def to_messages(self, make: Callable[[], Message]) -> Callable[[Fields], Mapping[str, Message]]:
        """Returns what makes fields those of messages of one type."""

        def to_messages(fields: Fields) -> Mapping[str, Message]:
            answer = self.filled(make(), fields)
            return {name: getattr(answer, name) for name in fields}

        return to_messages

    def command(self, service: Service, call: Serves, **more: Any) -> RosCommand:  # noqa: ANN401 (what else it has)
        """Returns the command of a service that follows from the contract."""
        told = self.to_messages(service.kind.Response)
        return RosCommand(service.name, service.kind, call, service.frames_of, told, method=service.method, **more)

    def _put(self, message: Message, name: str, value: object) -> None:
        if isinstance(value, Stamp):
            self._put_stamp(getattr(message, name), value)
        elif isinstance(value, Mapping):
            self.filled(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            element = _element(message, name)
            setattr(message, name, [self.filled(element(), each) for each in value])
        else:
            setattr(message, name, value)

    def _put_stamp(self, message: Message, stamp: Stamp) -> None:
        if stamp.utc_s:  # else it is not known
            assert self._time is not None
            self._time.stamp(message, stamp.utc_s)


def _element(message: Message, name: str) -> Entity:
    """Returns the type of the messages in a sequence."""
    declared = message.get_fields_and_field_types()[name]
    found = _SEQUENCE.fullmatch(declared)
    if found is None:
        raise TypeError(f"{name} is {declared}, not a sequence of messages")
    return getattr(importlib.import_module(f"{found[1]}.msg"), found[2])
