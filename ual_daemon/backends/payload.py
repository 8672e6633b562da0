"""Payload services of a backend (gimbals, cameras, grippers, winches): nothing of it flies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class PayloadMessage:
    """A message of the autopilot: its name, its fields as the autopilot sends them (units, axes), and when it came.

    `time_s` is the backend's clock.
    """

    name: str
    fields: Mapping[str, Any]
    time_s: float


PayloadCallback = Callable[[PayloadMessage], None]


class Payload(ABC):
    """Reads messages of the autopilot, and sends it commands that do not fly. From any thread; no method waits."""

    @abstractmethod
    def send_command(self, command_id: int, params: Sequence[float]) -> Future[None]:
        """Sends a command. Replaces, and so cancels, the one with this id that is not acknowledged yet.

        The future ends with the acknowledgement, or with a `RejectedByAutopilotError` that quotes the autopilot; it
        ends with a `LinkLostError` if no autopilot is received. If the acknowledgement is lost, it stays open: give up
        after a time, and cancel it.

        Raises:
            PermissionDeniedError: The command is none of those that are permitted, which the error names.
            InvalidArgumentError: There are too many parameters.

        """

    @abstractmethod
    def subscribe(self, message: str, callback: PayloadCallback) -> Callable[[], None]:
        """Has a callback called with each message of a name. Returns the function that ends this.

        The callback runs on the thread that receives, so it must not block. After the end it may run once more.

        Raises:
            InvalidArgumentError: There is no message of this name.

        """

    @abstractmethod
    def request_message(self, message: str, rate_hz: float | None = None) -> Future[None]:
        """Asks the autopilot to send a message once, or with a rate. The future is as that of `send_command`.

        Raises:
            InvalidArgumentError: There is no message of this name, or the rate is not positive.
            PermissionDeniedError: The message is none of a payload: the daemon needs the others at its own rates.

        """
