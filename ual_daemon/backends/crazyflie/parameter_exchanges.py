"""Reads and writes parameters of the firmware, by its own table of them (CRTP port 2). On the engine's thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeVar

from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
)
from ual.parameters.values import Parameter, ParameterType, is_equal
from ual_daemon.backends import futures
from ual_daemon.backends.crazyflie.connecting import ask_read, ask_write, value_of
from ual_daemon.backends.crazyflie.requests import CrtpRequest, CrtpRequests
from ual_daemon.backends.crazyflie.toc import Toc, Variable
from ual_daemon.backends.engine.contained import defect
from ual_daemon.backends.offers.parameters import Refusal

T = TypeVar("T")

REQUESTS_AT_ONCE = 4
"""Most requests that wait for answers at a time: fewer than may be on their way, so that commands never wait for
them.
"""
LIMIT_S, EACH_S = 5.0, 0.2
"""Seconds that an exchange may take, and additional seconds for each of its parameters."""
MOST_WAITING_EXCHANGES = 100
TYPES = {
    "B": ParameterType.UINT8,
    "b": ParameterType.INT8,
    "H": ParameterType.UINT16,
    "h": ParameterType.INT16,
    "I": ParameterType.UINT32,
    "i": ParameterType.INT32,
    "f": ParameterType.REAL32,
}
"""The types that UAL has, by the letters of `struct`. Others (of 64 bits) are left out."""


class ParameterExchanges:
    """All exchanges of one Crazyflie, one after the other.

    Args:
        requests: Those of the link.
        table: Returns the table of the firmware; empty while it is not known.
        on_written: Called with each parameter that was written and read back.

    """

    def __init__(
        self, requests: CrtpRequests, table: Callable[[], Toc], on_written: Callable[[Parameter], None]
    ) -> None:
        self._requests = requests
        self._table = table
        self._on_written = on_written
        self._waiting: deque[_ParameterReading | _Writing] = deque()
        self._running: _ParameterReading | _Writing | None = None

    def read(self, name: str, future: Future[Parameter]) -> None:
        """Reads one, by its name in any case."""
        table = self._table()
        found = find(name, table)
        if isinstance(found, UalError):
            futures.fail(future, found)
            return
        read: Future[list[Parameter]] = Future()
        read.add_done_callback(lambda done: _pass_on(done, future))
        self._add(_ParameterReading(self._requests, [(found, table[found])], read), read)

    def read_all(self, future: Future[list[Parameter]]) -> None:
        """Reads all whose type UAL has, in the order of the table."""
        known = [each for each in self._table().items() if each[1].format in TYPES]
        self._add(_ParameterReading(self._requests, sorted(known, key=lambda each: each[1].ident), future), future)

    def write(self, wanted: Parameter, refusal: Refusal, future: Future[Parameter]) -> None:
        """Writes one and reads it back; see `AutopilotParameters.write`."""
        table = self._table()
        found = find(wanted.name, table)
        if isinstance(found, UalError):
            futures.fail(future, found)
        elif table[found].is_read_only:
            text = f"{found} can only be read, says the firmware"
            futures.fail(future, RejectedByAutopilotError(text, {"name": found}))
        else:
            self._add(_Writing(self._requests, wanted, table[found], refusal, future, self._on_written), future)

    def tick(self, now_s: float, *, is_connected: bool) -> None:
        """Goes on. To be called before the requests are sent, as what may not be written any more is withdrawn here."""
        while self._running is None or self._running.future.done():
            if self._running is not None:
                self._running.withdraw()
            if not self._waiting:
                self._running = None
                return
            self._running = self._waiting.popleft()
        if is_connected:
            _tick(self._running, now_s)
        else:
            futures.fail(self._running.future, LinkLostError("no Crazyflie is connected"))
        if self._running.future.done():
            self._running.withdraw()

    def _add(self, exchange: _ParameterReading | _Writing, future: Future[list[Parameter]] | Future[Parameter]) -> None:
        if len(self._waiting) >= MOST_WAITING_EXCHANGES:
            text = f"{MOST_WAITING_EXCHANGES} reads and writes of parameters wait already, which is the limit"
            futures.fail(future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_EXCHANGES)}))
        else:
            self._waiting.append(exchange)


def _tick(running: _ParameterReading | _Writing, now_s: float) -> None:
    """Goes on with one. A defect ends it, and not the link: the firmware stops the motors where setpoints stop."""
    try:
        running.tick(now_s)
    except Exception as error:  # noqa: BLE001 - logged, and raised to the caller
        futures.fail(running.future, defect("exchange parameters", error))


class _ParameterReading:
    """Reads some, a few at a time."""

    def __init__(
        self, requests: CrtpRequests, variables: Sequence[tuple[str, Variable]], future: Future[list[Parameter]]
    ) -> None:
        self.future = future
        self._requests = requests
        self._variables = variables
        self._next = 0
        self._pending: dict[int, CrtpRequest] = {}
        self._found: dict[int, Parameter] = {}
        self._end_s: float | None = None

    def tick(self, now_s: float) -> None:
        if self._end_s is None:
            self._end_s = now_s + LIMIT_S + EACH_S * len(self._variables)
        while self._next < len(self._variables) and len(self._pending) < REQUESTS_AT_ONCE:
            self._ask(self._next)
            self._next += 1
        if len(self._found) == len(self._variables):
            _end(self.future, [self._found[each] for each in range(len(self._variables))])
        elif now_s > self._end_s:
            missing = len(self._variables) - len(self._found)
            text = f"the Crazyflie did not answer in time for {missing} of {len(self._variables)} parameters"
            futures.fail(self.future, UalTimeoutError(text, {"missing": str(missing)}))

    def withdraw(self) -> None:
        for each in self._pending.values():
            self._requests.withdraw(each)
        self._pending.clear()

    def _ask(self, index: int) -> None:
        name, variable = self._variables[index]
        request = self._pending[index] = ask_read(variable)

        def on_answer(data: bytes) -> None:
            del self._pending[index]
            value = value_of(variable, data)
            if value is None:
                futures.fail(
                    self.future, RejectedByAutopilotError(f"the firmware does not give {name}", {"name": name})
                )
            else:
                self._found[index] = Parameter(name, value, TYPES[variable.format])

        self._requests.add(request, on_answer)


class _Writing:
    """Writes one, and reads it back. The answer to a write says only that it came."""

    def __init__(
        self,
        requests: CrtpRequests,
        wanted: Parameter,
        variable: Variable,
        refusal: Refusal,
        future: Future[Parameter],
        on_written: Callable[[Parameter], None],
    ) -> None:
        self.future = future
        self._requests = requests
        self._wanted = wanted
        self._variable = variable
        self._refusal = refusal
        self._on_written = on_written
        self._pending: CrtpRequest | None = None
        self._is_written = False
        self._end_s: float | None = None

    def tick(self, now_s: float) -> None:
        if not self._is_written and (error := self._refusal()) is not None:
            futures.fail(self.future, error)
        elif self._end_s is None:
            self._end_s = now_s + LIMIT_S
            self._pending = ask_write(self._variable, self._wanted.value)
            self._requests.add(self._pending, self._on_confirmed)
        elif now_s > self._end_s:
            name = self._wanted.name
            text = f"the Crazyflie has not answered: it is not known whether {name} was written"
            futures.fail(self.future, UalTimeoutError(text, {"name": name}))

    def withdraw(self) -> None:
        if self._pending is not None:
            self._requests.withdraw(self._pending)
            self._pending = None

    def _on_confirmed(self, _: bytes) -> None:
        self._is_written = True
        self._pending = ask_read(self._variable)
        self._requests.add(self._pending, self._on_value)

    def _on_value(self, data: bytes) -> None:
        self._pending = None
        name, value = self._wanted.name, value_of(self._variable, data)
        found = None if value is None else Parameter(name, value, self._wanted.type)
        if found is not None:
            self._on_written(found)  # for every waiter: it is so now
        if found is None or not is_equal(found.value, self._wanted.value):
            kept = "" if found is None else found.text
            text = f"{name}: the firmware keeps {kept or 'another value'}"
            futures.fail(self.future, RejectedByAutopilotError(text, {"name": name, "kept": kept}))
        else:
            _end(self.future, found)


def find(name: str, table: Toc) -> str | UalError:
    """Returns the name as the firmware writes it: capital letters need not be typed. Else why there is none."""
    found = [each for each in table if each.casefold() == name.casefold()]
    exact = name if name in table else found[0] if len(found) == 1 else ""
    if not exact:
        return InvalidArgumentError(f"name: the firmware has no parameter {name}", {"field": "name"})
    if table[exact].format not in TYPES:
        return NotSupportedError(f"{exact} has a type that UAL does not know")
    return exact


def _pass_on(done: Future[list[Parameter]], future: Future[Parameter]) -> None:
    error = done.exception()
    if error is not None:
        futures.fail(future, error)
    else:
        _end(future, done.result()[0])


def _end(future: Future[T], result: T) -> None:
    if not future.done() and future.set_running_or_notify_cancel():
        future.set_result(result)
