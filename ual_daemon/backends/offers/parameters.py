"""Interface of a backend for the autopilot's parameters; see `ual_daemon.services.parameters`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from concurrent.futures import Future

from ual.errors import UalError, WrongStateError
from ual.parameters.values import Description, Parameter

Refusal = Callable[[], UalError | None]
"""Why a value may not be written now: the UAV may have been armed meanwhile. None while it may."""


class UndecidedError(WrongStateError):
    """A refusal that may pass within a moment: what has taken the UAV is not known yet. Nothing is sent meanwhile."""


class AutopilotParameters(ABC):
    """Reads and writes the parameters of one autopilot. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`.
    """

    @property
    @abstractmethod
    def relied_on(self) -> frozenset[str]:
        """The names of those on which a flight relies: UAL has read them, or its failsafes are by them."""

    def descriptions(self) -> Future[Mapping[str, Description]]:
        """Returns what the autopilot tells about its parameters, by name: nothing where it tells none.

        The future ends soon, without an error: what takes long to read is there the next time.
        """
        nothing: Future[Mapping[str, Description]] = Future()
        nothing.set_result({})
        return nothing

    @abstractmethod
    def read(self, name: str) -> Future[Parameter]:
        """Reads one.

        The future ends with an `InvalidArgumentError` where the autopilot says that it has none of this name, or with
        a `NotSupportedError` where UAL cannot read this autopilot's.
        """

    @abstractmethod
    def read_all(self) -> Future[list[Parameter]]:
        """Reads all, in the order of the autopilot. Where that is in progress already, the result is of that."""

    @abstractmethod
    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        """Writes one, which has the type and the name that were read, and reads it back.

        `refusal` is called each time before the value is sent, first and again. Once it returns an error, the value is
        not sent any more, and the future ends with that error. It is called from any thread, and does not wait.

        The future ends with a `RejectedByAutopilotError` where the autopilot has kept another value.
        """
