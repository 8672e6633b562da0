"""Questions to a Crazyflie before it can be flown, step by step."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field

from ual_daemon import logs
from ual_daemon.backends.crazyflie import log_blocks, toc
from ual_daemon.backends.crazyflie.log_blocks import Block
from ual_daemon.backends.crazyflie.packets import (
    LOG,
    PARAMETER,
    PLATFORM,
    READ_CHANNEL,
    VERSION_CHANNEL,
    WRITE_CHANNEL,
    CrtpPacket,
)
from ual_daemon.backends.crazyflie.requests import CrtpRequest
from ual_daemon.backends.crazyflie.settings import CrazyflieSettings
from ual_daemon.backends.crazyflie.telemetry import ESTIMATOR, POSITIONING_DECKS
from ual_daemon.backends.crazyflie.toc import Toc, TocCache

_log = logging.getLogger(__name__)

ALWAYS_SET = {"commander.enHighLevel": 1.0}
"""Older firmwares need it, and say nothing; newer ones do not have it."""
CONTROLLER = "stabilizer.controller"
GAINS = ("posCtlPid.xKp", "posCtlPid.yKp", "posCtlPid.zKp", "pid_attitude.yaw_kp")
SPEEDS = ("posCtlPid.xVelMax", "posCtlPid.yVelMax", "posCtlPid.zVelMax")
READ = (CONTROLLER, ESTIMATOR, *GAINS, *SPEEDS, *POSITIONING_DECKS)
"""The parameters that are read, as far as the firmware has them."""
_VALUE_OFFSET = 3
ASK_PROTOCOL = CrtpRequest(CrtpPacket(PLATFORM, VERSION_CHANNEL, b"\0"), b"\0")
ASK_VERSION = CrtpRequest(CrtpPacket(PLATFORM, VERSION_CHANNEL, b"\1"), b"\1")

Steps = Generator[Sequence[CrtpRequest], list[bytes], "CrazyflieFirmware"]
"""Yields requests, and gets their answers in the same order."""


class UnfitError(Exception):
    """A firmware cannot be flown by UAL; says why, human-readable."""


@dataclass(frozen=True, slots=True)
class CrazyflieFirmware:
    """Firmware of one Crazyflie: protocol, log blocks and parameters."""

    protocol: int = 0
    blocks: tuple[Block, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    table: Toc = field(default_factory=dict)
    """Of all its parameters."""


def steps(
    settings: CrazyflieSettings,
    cache: TocCache,
    tell: Callable[[str], None],
    known: CrazyflieFirmware | None,
    *,
    is_watch_only: bool = False,
) -> Steps:
    """Asks for everything. `tell` gets what is being done, in words. `known` is the firmware before the link was lost.

    With `is_watch_only` no parameter is set, and the log blocks of other programs stay.

    Raises:
        UnfitError: The firmware lacks something that is needed.
    """
    tell("waiting for its answer")
    (answer,) = yield [ASK_PROTOCOL]
    protocol = answer[1] if len(answer) > 1 else 0
    if known is not None and known.protocol == protocol:
        (started,) = yield [log_blocks.ask_start(known.blocks[0])]
        if log_blocks.result(started) == 0:  # it has not rebooted
            return known
    log_toc = yield from _table(LOG, cache, tell)
    _require(log_toc)
    parameter_toc = yield from _table(PARAMETER, cache, tell)
    if not is_watch_only:
        tell("setting parameters")
        yield from _set_parameters(parameter_toc, {**ALWAYS_SET, **settings.parameters})
    parameters = yield from _read_parameters(parameter_toc)
    tell("starting the log")
    first_ident = log_blocks.FIRST_OBSERVER_BLOCK_ID if is_watch_only else 0
    blocks = log_blocks.make_blocks(log_toc, settings.pose_rate_hz, first_ident)
    yield [log_blocks.ask_deletion(block) for block in blocks] if is_watch_only else [log_blocks.ask_reset()]
    yield from _start_log(log_toc, blocks)
    return CrazyflieFirmware(protocol, blocks, parameters, parameter_toc)


def _table(
    port: int, cache: TocCache, tell: Callable[[str], None]
) -> Generator[Sequence[CrtpRequest], list[bytes], Toc]:
    """Reads a table of contents, from the cache if it is there."""
    info = toc.read_info((yield [toc.ask_info(port)])[0])
    cached = cache.load(port, info)
    if cached is not None:
        return cached
    found: dict[str, toc.Variable] = {}
    for first in range(0, info.size, _BATCH_VARIABLES):
        tell(f"reading its table of {toc.KINDS[port]} variables, {first} of {info.size}")
        batch = range(first, min(first + _BATCH_VARIABLES, info.size))
        answers = yield [toc.ask_item(port, ident) for ident in batch]
        found.update(item for item in (toc.read_item(port, data) for data in answers) if item is not None)
    cache.save(port, info, found)
    return found


_BATCH_VARIABLES = 32


def _require(log_toc: Toc) -> None:
    lacking = toc.missing(log_toc, iter(log_blocks.REQUIRED))
    if lacking:
        raise UnfitError(f"this firmware does not log {', '.join(lacking)}: update it")
    optional = toc.missing(log_toc, (each.name for each in log_blocks.MOTION + log_blocks.STATUS))
    if optional:
        logs.event(_log, logging.INFO, "log_variables_missing", variables=", ".join(optional))


def _set_parameters(table: Toc, wanted: Mapping[str, float]) -> Generator[Sequence[CrtpRequest], list[bytes], None]:
    settable = {name: value for name, value in wanted.items() if name in table and not table[name].is_read_only}
    refused = sorted(wanted.keys() - settable.keys() - ALWAYS_SET.keys())
    if refused:
        logs.event(_log, logging.WARNING, "parameters_not_set", parameters=", ".join(refused))
    yield [ask_write(table[name], value) for name, value in settable.items()]


def ask_write(variable: toc.Variable, value: float) -> CrtpRequest:
    """Returns the request that writes a parameter."""
    ident = struct.pack("<H", variable.ident)
    number = value if variable.format in "efd" else round(value)
    return CrtpRequest(CrtpPacket(PARAMETER, WRITE_CHANNEL, ident + struct.pack(f"<{variable.format}", number)), ident)


def _read_parameters(table: Toc) -> Generator[Sequence[CrtpRequest], list[bytes], dict[str, float]]:
    present = [name for name in READ if name in table]
    answers = yield [ask_read(table[name]) for name in present]
    values = {}
    for name, data in zip(present, answers, strict=True):
        value = value_of(table[name], data)
        if value is not None:
            values[name] = float(value)
    return values


def value_of(variable: toc.Variable, data: bytes) -> float | None:
    """Returns the value of a parameter in the answer to `ask_read`; None where it has none."""
    layout = struct.Struct(f"<{variable.format}")
    if len(data) != _VALUE_OFFSET + layout.size:
        return None
    found: float = layout.unpack_from(data, _VALUE_OFFSET)[0]
    return found


def ask_read(variable: toc.Variable) -> CrtpRequest:
    """Returns the request that reads a parameter."""
    ident = struct.pack("<H", variable.ident)
    return CrtpRequest(CrtpPacket(PARAMETER, READ_CHANNEL, ident), ident)


def _start_log(table: Toc, blocks: Sequence[Block]) -> Generator[Sequence[CrtpRequest], list[bytes], None]:
    for block in blocks:
        for request in log_blocks.ask_creation(block, table):
            (answer,) = yield [request]
            error = log_blocks.result(answer)
            if error not in (0, log_blocks.EEXIST_ERROR):
                raise UnfitError(f"it refuses a log block (error {error})")
        yield [log_blocks.ask_start(block)]
