"""Between the bytes that cross the network and the values of `ual.network`."""

from __future__ import annotations

import math
import re

from google.protobuf.message import DecodeError

from ual.errors import UalError
from ual.network.values import Report, Teller, UavReport
from ual.shared.text import printable
from ual.types import Telemetry
from ual.v1 import network_pb2 as pb
from ual.v1 import ual_pb2
from ual.wire import convert, samples

_NAMESPACE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
_ADDRESS = re.compile(r"unix:\S{1,200}|(?:\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9._-]{1,255}):[0-9]{1,5}")
_MOST_ADDRESSES = 8
_LEAST_RATE_HZ, _MOST_RATE_HZ = 1e-3, 1e3


def report_to_bytes(report: Report) -> bytes:
    """Returns a report as it is sent."""
    teller = report.teller
    message = pb.NetworkReport(
        ual_version=teller.ual_version,
        host=teller.host,
        computer_id=teller.computer_id,
        pid=teller.pid,
        rate_hz=teller.rate_hz,
        uav_count=teller.uav_count,
    )
    convert.stamp_to_proto(teller.started_s, message.started)
    for uav in report.uavs:
        _write_uav(uav, message.uavs.add())
    return message.SerializeToString()


def report_from_bytes(data: bytes) -> Report:
    """Reads a report. Its sender may be anybody: texts are made printable, and whatever is no report is refused.

    Raises:
        ValueError: It is none.

    """
    message = pb.NetworkReport()
    try:
        message.ParseFromString(data)
        return Report(_read_teller(message), tuple(map(_read_uav, message.uavs)))
    except (DecodeError, UalError) as error:
        raise ValueError(str(error)) from None


def small(telemetry: Telemetry) -> Telemetry:
    """Returns the part of a sample that is reported over the network."""
    t = telemetry
    return Telemetry(
        state=t.state,
        state_reason=t.state_reason,
        stamp_s=t.stamp_s,
        frame_id=t.frame_id,
        velocity=t.velocity,
        transform=t.transform,
        position_geo=t.position_geo,
        battery=t.battery,
        flight_mode=t.flight_mode,
        armed=t.armed,
        task=t.task,
        sequence=t.sequence,
        frame_lost=t.frame_lost,
        health=t.health,
    )


def _write_uav(uav: UavReport, message: pb.NetworkUav) -> None:
    message.namespace = uav.ns
    message.backend = uav.backend
    message.addresses.extend(uav.addresses)
    message.has_tls = uav.has_tls
    message.needed_role = uav.needed_role
    message.is_watch_only = uav.is_watch_only
    samples.write_telemetry(uav.telemetry, message.telemetry)


def _read_teller(message: pb.NetworkReport) -> Teller:
    rate_hz = message.rate_hz
    _require(math.isfinite(rate_hz) and _LEAST_RATE_HZ <= rate_hz <= _MOST_RATE_HZ, f"a rate of {rate_hz}")
    return Teller(
        printable(message.ual_version),
        printable(message.host),
        printable(message.computer_id),
        message.pid,
        convert.stamp_from_proto(message.started),
        rate_hz,
        message.uav_count,
    )


def _read_uav(message: pb.NetworkUav) -> UavReport:
    _require(_NAMESPACE.fullmatch(message.namespace), f"a UAV of the name {message.namespace!r:.80}")
    addresses = tuple(message.addresses[:_MOST_ADDRESSES])
    _require(all(map(_ADDRESS.fullmatch, addresses)), "an address that is none")
    _require_finite(message.telemetry)
    _make_printable(message.telemetry)
    return UavReport(
        message.namespace,
        samples.telemetry_from_proto(message.telemetry),
        printable(message.backend),
        addresses,
        message.has_tls,
        printable(message.needed_role),
        message.is_watch_only,
    )


def _make_printable(message: ual_pb2.Telemetry) -> None:
    message.state_reason = printable(message.state_reason)
    message.flight_mode = printable(message.flight_mode)
    message.status_text = printable(message.status_text)
    message.frame_lost = printable(message.frame_lost)
    if message.HasField("task"):
        message.task.description = printable(message.task.description)
        message.task.id = printable(message.task.id)
    if message.HasField("health"):
        health = message.health
        health.failsafe, health.held_by = printable(health.failsafe), printable(health.held_by)
        health.failing_checks[:] = [printable(each) for each in health.failing_checks]


def _require_finite(message: ual_pb2.Telemetry) -> None:
    """Refuses places, speeds and charges that are no numbers: what shows them would fail."""
    position, turned, speed = message.transform.translation, message.transform.rotation, message.velocity.linear
    geo, battery, task = message.position_geo, message.battery, message.task
    numbers = [position.x, position.y, position.z, turned.x, turned.y, turned.z, turned.w, speed.x, speed.y, speed.z]
    numbers += [geo.latitude_deg, geo.longitude_deg, geo.altitude_amsl_m, geo.altitude_home_m, geo.altitude_ellipsoid_m]
    numbers += [battery.remaining_percent, battery.voltage_v, battery.current_a, task.progress, task.distance_left_m]
    numbers.append(message.health.link_quality)
    _require(all(map(math.isfinite, numbers)), "numbers that are none")


def _require(is_fine: object, what: str) -> None:
    if not is_fine:
        raise ValueError(f"it tells of {what}")
