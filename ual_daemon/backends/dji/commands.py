"""Commands as calls of the wrapper's services, and what their answers say."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from ual_daemon.backends.dji.wrappers import DjiCall, Wrapper
from ual_daemon.backends.engine.command import FLYING, Command, Verdict
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.values import Control, Mode

TEXT_S = 0.3
"""Seconds after a refusal within which the wrapper's texts about it may come."""


@dataclass(slots=True)
class Grant:
    """Control authority that one command has obtained, and whether the following service was called."""

    is_obtained: bool = False
    is_used: bool = False


class DjiRequest(NamedTuple):
    """A service to call, and the authority that it uses, if that was obtained for it."""

    call: DjiCall
    grant: Grant | None = None


def request(what: str, call: DjiCall, group: str = FLYING, grant: Grant | None = None) -> Command[DjiRequest]:
    """Calls a service, once. The motors, too, obey the present controller only."""
    return Command(what, DjiRequest(call, grant), group, own_modes=_follows_us)


def landing(call: DjiCall, on_done: Callable[[], None]) -> Command[DjiRequest]:
    """Begins DJI's own landing, which needs no control authority."""
    return Command("land", DjiRequest(call), FLYING, own_modes=_lands, on_done=on_done)


def _follows_us(mode: Mode) -> bool:
    """Returns whether the aircraft follows us in a mode: the names of its modes change by our own commands."""
    return mode.control in (Control.REFERENCES, Control.TAKE_OFF)


def _lands(mode: Mode) -> bool:
    """Returns whether a landing of ours may show a mode: until it begins, the aircraft follows us."""
    return mode.control is Control.LAND or _follows_us(mode)


def obtaining(
    wrapper: Wrapper, on_done: Callable[[DjiCall], None], then: Command[DjiRequest] | None
) -> Command[DjiRequest]:
    """Obtains the control authority, by one service after another, and goes on with a command."""
    for call in reversed(wrapper.obtain):
        done = partial(on_done, call)
        what = "obtain the control authority"
        then = Command(what, DjiRequest(call), FLYING, own_modes=_follows_us, on_done=done, then=then)
    assert then is not None
    return then


class DjiReply(NamedTuple):
    """Verdict and text of an answer; see `CommandRunner.on_answer`."""

    verdict: Verdict
    text: str = ""


def read_answer(answer: Future[Message]) -> DjiReply:
    """Reads the answer of a service. One that has not answered may have been executed."""
    error = answer.exception()
    if isinstance(error, ServiceTimeoutError):
        return DjiReply(Verdict.LOST)
    if isinstance(error, ServiceError):
        return DjiReply(Verdict.REFUSED, str(error))
    values = answer.result()
    is_done = values.get("success", values.get("result", False))
    return DjiReply(Verdict.ACCEPTED) if is_done else DjiReply(Verdict.REFUSED, _text_of(values))


def _text_of(values: Message) -> str:
    """Returns why a service has refused, as far as its answer says it."""
    numbers = [f"{name} {values[name]}" for name in ("cmd_set", "cmd_id", "ack_data") if name in values]
    return str(values.get("message") or "") or (f"DJI's answer is {', '.join(numbers)}" if numbers else "")
