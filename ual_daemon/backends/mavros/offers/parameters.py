"""The parameters of the autopilot, through MAVROS' plugin param, which keeps a copy of them.

It answers reads from its copy, which follows each PARAM_VALUE of the autopilot that it hears. It has no service that
reads one from the autopilot: only all. So a list has it fetch all again. A write is compared with the PARAM_VALUE with
which the autopilot has answered: MAVROS returns it, and confirms nothing without it (param.cpp, both versions).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from ual.errors import UalTimeoutError
from ual.parameters.values import Parameter, ParameterType, real32
from ual_daemon.backends.chain import caught, done, then, then_wait, together
from ual_daemon.backends.firmwares.parameter_errors import in_doubt, not_kept, unconfirmed, unknown
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.offers.services import BUSY_RETRY_S, BusyError, Services
from ual_daemon.backends.mavros.parameters import BOOL, DOUBLE, FIELDS, INTEGER
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal
from ual_daemon.backends.rosbridge import Message, RosGeneration
from ual_daemon.backends.rosbridge.fields import number

CALL_S = 3.0
SET_S = 7.0
"""MAVROS waits for the autopilot for 5 s."""
TRIES_COUNT = 3
FETCH_S = 9.0
"""Seconds for which a parameter that is not in the copy may wait for MAVROS to fetch it."""
PULL_S = 60.0
"""MAVROS waits for the list for 30 s. With ROS 1 it then gives each value to the master before it answers."""
PULLS_COUNT = 10
CHUNK_PARAMETERS = 200
"""Most values of one request."""
CALLS_AT_ONCE = 20
"""Most calls in progress where ROS 1 is requested each value."""
_READ, _WRITE = "read its parameters", "write a parameter"
_TYPES = {BOOL: ParameterType.UINT8, INTEGER: ParameterType.INT32, DOUBLE: ParameterType.REAL32}


class MavrosParameters(AutopilotParameters):
    """The parameters of one backend. MAVROS knows two types: whole (INT32) and real (REAL32)."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._names: frozenset[str] = frozenset()
        """Names of the last list; empty while there was none."""
        self._pulls_count = 0

    @property
    def is_pulling(self) -> bool:
        """Whether MAVROS fetches them, so that it has no whole copy."""
        return self._pulls_count > 0

    @property
    @override
    def relied_on(self) -> frozenset[str]:
        session = self._services.access.session()
        return frozenset() if session is None else session.autopilot.relied_on

    @override
    def read(self, name: str) -> Future[Parameter]:
        return self._services.give(_READ, lambda: self._read(name))

    @override
    def read_all(self) -> Future[list[Parameter]]:
        return self._services.give(_READ, lambda: then(self._list(), self._noted))

    @override
    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        return self._services.give(_WRITE, lambda: self._write(parameter, refusal, TRIES_COUNT, is_sent=False))

    # --- One ----------------------------------------------------------------------------------------------------------

    def _read(self, name: str) -> Future[Parameter]:
        """Reads from the copy. One that is not there is looked for once MAVROS has fetched all: what it has of a boot
        before may be a part. On the ground it then fetches all again.
        """
        copied = self._get(name)
        found = then_wait(copied, lambda one: self._fetched(name, is_forced=False) if one is None else done(one))
        return then_wait(found, lambda one: self._fetched_anew(name) if one is None else done(one))

    def _fetched_anew(self, name: str) -> Future[Parameter]:
        session = self._services.access.session()
        if session is None or session.telemetry.is_armed:
            raise unknown(name, self._names)
        return then(self._fetched(name, is_forced=True), lambda one: _known(one, name, self._names))

    def _fetched(self, name: str, *, is_forced: bool) -> Future[Parameter | None]:
        def get(answer: Message) -> Future[Parameter | None]:
            if not answer["success"]:
                text = f"MAVROS has not fetched all parameters yet ({answer['param_received']} so far): try again"
                raise UalTimeoutError(text, {"name": name})
            return self._get(name)

        return then_wait(self._pull(FETCH_S, is_forced=is_forced), get)

    def _get(self, name: str) -> Future[Parameter | None]:
        """Reads one from the copy; None where it is not there."""
        if self._is_ros2:
            return then(self._get_ros2([name]), lambda found: found[0] if found else None)
        answer = self._services.call(topics.GET_PARAMETER_ROS1, {"param_id": name}, CALL_S, _READ)
        return then_wait(answer, partial(self._typed, name))

    def _typed(self, name: str, answer: Message) -> Future[Parameter | None]:
        """Returns a value of ROS 1. Of 0 the answer does not say whether it is whole: the parameter server knows."""
        if not answer["success"]:
            return done(None)
        whole, real = int(answer["value"]["integer"]), number(answer["value"]["real"])
        if whole or real:
            return done(_parameter(name, whole or real))
        return then_wait(self._on_server(name), lambda found: self._zero(name, found))

    def _zero(self, name: str, on_server: object) -> Future[Parameter | None]:
        if on_server is not None:
            return done(_zero_of(name, on_server))
        pulled = self._pull(FETCH_S, is_forced=False)  # MAVROS gives the server what it has
        return then_wait(pulled, lambda _: then(self._on_server(name), partial(_zero_of, name)))

    def _on_server(self, name: str) -> Future[object]:
        """Reads from ROS 1's parameter server: a value, or all; None where it has none."""
        arguments = {"name": f"{self._services.access.node()}/param/{name}".rstrip("/"), "default": ""}
        answer = self._services.call(topics.GET_ON_SERVER, arguments, CALL_S, _READ)
        return then(answer, lambda found: json.loads(found["value"]))

    def _get_ros2(self, names: Sequence[str]) -> Future[list[Parameter]]:
        answer = self._services.call(topics.GET_PARAMETERS_ROS2, {"names": list(names)}, CALL_S, _READ)
        return then(answer, lambda found: list(_parameters(names, found["values"])))

    # --- All ----------------------------------------------------------------------------------------------------------

    def _list(self) -> Future[list[Parameter]]:
        pulled = self._pull(PULL_S, is_forced=True)
        whole = then_wait(pulled, lambda answer: self._whole(answer, 0, PULLS_COUNT))
        return then_wait(whole, self._list_ros2 if self._is_ros2 else self._list_ros1)

    def _pull(self, limit_s: float, *, is_forced: bool) -> Future[Message]:
        self._pulls_count += 1
        pulled = self._services.call(topics.PULL_PARAMETERS, {"force_pull": is_forced}, limit_s, _READ)
        pulled.add_done_callback(lambda _: self._end_pull())
        return pulled

    def _end_pull(self) -> None:
        self._pulls_count -= 1

    def _whole(self, answer: Message, before_count: int, pulls_count: int) -> Future[int]:
        """Waits on while MAVROS gets further. Returns how many it has."""
        count = int(answer["param_received"])
        if answer["success"]:
            return done(count)
        if count <= before_count or pulls_count <= 1:
            text = f"MAVROS has fetched {count} parameters, and gets no further: the link loses too much; try again"
            raise UalTimeoutError(text, {"count": str(count)})
        further = self._pull(PULL_S, is_forced=False)
        return then_wait(further, lambda again: self._whole(again, count, pulls_count - 1))

    def _list_ros2(self, _: int) -> Future[list[Parameter]]:
        def get(names: Sequence[str], found: list[Parameter]) -> Future[list[Parameter]]:
            if not names:
                return done(found)
            return then_wait(
                self._get_ros2(names[:CHUNK_PARAMETERS]), lambda some: get(names[CHUNK_PARAMETERS:], found + some)
            )

        def listed(answer: Message) -> Future[list[Parameter]]:
            return get(sorted(set(answer["result"]["names"]) - {self._checksum}), [])

        return then_wait(self._services.call(topics.LIST_PARAMETERS_ROS2, {}, CALL_S, _READ), listed)

    def _list_ros1(self, count: int) -> Future[list[Parameter]]:
        """Lists what MAVROS has just given to the parameter server. It counts PX4's checksum, and does not give it."""
        if not self._checksum:
            return self._list_from_server(count)
        checksum = self._services.call(topics.GET_PARAMETER_ROS1, {"param_id": self._checksum}, CALL_S, _READ)
        return then_wait(checksum, lambda answer: self._list_from_server(count - bool(answer["success"])))

    def _list_from_server(self, count: int) -> Future[list[Parameter]]:
        """Returns the values from the parameter server; where their count differs, each is asked for by name."""

        def listed(on_server: object) -> Future[list[Parameter]]:
            known = on_server if isinstance(on_server, dict) else {}
            found = [_parameter(name, value) for name, value in sorted(known.items()) if isinstance(value, int | float)]
            return done(found) if len(found) == count else self._checked([each.name for each in found], count)

        return then_wait(self._on_server(""), listed)

    @property
    def _checksum(self) -> str:
        session = self._services.access.session()
        return "" if session is None else session.autopilot.parameters_checksum

    def _checked(self, names: Sequence[str], count: int) -> Future[list[Parameter]]:
        """Returns those that are in the copy."""

        def get(left: Sequence[str], found: list[Parameter]) -> Future[list[Parameter]]:
            if not left:
                return done(_all_of(found, count))
            some = together([self._get(name) for name in left[:CALLS_AT_ONCE]])
            return then_wait(
                some, lambda read: get(left[CALLS_AT_ONCE:], found + [each for each in read if each is not None])
            )

        return get(names, [])

    def _noted(self, found: list[Parameter]) -> list[Parameter]:
        self._names = frozenset(each.name for each in found)
        return found

    # --- Writing ------------------------------------------------------------------------------------------------------

    def _write(self, wanted: Parameter, refusal: Refusal, tries_count: int, *, is_sent: bool) -> Future[Parameter]:
        error = refusal()
        if error is not None:
            raise in_doubt(error, wanted) if is_sent else error
        doubt = f"it is not known whether {wanted.name} is {wanted.text} now"
        answer = self._services.call(topics.SET_PARAMETER, self._arguments(wanted), SET_S, _WRITE, doubt)
        kept = caught(then(answer, partial(self._kept, wanted)), _unless_busy)
        return then_wait(kept, lambda found: self._verdict(found, wanted, refusal, tries_count - 1))

    def _arguments(self, wanted: Parameter) -> Message:
        is_whole = wanted.type.is_whole
        value = int(wanted.value) if is_whole else float(wanted.value)
        if self._is_ros2:
            kind = INTEGER if is_whole else DOUBLE
            return {"param_id": wanted.name, "value": {"type": kind, FIELDS[kind]: value}}
        return {"param_id": wanted.name, "value": {"integer" if is_whole else "real": value}}

    def _kept(self, wanted: Parameter, answer: Message) -> Parameter | None:
        """Returns what the autopilot has answered; None where it has not."""
        if not answer["success"]:
            return None
        if self._is_ros2:
            return next(_parameters([wanted.name], [answer["value"]]), None)
        value = answer["value"]
        found = int(value["integer"]) if wanted.type.is_whole else number(value["real"])
        return _parameter(wanted.name, found)

    def _verdict(
        self, kept: Parameter | None, wanted: Parameter, refusal: Refusal, tries_count: int
    ) -> Future[Parameter]:
        if kept is not None and kept.value == wanted.value:
            return done(kept)
        if tries_count > 0:  # a value of before may have come late
            again = partial(self._write, wanted, refusal, tries_count, is_sent=True)
            return then_wait(self._services.pause(BUSY_RETRY_S), lambda _: again())
        raise unconfirmed(wanted, "not confirmed", TRIES_COUNT) if kept is None else not_kept(wanted, kept)

    @property
    def _is_ros2(self) -> bool:
        return self._services.access.ros() is RosGeneration.ROS2


def _known(found: Parameter | None, name: str, names: frozenset[str]) -> Parameter:
    if found is None:
        raise unknown(name, names)
    return found


def _unless_busy(error: BaseException) -> Future[Parameter | None]:
    """MAVROS refuses to write while it fetches the list: the request is repeated."""
    if isinstance(error, BusyError):
        return done(None)
    raise error


def _parameter(name: str, value: float) -> Parameter:
    """Returns a parameter by what ROS has of it: an int, or a float of 32 bits in 64."""
    if isinstance(value, int):
        return Parameter(name, value, ParameterType.INT32)
    return Parameter(name, real32(value), ParameterType.REAL32)


def _parameters(names: Sequence[str], values: Sequence[Message]) -> Iterator[Parameter]:
    """Yields those of ROS 2's values that are set."""
    for name, value in zip(names, values, strict=False):
        kind = int(value["type"])
        if kind in _TYPES:
            read = value[FIELDS[kind]]
            yield Parameter(name, int(read) if _TYPES[kind].is_whole else real32(number(read)), _TYPES[kind])


def _zero_of(name: str, on_server: object) -> Parameter | None:
    return _parameter(name, 0 if isinstance(on_server, int) else 0.0)


def _all_of(found: list[Parameter], count: int) -> list[Parameter]:
    if len(found) != count:
        text = f"{len(found)} of {count} parameters could be read: try again"
        raise UalTimeoutError(text, {"count": str(count)})
    return found
