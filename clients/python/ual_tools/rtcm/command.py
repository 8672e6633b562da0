"""`ual rtcm`: passes corrections on until Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import click
from typing_extensions import Self

from ual.corrections import CorrectionsStatus
from ual.errors import DaemonUnreachableError, LinkLostError, UalError
from ual.shared.guard import WorkGuard
from ual.types import GeoPoint, GpsInfo
from ual_tools import values
from ual_tools.app import command
from ual_tools.help import Section
from ual_tools.rtcm.ntrip import NtripSource, Position, parse_caster
from ual_tools.rtcm.reader import CorrectionsReader
from ual_tools.rtcm.source import CorrectionsSource, serial_source, tcp_source
from ual_tools.session import CommandSession, pass_session

if TYPE_CHECKING:
    from ual import Uav

RETRY_S = 2.0
STATUS_S = 10.0


@command(
    "rtcm",
    "ual rtcm --serial /dev/ttyACM0:115200",
    "ual rtcm --tcp 192.168.1.20:2102",
    "ual rtcm --ntrip ntrip://user@caster.example.org:2101/MOUNT",
    section=Section.AUTOPILOT,
)
@click.option("--serial", metavar="PORT[:BAUD]", help="A base station at a serial port (115200 baud unless given).")
@click.option("--tcp", metavar="HOST:PORT", help="A base station that sends to whoever connects.")
@click.option(
    "--ntrip", metavar="URL", help="A mount point of a caster: ntrip://user@host:2101/MOUNT (ntrips:// with TLS)."
)
@click.option(
    "--gga",
    "gga_s",
    type=click.IntRange(0, 3600),
    metavar="SECONDS",
    help="Seconds between reports of the position to the caster (0: none). Default: 10 s where its table requires it.",
)
@click.option(
    "--status",
    "status_s",
    type=values.number,
    default=STATUS_S,
    show_default=True,
    help="How often the status is printed (s).",
)
@pass_session
def rtcm(
    session: CommandSession, serial: str | None, tcp: str | None, ntrip: str | None, gga_s: int | None, status_s: float
) -> None:
    """Send corrections (RTCM 3) to the UAV until Ctrl-C.

    A source that breaks is opened again, and so is the way to the daemon. The password of a caster is better given by
    $UAL_NTRIP_PASSWORD than in the address.
    """
    if sum(each is not None for each in (serial, tcp, ntrip)) != 1:
        raise click.UsageError("give one of --serial, --tcp and --ntrip")
    if not 0.1 <= status_s <= 3600.0:
        raise click.UsageError(f"--status: {status_s:g} is not between 0.1 and 3600")
    with session.connect(with_lease=False) as uav:
        source = _source(serial, tcp, ntrip, gga_s, _position_of(uav))
        with (
            CorrectionsReader(source, session.tell) as reader,
            _Sending(uav, reader, source.name, session.tell) as sending,
        ):
            try:
                while not sending.is_over.wait(status_s):
                    _show(session, uav, "")
            finally:  # Ctrl-C ends it
                _show(session, uav, "rtcm")
        if sending.failure is not None:
            raise sending.failure


def _source(
    serial: str | None, tcp: str | None, ntrip: str | None, gga_s: int | None, position: Position
) -> CorrectionsSource:
    if serial is not None:
        return serial_source(serial)
    if tcp is not None:
        return tcp_source(tcp)
    return NtripSource(parse_caster(ntrip or ""), position, gga_s)


def _position_of(uav: Uav) -> Callable[[], GeoPoint | None]:
    def position() -> GeoPoint | None:
        try:
            return uav.telemetry().position_geo
        except UalError:  # the status and the stream say why
            return None

    return position


class _Sending:
    """The thread that sends. `is_over` is set where it cannot go on; `failure` then says why."""

    def __init__(self, uav: Uav, reader: CorrectionsReader, sender: str, tell: Callable[[str], object]) -> None:
        self.is_over = threading.Event()
        self.failure: UalError | None = None
        self._uav = uav
        self._reader = reader
        self._sender = sender
        self._tell = tell
        self._guard = WorkGuard("corrections")
        self._thread = threading.Thread(target=self._run, name="corrections", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.is_over.set()
        self._thread.join(RETRY_S)

    def _run(self) -> None:
        while not self.is_over.is_set():
            try:
                self._uav.corrections.stream(self._reader.chunks(self.is_over), self._sender)
                self.failure = self._reader.failure
                break
            except (DaemonUnreachableError, LinkLostError) as error:
                self._tell(f"{error.message}; trying again in {RETRY_S:g} s")
                self.is_over.wait(RETRY_S)
            except UalError as error:
                self.failure = error
                break
            except Exception as error:  # noqa: BLE001  the command must end, and say why
                self._guard.note(error)
                self.failure = UalError(f"the corrections have ended by a defect: {self._guard.last_cause}")
                break
        self.is_over.set()


def _show(session: CommandSession, uav: Uav, done: str) -> None:
    try:
        status, gps = uav.corrections.status(), uav.telemetry().gps
    except UalError as error:
        session.tell(error.message)
        return
    shown = {**({"done": done} if done else {}), "status": status, "gps": gps}
    session.emit(shown, _text(status, gps))


def _text(status: CorrectionsStatus, gps: GpsInfo | None) -> str:
    lost = {
        "dropped": status.dropped_count,
        "too long": status.too_long_count,
        "bytes skipped": status.skipped_bytes_count,
    }
    parts = [f"{status.messages_count} messages ({status.bytes_count / 1000.0:.1f} kB) sent"]
    parts += [f"{count} {what}" for what, count in lost.items() if count]
    if gps is not None:
        parts.append(f"fix {gps.fix.name}")
    if status.age_s is not None:
        parts.append(f"the last one {status.age_s:.1f} s ago")
    return ", ".join(parts)


COMMANDS = (rtcm,)
