"""Tables of a recording's telemetry (``ual record export --csv``, ``--parquet``): one row for each sample."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from ual.geometry import Pose
from ual.recording.reader import Message
from ual.shared import extras, whole_file
from ual.types import Telemetry

Cell = str | float | int | bool | None
_Column = Callable[[Telemetry], Cell]
_BATCH_ROWS_COUNT = 10_000


def _xyz(prefix: str, pose: Callable[[Telemetry], Pose | None]) -> dict[str, _Column]:
    """Returns the columns of a pose."""

    def column(read: Callable[[Pose], float]) -> _Column:
        def cell(sample: Telemetry) -> Cell:
            found = pose(sample)
            return None if found is None else read(found)

        return cell

    return {
        f"{prefix}x_m": column(lambda p: p.position.x),
        f"{prefix}y_m": column(lambda p: p.position.y),
        f"{prefix}z_m": column(lambda p: p.position.z),
        f"{prefix}yaw_rad": column(lambda p: p.yaw_rad),
    }


COLUMNS: Mapping[str, _Column] = {
    "stamp_s": lambda t: t.stamp_s or None,
    "sequence": lambda t: t.sequence,
    "state": lambda t: t.state.name,
    "state_reason": lambda t: t.state_reason,
    "flight_mode": lambda t: t.flight_mode,
    "armed": lambda t: t.armed,
    "frame_id": lambda t: t.frame_id,
    **_xyz("", lambda t: t.pose),
    "vx_m_s": lambda t: None if t.velocity is None else t.velocity.linear.x,
    "vy_m_s": lambda t: None if t.velocity is None else t.velocity.linear.y,
    "vz_m_s": lambda t: None if t.velocity is None else t.velocity.linear.z,
    "yaw_rate_rad_s": lambda t: None if t.velocity is None else t.velocity.angular.z,
    **_xyz("reference_", lambda t: t.reference_pose),
    "latitude_deg": lambda t: None if t.position_geo is None else t.position_geo.latitude_deg,
    "longitude_deg": lambda t: None if t.position_geo is None else t.position_geo.longitude_deg,
    "altitude_amsl_m": lambda t: None if t.position_geo is None else t.position_geo.altitude_amsl_m,
    "battery_percent": lambda t: None if t.battery is None else t.battery.remaining_percent,
    "battery_v": lambda t: None if t.battery is None else t.battery.voltage_v,
    "satellites_count": lambda t: None if t.gps is None else t.gps.satellites_count,
    "task": lambda t: "" if t.task is None else t.task.kind.name,
    "task_id": lambda t: "" if t.task is None else t.task.id,
    "task_progress": lambda t: None if t.task is None else t.task.progress,
    "status_text": lambda t: t.status_text,
}
"""The columns, after `time_s`: when the sample was recorded, UTC since 1970."""
HEADER = ("time_s", *COLUMNS)


def rows(messages: Iterable[Message]) -> Iterator[list[Cell]]:
    """Yields the rows of the telemetry among the messages."""
    for message in messages:
        if message.name == "telemetry":
            sample = message.telemetry()
            yield [message.log_ns * 1e-9, *(column(sample) for column in COLUMNS.values())]


def write_csv(path: Path, table: Iterable[list[Cell]]) -> int:
    """Writes a table as CSV. Returns the number of its rows."""
    count = 0
    with whole_file.writing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        for row in table:
            writer.writerow(row)
            count += 1
    return count


def write_parquet(path: Path, table: Iterable[list[Cell]]) -> int:
    """Writes a table as Parquet. Returns the number of its rows.

    Raises:
        NotSupportedError: The extra is not installed.

    """
    with extras.needs("--parquet", "ual-tools[parquet]"):
        import pyarrow as pa
        from pyarrow import parquet
    texts = {"state", "state_reason", "flight_mode", "frame_id", "task", "task_id", "status_text"}
    others = {"sequence": pa.int64(), "armed": pa.bool_(), "satellites_count": pa.int64()}
    kinds = [(name, pa.string() if name in texts else others.get(name, pa.float64())) for name in HEADER]
    schema = pa.schema(kinds)
    count = 0
    with whole_file.writing(path) as part, parquet.ParquetWriter(part, schema) as writer:
        for batch in _batches(table):
            count += len(batch)
            columns = [
                pa.array(column, kind) for column, (_, kind) in zip(zip(*batch, strict=True), kinds, strict=True)
            ]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))
    return count


def _batches(table: Iterable[list[Cell]]) -> Iterator[list[list[Cell]]]:
    batch: list[list[Cell]] = []
    for row in table:
        batch.append(row)
        if len(batch) >= _BATCH_ROWS_COUNT:
            yield batch
            batch = []
    if batch:
        yield batch
