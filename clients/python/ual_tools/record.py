"""``ual record`` records the telemetry of UAVs, and tells and exports what is in a recording; ``ual plot`` draws it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual.errors import InvalidArgumentError
from ual.recording import requirements
from ual.shared import extras
from ual_tools.app import UalCommand, UalGroup, command
from ual_tools.help import Section
from ual_tools.selection import several
from ual_tools.session import REFUSED_STATUS, CommandSession, pass_session
from ual_tools.tables import print_table
from ual_tools.values import Number

if TYPE_CHECKING:
    from ual_tools.recording.autopilot_log import LogTrack
    from ual_tools.recording.client import ClientRecording
    from ual_tools.recording.page import DrawnFlight
    from ual_tools.recording.summary import Summary

_POLL_PERIOD_S = 0.2
_DRAWINGS = (".pdf", ".png", ".svg")
_FILE = click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))


@click.group(
    "record",
    cls=UalGroup,
    section=Section.LOOKING,
    invoke_without_command=True,
    examples=(
        "ual record",
        "ual record --all --directory flights",
        "ual record --pictures",
        "ual record info flight.mcap",
        "ual record export flight.mcap --csv --kml",
    ),
)
@click.option(
    "--directory",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path(),
    metavar="DIR",
    help="Where the file is made; here when not given.",
)
@click.option(
    "--duration", "duration_s", type=Number(min=0.0, min_open=True), metavar="SECONDS", help="End after this time."
)
@click.option("--pictures", "has_pictures", is_flag=True, help="Record what its cameras take, too.")
@click.pass_context
def record(context: click.Context, directory: Path, duration_s: float | None, has_pictures: bool) -> None:
    """Record the telemetry of the UAV until Ctrl-C.

    With --all, or --ns uav_1,uav_2, that of each of these UAVs goes into one file. The daemon records more: ual-daemon
    --record.
    """
    if context.invoked_subcommand is not None:
        return
    session = context.find_root().ensure_object(CommandSession)
    requirements.require("ual-tools[record]")
    with ExitStack() as stack:
        recording = _begin(session, directory, stack, has_pictures=has_pictures)
        session.note(f"recording {', '.join(recording.uavs)} into {recording.path}; Ctrl-C ends it")
        _wait(duration_s)
    _report(session, recording)
    if recording.trouble:
        raise click.exceptions.Exit(REFUSED_STATUS)


def _begin(session: CommandSession, directory: Path, stack: ExitStack, *, has_pictures: bool) -> ClientRecording:
    """Subscribes to the chosen UAVs until the stack ends. Returns the recording, which ends after them."""
    from ual_tools.recording.client import ClientRecording

    daemons = several(session)
    if daemons is None:
        uavs = [stack.enter_context(session.connect())]
    else:
        uavs = [stack.enter_context(session.connect_to(daemon)) for daemon in daemons]
    for uav in uavs:
        uav.info()  # before a file is made: it may not answer
    recording = ClientRecording(directory, uavs[0].ns if daemons is None else "several")
    stack.callback(recording.close)
    for uav in uavs:
        stack.callback(recording.subscribe(uav))
        stack.callback(recording.record_carried(uav))
        if has_pictures:
            stack.callback(recording.record_pictures(uav))
    return recording


def _wait(duration_s: float | None) -> None:
    end_s = None if duration_s is None else time.monotonic() + duration_s
    pause = threading.Event()
    try:
        while end_s is None or time.monotonic() < end_s:
            pause.wait(_POLL_PERIOD_S if end_s is None else min(_POLL_PERIOD_S, max(0.0, end_s - time.monotonic())))
    except KeyboardInterrupt:
        return


def _report(session: CommandSession, recording: ClientRecording) -> None:
    missed_count = recording.missed_count + recording.lost_count
    text = f"{recording.samples_count} samples of {', '.join(recording.uavs)}"
    text += f", {missed_count} missed" if missed_count else ""
    pictures_count, without_count, reason = recording.pictures
    text += f", {pictures_count} pictures" if pictures_count else ""
    text += f", {without_count} of them without their bytes ({reason})" if without_count else ""
    values = {"file": str(recording.path), "samples_count": recording.samples_count, "missed_count": missed_count}
    values |= {"pictures_count": pictures_count, "pictures_without_bytes_count": without_count}
    session.emit_written(values, f"{recording.path}: {text}")


@record.command("info", cls=UalCommand, examples=("ual record info flight.mcap",))
@_FILE
@pass_session
def info(session: CommandSession, file: Path) -> None:
    """Tell what is in the recording FILE."""
    from ual.recording.reader import Recording
    from ual_tools.recording.summary import summarize

    summary = summarize(Recording(file))
    session.emit(summary)
    if not session.as_json:
        _print_summary(summary)


def _print_summary(summary: Summary) -> None:
    end = "" if summary.is_whole else ", without its end (killed, or still recording)"
    click.echo(f"{summary.file}: {_times(summary)}, {summary.size_bytes / 1e6:.1f} MB{end}")
    for ns, uav in sorted(summary.uavs.items()):
        click.echo(f"{ns}: {' '.join(uav.states) or 'no state'}")
        calls = ", ".join(f"{what} {count}" for what, count in sorted(uav.calls.items()))
        if calls:
            click.echo(f"{ns}: calls: {calls}")
    rows = [
        (each.topic, each.schema, str(each.count), "" if each.rate_hz is None else f"{each.rate_hz:.1f}")
        for each in sorted(summary.topics.values(), key=lambda topic: topic.topic)
    ]
    print_table(("topic", "schema", "messages", "Hz"), rows)


def _times(summary: Summary) -> str:
    if summary.began_s is None or summary.ended_s is None:
        return "no messages"
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(summary.began_s))
    return f"from {began} UTC, {summary.ended_s - summary.began_s:.1f} s"


@record.command("export", cls=UalCommand, examples=("ual record export flight.mcap --csv --kml",))
@_FILE
@click.option("--csv", "as_csv", is_flag=True, help="A table of each UAV's telemetry.")
@click.option("--parquet", "as_parquet", is_flag=True, help="The same table as Parquet.")
@click.option("--kml", "as_kml", is_flag=True, help="The track of each UAV, for Google Earth and GIS.")
@click.option("--gpx", "as_gpx", is_flag=True, help="The track of each UAV with times, for maps.")
@click.option(
    "--directory",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Target directory; default: that of FILE.",
)
@pass_session
def export(
    session: CommandSession,
    file: Path,
    as_csv: bool,
    as_parquet: bool,
    as_kml: bool,
    as_gpx: bool,
    directory: Path | None,
) -> None:
    """Make tables and tracks of FILE.

    Tables have a row for each sample of the telemetry, tracks the places where the UAVs flew.
    """
    if not (as_csv or as_parquet or as_kml or as_gpx):
        raise click.UsageError("say as what: --csv, --parquet, --kml, --gpx")
    target = file.parent if directory is None else directory
    try:
        target.mkdir(parents=True, exist_ok=True)
        exported = _exported(file, target, as_csv=as_csv, as_parquet=as_parquet, as_kml=as_kml, as_gpx=as_gpx)
    except OSError as error:
        raise InvalidArgumentError(f"cannot write {error.filename or target}: {error.strerror}") from None
    for path, count, what in exported:
        session.emit_written({"file": str(path), "count": count}, f"{path}: {count} {what}")


def _exported(
    file: Path, target: Path, *, as_csv: bool, as_parquet: bool, as_kml: bool, as_gpx: bool
) -> list[tuple[Path, int, str]]:
    """Writes the files. Returns each with the number of what is in it."""
    from ual.recording import reader
    from ual_tools.recording import tables, tracks

    recording = reader.Recording(file)
    done = []
    uavs = recording.uavs()
    if not uavs:
        raise InvalidArgumentError(f"{file} has no telemetry", {"field": "file"})
    for ns in uavs:
        for is_wanted, ending, write in (
            (as_csv, "csv", tables.write_csv),
            (as_parquet, "parquet", tables.write_parquet),
        ):
            if is_wanted:
                path = target / f"{file.stem}_{ns}.{ending}"
                wanted = f"/{ns}/telemetry"
                done.append((path, write(path, tables.rows(recording.messages(wanted.__eq__))), "rows"))
    if as_kml or as_gpx:
        found = tracks.tracks(recording.messages(lambda topic: topic.endswith("/telemetry")))
        points_count = sum(map(len, found.values()))
        writers: tuple[tuple[bool, str, Callable[..., None]], ...] = (
            (as_kml, "kml", tracks.write_kml),
            (as_gpx, "gpx", tracks.write_gpx),
        )
        for is_wanted, ending, write_track in writers:
            if is_wanted:
                path = target / f"{file.stem}.{ending}"
                write_track(path, found, file.stem)
                done.append((path, points_count, "points"))
    return done


@command(
    "plot",
    "ual plot flight.mcap",
    "ual plot flight.mcap --output flight.pdf",
    "ual plot flight.mcap --log uav_1_00000007.BIN",
    section=Section.LOOKING,
)
@_FILE
@click.option(
    "--output", type=click.Path(dir_okay=False, path_type=Path), help="PNG, SVG or PDF; FILE.png when not given."
)
@click.option(
    "--log",
    "log_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="The autopilot's log of the same flight (.ulg, .bin), drawn next to the recording.",
)
@pass_session
def plot(session: CommandSession, file: Path, output: Path | None, log_file: Path | None) -> None:
    """Draw a recorded flight on one page.

    It has the ground track, height, speed, states, tasks and refusals. Where the recording has several UAVs, they are
    drawn in map, the frame that they share.
    """
    from ual.recording.reader import Recording
    from ual_tools.recording import page

    target = file.with_suffix(".png") if output is None else output
    if target.suffix.lower() not in _DRAWINGS:
        raise click.BadParameter(f"{target} ends in none of {', '.join(_DRAWINGS)}", param_hint="--output")
    with extras.needs("ual plot", "ual-tools[plot]"):
        import matplotlib as mpl  # noqa: F401
    requirements.require_reading("ual plot", "ual-tools[plot]")
    is_in_map = len(Recording(file).uavs()) > 1
    messages = Recording(file).messages(lambda topic: topic.endswith(("/telemetry", "/calls")))
    drawn = page.flights(messages, is_in_map=is_in_map)
    if not drawn:
        raise InvalidArgumentError(f"{file} has no telemetry", {"field": "file"})
    log = None if log_file is None else _aligned_track(drawn, log_file, file)
    try:
        page.draw(drawn, target, file.stem, log)
    except OSError as error:
        raise InvalidArgumentError(f"cannot write {target}: {error.strerror}") from None
    session.emit_written({"file": str(target)}, str(target))


def _aligned_track(drawn: list[DrawnFlight], log_file: Path, recording: Path) -> LogTrack:
    """Returns the track in a log of the autopilot, laid over the flight that was recorded."""
    from ual.recording.reader import Recording
    from ual_tools.recording import autopilot_log

    if log_file.suffix.lower() not in autopilot_log.ENDINGS:
        text = f"{log_file} ends in none of {', '.join(autopilot_log.ENDINGS)}"
        raise click.BadParameter(text, param_hint="--log")
    if len(drawn) != 1:
        raise InvalidArgumentError(f"{recording} has {len(drawn)} UAVs, and a log is of one", {"field": "log"})
    with extras.needs("ual plot --log", "ual-tools[logs]"):
        autopilot_log.require()
    [flight] = drawn
    begin_ns = next(Recording(recording).messages(lambda topic: topic.endswith(("/telemetry", "/calls")))).log_ns
    track = autopilot_log.laid_over(autopilot_log.read(log_file), flight.times_s, flight.speeds, begin_ns * 1e-9)
    moved, _ = autopilot_log.placed(track, flight.times_s, (flight.xs, flight.ys, flight.heights))
    return moved


COMMANDS = (record, plot)
