"""Strategies of hypothesis for values of the interface."""

from __future__ import annotations

import math

from hypothesis import strategies as st

from ual.geometry import Pose, Quaternion, Transform, Vector3


def numbers(magnitude: float) -> st.SearchStrategy[float]:
    """Numbers up to a magnitude, as often small and round as large."""
    whole = int(min(3.0, magnitude))  # a filter that refuses many fails a health check by chance
    return st.floats(-magnitude, magnitude) | st.integers(-whole, whole).map(float)


def vectors(magnitude: float) -> st.SearchStrategy[Vector3]:
    return st.builds(Vector3, numbers(magnitude), numbers(magnitude), numbers(magnitude))


ANGLES = st.floats(-math.pi, math.pi)

ROTATIONS = st.builds(Quaternion.from_euler, ANGLES, ANGLES, ANGLES)

POSES = st.builds(Pose, vectors(1e3), ROTATIONS)

TRANSFORMS = st.builds(Transform, vectors(1e3), ROTATIONS, st.just("parent"), st.just("child"))
