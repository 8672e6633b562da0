"""Exchanges of the parameter protocol: one value, a write with its read-back, and the list of all.

https://mavlink.io/en/services/parameter.html. Messages may be lost, doubled, late, and meant for other ground stations,
as a PARAM_VALUE names no receiver. So each exchange takes any value that could be its answer, and repeats its requests.
Each ends by itself, whatever comes or does not come.
"""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import NotSupportedError, UalError, UalTimeoutError
from ual.parameters.values import Parameter, ParameterType
from ual_daemon.backends.firmwares.parameter_errors import in_doubt, not_kept, unconfirmed
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.offers.parameters import Refusal

T = TypeVar("T")

_log = logging.getLogger(__name__)

RETRY_S = 0.6
"""Seconds without an answer after which a request is sent again, ..."""
TRIES_COUNT = 10
"""... and most attempts: on a link that loses 30 % each way, one step in a thousand then has no answer."""
CONTRARY_COUNT = 3
"""Tries answered by another value after which a write is taken to be refused. One such answer may be of a request
before.
"""
LIST_RETRY_S = 2.0
LIST_SILENCE_S = 1.0
"""Seconds without a new value of the list after which missing ones are requested one by one, ..."""
MOST_PENDING_REQUESTS = 10
"""... and most requests at a time. ArduPilot queues 20 requests, and drops the others."""
PROGRESS_TIMEOUT_S = 10.0
"""Seconds without a new value after which the list ends without the missing ones."""
LONGEST_LIST_S = 600.0
MOST_PARAMETERS = 10_000
"""ArduPilot has 1,400, PX4 1,000."""
RESTARTS_COUNT = 3
"""Times that the number of parameters may change while they are listed: ArduPilot has more once a sensor is on."""


class Received(NamedTuple):
    """A PARAM_VALUE: its place in a list of `total`. `value` is None where its type is not known, or cannot have it."""

    name: str
    place: int
    total: int
    value: tuple[float, ParameterType] | None


class ParameterRequests(NamedTuple):
    """Requests to one autopilot: of a name, of an index, of all, and of a write.

    `explain` takes the error of an exchange that was not answered, its name, and the time. It returns the error with
    its meaning.
    """

    read: Callable[[str], object]
    read_index: Callable[[int], object]
    read_all: Callable[[], object]
    write: Callable[[Parameter], object]
    explain: Callable[[UalError, str, float], UalError]


class ParameterExchange(Exchange[T]):
    """An exchange about parameters."""

    def __init__(self, future: Future[T], requests: ParameterRequests) -> None:
        super().__init__(future)
        self._requests = requests

    @abstractmethod
    def on_value(self, received: Received, now_s: float) -> None:
        """Takes a value of the autopilot."""

    def on_refusal(self, name: str, error: UalError) -> None:
        """Takes what the autopilot says of the parameter of a name."""


class _OfName(ParameterExchange[Parameter]):
    """An exchange about one parameter."""

    def __init__(self, future: Future[Parameter], requests: ParameterRequests, name: str) -> None:
        super().__init__(future, requests)
        self._name = name
        self._tries_count = 0
        self._next_s: float | None = None

    @override
    def tick(self, now_s: float) -> None:
        if self._next_s is not None and now_s < self._next_s:
            return
        if self._next_s is not None:
            self._on_silence(now_s)
        if not self.is_over:
            self._tries_count += 1
            self._next_s = now_s + RETRY_S
            self._request()

    @override
    def on_refusal(self, name: str, error: UalError) -> None:
        if name == self._name:
            self.fail(error)

    @override
    def on_value(self, received: Received, now_s: float) -> None:
        if received.name != self._name or self._next_s is None:
            return
        if received.value is None:
            self.fail(NotSupportedError(f"{self._name} has a type or a value that UAL does not know"))
        else:
            self._on_own_value(Parameter(self._name, *received.value), now_s)

    def _on_silence(self, now_s: float) -> None:
        """Does what follows from a try whose time is over."""
        if self._tries_count >= TRIES_COUNT:
            self.fail(self._requests.explain(self._unanswered(), self._name, now_s))

    @abstractmethod
    def _request(self) -> None:
        """Sends the request."""

    @abstractmethod
    def _on_own_value(self, found: Parameter, now_s: float) -> None:
        """Takes the value of this parameter."""

    @abstractmethod
    def _unanswered(self) -> UalError:
        """Returns the error of a request without an answer."""


class ParameterReading(_OfName):
    """Reads one value."""

    @override
    def _request(self) -> None:
        self._requests.read(self._name)

    @override
    def _on_own_value(self, found: Parameter, now_s: float) -> None:
        self._end(found)

    @override
    def _unanswered(self) -> UalError:
        return UalTimeoutError(
            f"{self._name} was not answered in {TRIES_COUNT} tries: the autopilot has no parameter of this name, or "
            "the link loses too much",
            {"name": self._name},
        )


class Writing(_OfName):
    """Writes one value, and reads it back once the autopilot has confirmed it. Stops once `refusal` has an error.

    The confirmation is awaited, not only the value read: ArduPilot confirms what it has stored (AP_Param::save_sync),
    and without room for it sends nothing. PX4 confirms at once.
    """

    def __init__(
        self, future: Future[Parameter], requests: ParameterRequests, wanted: Parameter, refusal: Refusal = lambda: None
    ) -> None:
        super().__init__(future, requests, wanted.name)
        self.wanted = wanted
        self._refusal = refusal
        self.is_sent = False
        """Whether the value has left, at least once."""
        self._is_confirmed = False
        self._kept: Parameter | None = None
        """Another value that has come since the last request."""
        self._contrary_count = 0

    def follow(self, requests: ParameterRequests) -> None:
        """Goes on with the system that the autopilot has become by this write: it is read back there."""
        self._requests = requests
        self._is_confirmed, self._kept, self._tries_count, self._next_s = True, None, 0, None

    @override
    def _request(self) -> None:
        if self._is_confirmed:
            self._requests.read(self._name)
            return
        error = self._refusal()
        if error is None:
            self.is_sent = True
            self._requests.write(self.wanted)
        elif self.is_sent:
            self.fail(in_doubt(error, self.wanted))
        else:
            self.fail(error)

    @override
    def _on_own_value(self, found: Parameter, now_s: float) -> None:
        if found.value != self.wanted.value:
            self._kept = found  # perhaps of a request before: the next try says
        elif self._is_confirmed:
            self._end(found)
        else:
            self._is_confirmed, self._kept, self._tries_count, self._next_s = True, None, 0, now_s
            self.tick(now_s)

    @override
    def _on_silence(self, now_s: float) -> None:
        if self._kept is None:
            super()._on_silence(now_s)
            return
        self._contrary_count += 1
        if self._contrary_count >= CONTRARY_COUNT:
            self.fail(not_kept(self.wanted, self._kept))
        self._is_confirmed, self._kept = False, None

    @override
    def _unanswered(self) -> UalError:
        what = "not read back" if self._is_confirmed else "not confirmed"
        return unconfirmed(self.wanted, what, TRIES_COUNT)


class Listing(ParameterExchange[list[Parameter]]):
    """Lists all values: first as the autopilot streams them, then those that are missing."""

    def __init__(self, future: Future[list[Parameter]], requests: ParameterRequests) -> None:
        super().__init__(future, requests)
        self._found: dict[int, Received] = {}
        self._requested_s: dict[int, float] = {}
        """Times of the last requests for missing parameters."""
        self._count: int | None = None
        self._began_s: float | None = None
        self._new_s = 0.0
        """Time of the last new value."""
        self._next_s = 0.0
        self._is_filling = False
        self._restarts_count = 0

    @override
    def tick(self, now_s: float) -> None:
        if self._began_s is None:
            self._began_s = self._new_s = self._next_s = now_s
        if now_s - self._new_s > PROGRESS_TIMEOUT_S or now_s - self._began_s > LONGEST_LIST_S:
            self.fail(self._requests.explain(self._incomplete(), "", now_s))
        elif self._count is None:
            self._request_list(now_s)
        elif self._is_filling or now_s - self._new_s >= LIST_SILENCE_S:
            self._is_filling = True
            self._request_missing(now_s)

    @override
    def on_value(self, received: Received, now_s: float) -> None:
        if self._began_s is None or received.place >= received.total:  # one of its own accord has no place in the list
            return
        if received.total > MOST_PARAMETERS:
            self.fail(NotSupportedError(f"it says that it has {received.total} parameters, over {MOST_PARAMETERS}"))
            return
        if received.total != self._count and not self._begin_count(received.total, now_s):
            return
        if received.place not in self._found:
            self._new_s = now_s
        self._found[received.place] = received
        if len(self._found) == received.total:
            self._end(self._known())

    def _known(self) -> list[Parameter]:
        ordered = [each for _, each in sorted(self._found.items())]
        unknown = ", ".join(each.name for each in ordered if each.value is None)
        if unknown:
            _log.warning(
                "of these parameters UAL does not know the type or the value, so they are not listed: %s", unknown
            )
        return [Parameter(each.name, *each.value) for each in ordered if each.value is not None]

    def _begin_count(self, count: int, now_s: float) -> bool:
        """Takes the number of parameters. If it has changed, all indices are others. Returns whether it goes on."""
        if self._count is not None:
            self._restarts_count += 1
            self._found.clear()
            self._requested_s.clear()
            self._new_s, self._is_filling = now_s, True
        self._count = count
        if self._restarts_count > RESTARTS_COUNT:
            self.fail(UalTimeoutError("the number of its parameters changes all the time: try again"))
        return not self.is_over

    def _request_list(self, now_s: float) -> None:
        if now_s >= self._next_s:
            self._next_s = now_s + LIST_RETRY_S
            self._requests.read_all()

    def _request_missing(self, now_s: float) -> None:
        missing = [index for index in range(self._count or 0) if index not in self._found]
        due = [index for index in missing if now_s - self._requested_s.get(index, -RETRY_S) >= RETRY_S]
        room = MOST_PENDING_REQUESTS - (len(missing) - len(due))
        for index in due[: max(0, room)]:
            self._requested_s[index] = now_s
            self._requests.read_index(index)

    def _incomplete(self) -> UalError:
        if self._count is None:
            return UalTimeoutError("the autopilot does not answer to the request for its parameters")
        missing_count = self._count - len(self._found)
        return UalTimeoutError(
            f"{missing_count} of its {self._count} parameters have not come: the link loses too much; try again",
            {"missing": str(missing_count), "count": str(self._count)},
        )
