"""Counts what a caller did and how it ended."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable

import grpc

from ual.errors import UalError


class Tally:
    """Numbers by name. Any thread may call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()

    def add(self, name: str) -> None:
        with self._lock:
            self._counts[name] += 1

    def counts(self) -> dict[str, int]:
        with self._lock:
            return dict(sorted(self._counts.items()))

    def attempt(self, name: str, action: Callable[[], object]) -> bool:
        """Does it and counts it. An error is counted by its reason, as under load each call may be too late."""
        try:
            action()
        except UalError as error:
            self.add(f"{name}: {error.reason}")
        except grpc.RpcError as error:
            self.add(f"{name}: {error.code().name}")
        except Exception as error:  # noqa: BLE001  a caller goes on for hours; its counts show what happened
            self.add(f"{name}: {type(error).__name__}")
        else:
            self.add(name)
            return True
        return False
