"""Keeps what a daemon frees from staying in its heap: glibc's defaults let a daemon grow for hours."""

from __future__ import annotations

import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
_LARGE_BYTES = 128 << 10
_ARENAS_COUNT = 1


def limit() -> None:
    """Sets glibc's allocator for a program that runs for days. Does nothing where the C library has no `mallopt`.

    - One arena: by default eight for each processor are made for threads, each with its own freed pieces.
    - Large blocks come from the system and go back to it. By default the first large block that is freed (a call of
      5 MiB that was refused) raises this limit, up to 32 MiB, and blocks below it stay.

    Source: mallopt(3).
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return
    for parameter, value in (
        (_ARENA_MAX, _ARENAS_COUNT),
        (_MMAP_THRESHOLD, _LARGE_BYTES),
        (_TRIM_THRESHOLD, _LARGE_BYTES),
    ):
        mallopt(parameter, value)
