"""Reduces a polyline to the points that matter."""

from __future__ import annotations

from collections.abc import Sequence

from ual.geometry import Vector3

_LONGEST_POINTS = 256


def kept(
    points: Sequence[Vector3],
    fastest_m_s: Sequence[float],
    yaws_rad: Sequence[float] | None,
    within_m: float,
    within_rad: float,
) -> list[int]:
    """Returns the numbers of the points to keep, including the first and the last one.

    All other points are within `within_m` of the straight line between two kept points, in order along that line. If
    there are headings, they are within `within_rad` of the linear turn between them. A point at which the speed limit
    changes is kept.
    """
    count = len(points)
    result = [0]
    while result[-1] < count - 1:
        begin = result[-1]
        # Doubles the distance each time, then searches between the last point that was straight and the first that was
        # not.
        good, bad, step = begin + 1, min(count, begin + _LONGEST_POINTS), 2
        while begin + step < bad:
            if not _is_straight(points, fastest_m_s, yaws_rad, begin, begin + step, within_m, within_rad):
                bad = begin + step
                break
            good = begin + step
            step *= 2
        while bad - good > 1:
            middle = (good + bad) // 2
            if _is_straight(points, fastest_m_s, yaws_rad, begin, middle, within_m, within_rad):
                good = middle
            else:
                bad = middle
        result.append(good)
    return result


def _is_straight(
    points: Sequence[Vector3],
    fastest_m_s: Sequence[float],
    yaws_rad: Sequence[float] | None,
    begin: int,
    end: int,
    within_m: float,
    within_rad: float,
) -> bool:
    p, chord = points[begin], points[end] - points[begin]
    square = chord.dot(chord)
    last = 0.0
    for number in range(begin + 1, end):
        x, y, z = points[number].x - p.x, points[number].y - p.y, points[number].z - p.z
        share = (x * chord.x + y * chord.y + z * chord.z) / square if square > 0.0 else -1.0
        if not last <= share <= 1.0 or fastest_m_s[number] != fastest_m_s[number - 1]:
            return False
        dx, dy, dz = x - share * chord.x, y - share * chord.y, z - share * chord.z
        if dx * dx + dy * dy + dz * dz > within_m * within_m:
            return False
        if yaws_rad is not None:
            even = yaws_rad[begin] + share * (yaws_rad[end] - yaws_rad[begin])
            if abs(yaws_rad[number] - even) > within_rad:
                return False
        last = share
    return True
