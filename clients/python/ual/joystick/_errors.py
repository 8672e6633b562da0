"""Errors of joysticks."""

from __future__ import annotations


class JoystickError(Exception):
    """There is no such joystick, or it cannot be used as it is; the message is one line that says why."""


class JoystickDisconnectedError(JoystickError):
    """The joystick was disconnected: its cable was pulled, or its battery is empty."""


class MappingError(JoystickError):
    """A file of mappings is not valid; the message is one line that says where and why."""
