"""Tracks on Earth from a recording (``ual record export --kml``, ``--gpx``): where each UAV flew."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET  # only written, never read

from ual.recording.reader import Message
from ual.shared import whole_file

_SAMPLE_PERIOD_NS = 100_000_000
"""Ten points a second are enough for a map."""


class Point(NamedTuple):
    """Position of a UAV: degrees, metres above mean sea level (None: not known), and UTC since 1970."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float | None
    time_s: float


def tracks(messages: Iterable[Message]) -> dict[str, list[Point]]:
    """Returns the track of each UAV, without repeated points where it stood still."""
    found: dict[str, list[Point]] = {}
    due_ns: dict[str, int] = {}
    for message in messages:
        if message.name != "telemetry" or message.log_ns < due_ns.get(message.ns, 0):
            continue
        due_ns[message.ns] = message.log_ns + _SAMPLE_PERIOD_NS
        sample = message.telemetry()
        position, track = sample.position_geo, found.setdefault(message.ns, [])
        if position is None:
            continue
        point = Point(position.latitude_deg, position.longitude_deg, position.altitude_amsl_m, message.log_ns * 1e-9)
        if not track or track[-1][:3] != point[:3]:
            track.append(point)
    return {ns: track for ns, track in found.items() if track}


def write_kml(path: Path, found: Mapping[str, Sequence[Point]], title: str) -> None:
    """Writes the tracks as KML: a line for each UAV, in absolute altitude."""
    root = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = ET.SubElement(root, "Document")
    ET.SubElement(document, "name").text = title
    for ns, track in found.items():
        placemark = ET.SubElement(document, "Placemark")
        ET.SubElement(placemark, "name").text = ns
        line = ET.SubElement(placemark, "LineString")
        ET.SubElement(line, "altitudeMode").text = "absolute"
        ET.SubElement(line, "coordinates").text = " ".join(
            f"{p.longitude_deg:.8f},{p.latitude_deg:.8f}{_altitude(p)}" for p in track
        )
    _write(path, root)


def _altitude(point: Point) -> str:
    return "" if point.altitude_amsl_m is None else f",{point.altitude_amsl_m:.3f}"


def write_gpx(path: Path, found: Mapping[str, Sequence[Point]], title: str) -> None:
    """Writes the tracks as GPX: a track for each UAV, with times."""
    root = ET.Element("gpx", xmlns="http://www.topografix.com/GPX/1/1", version="1.1", creator="ual")
    ET.SubElement(ET.SubElement(root, "metadata"), "name").text = title
    for ns, track in found.items():
        written = ET.SubElement(root, "trk")
        ET.SubElement(written, "name").text = ns
        segment = ET.SubElement(written, "trkseg")
        for p in track:
            point = ET.SubElement(segment, "trkpt", lat=f"{p.latitude_deg:.8f}", lon=f"{p.longitude_deg:.8f}")
            if p.altitude_amsl_m is not None:
                ET.SubElement(point, "ele").text = f"{p.altitude_amsl_m:.3f}"
            when = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(p.time_s))
            ET.SubElement(point, "time").text = f"{when}.{int(p.time_s % 1.0 * 1000):03d}Z"
    _write(path, root)


def _write(path: Path, root: ET.Element) -> None:
    ET.indent(root)
    whole_file.write(path, ET.tostring(root, encoding="utf-8", xml_declaration=True))
