"""An exchange with the autopilot: something is requested, and a future ends with the result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from concurrent.futures import Future
from typing import Generic, TypeVar

from ual.errors import UalError
from ual_daemon.backends import futures

T = TypeVar("T")


class Exchange(ABC, Generic[T]):
    """One exchange. Its future ends with the result. Belongs to the thread that receives, and never blocks.

    It ends by itself, whatever comes or does not come.
    """

    def __init__(self, future: Future[T]) -> None:
        self.future = future

    @property
    def is_over(self) -> bool:
        """Whether it has ended, or is not waited for any more."""
        return self.future.done()

    @abstractmethod
    def tick(self, now_s: float) -> None:
        """Sends what is due; to be called often. The first call begins."""

    def fail(self, error: UalError) -> None:
        """Ends it with an error."""
        if not self.is_over:
            futures.fail(self.future, error)

    def _end(self, result: T) -> None:
        if not self.is_over and self.future.set_running_or_notify_cancel():
            self.future.set_result(result)
