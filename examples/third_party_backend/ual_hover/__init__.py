"""A UAL backend for an imaginary autopilot, `hover`."""

from ual_hover.backend import HoverBackend

__all__ = ["HoverBackend"]
