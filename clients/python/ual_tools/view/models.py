"""Models of UAVs on the page, with light meshes that are made here: no file is loaded. Needs numpy (of the extra)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ual_tools.view.meshes import Mesh, bar, box, cylinder, joined
from ual_tools.view.shown import MODEL_NAMES


@dataclass(frozen=True)
class Model:
    """A UAV as meshes, in its ``<ns>/base_link``.

    `body` has the colour of the state, `ghost` shows the reference, and `nose` where the front is. `propeller` is drawn
    at each of the `hubs`; neighbours turn in opposite directions. The label is `top_m` above the origin.
    """

    body: Mesh
    ghost: Mesh
    nose: Mesh
    propeller: Mesh
    hubs: tuple[tuple[float, float, float], ...]
    top_m: float


def quadrotor() -> Model:
    """Returns a quadrotor of half a metre from motor to motor."""
    return _multirotor(count=4, arm_m=0.27, propeller_m=0.13)


def hexarotor() -> Model:
    """Returns a hexarotor of 0.9 m from motor to motor."""
    return _multirotor(count=6, arm_m=0.45, propeller_m=0.19)


def manipulator() -> Model:
    """Returns a hexarotor with an arm of two links and a gripper, which reaches forward under it."""
    carrier = hexarotor()
    shoulder, elbow, wrist = (0.0, 0.0, -0.06), (0.12, 0.0, -0.30), (0.48, 0.0, -0.34)
    arm = [bar(shoulder, elbow, 0.045), bar(elbow, wrist, 0.035), cylinder(0.035, 0.07).moved(*elbow)]
    gripper = [bar((0.48, y, -0.34), (0.58, y, -0.34), 0.015) for y in (-0.035, 0.035)]
    hand = box(0.03, 0.10, 0.03).moved(*wrist)
    body = joined([carrier.body, *arm, hand, *gripper])
    return Model(body, carrier.ghost, carrier.nose, carrier.propeller, carrier.hubs, 0.55)


def crazyflie() -> Model:
    """Returns a Crazyflie: 0.1 m from motor to motor."""
    return _multirotor(count=4, arm_m=0.046, propeller_m=0.023)


def helipad() -> Mesh:
    """Returns an H on the ground, as wide as a metre: home."""
    bars = [box(0.1, 1.0, 0.02).moved(x, 0.0, 0.01) for x in (-0.3, 0.3)]
    return joined([*bars, box(0.6, 0.1, 0.02).moved(0.0, 0.0, 0.01)])


def goal() -> Mesh:
    """Returns a cross of three bars, each half a metre long: where a way ends."""
    return joined([box(0.5, 0.05, 0.05), box(0.05, 0.5, 0.05), box(0.05, 0.05, 0.5)])


MODELS: dict[str, Callable[[], Model]] = dict(
    zip(MODEL_NAMES, (quadrotor, hexarotor, manipulator, crazyflie), strict=True)
)


def _multirotor(count: int, arm_m: float, propeller_m: float) -> Model:
    """Returns a multirotor whose front is between two of its arms."""
    angles = [math.tau * (i + 0.5) / count for i in range(count)]
    ends = [(arm_m * math.cos(a), arm_m * math.sin(a)) for a in angles]
    thick = 0.075 * arm_m
    hub = box(0.75 * arm_m, 0.5 * arm_m, 0.22 * arm_m)
    arms = [bar((0.0, 0.0, 0.0), (x, y, 0.0), thick) for x, y in ends]
    motors = [cylinder(0.09 * arm_m, 0.2 * arm_m).moved(x, y, 0.06 * arm_m) for x, y in ends]
    legs = [box(thick, thick, 0.4 * arm_m).moved(0.4 * x, 0.4 * y, -0.2 * arm_m) for x, y in ends]
    nose = box(0.3 * arm_m, 0.16 * arm_m, 0.12 * arm_m).moved(0.5 * arm_m, 0.0, 0.05 * arm_m)
    blades = box(2 * propeller_m, 0.16 * propeller_m, 0.04 * arm_m)
    hubs = tuple((x, y, 0.19 * arm_m) for x, y in ends)
    body = joined([hub, *arms, *motors, *legs])
    return Model(body, joined([hub, *arms]), nose, blades, hubs, 0.15 + arm_m)
