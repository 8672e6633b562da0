"""Requests that are not one field for each argument: ``x_request`` makes that of ``X``, ``x_arguments`` reads it."""

from __future__ import annotations
