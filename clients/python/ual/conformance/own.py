"""The checks of the services beside flying. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual.conformance import (
    own_cameras,
    own_corrections,
    own_fence,
    own_gimbals,
    own_gripper,
    own_logs,
    own_missions,
    own_parachute,
    own_parameters,
)

ON_GROUND = (
    *own_cameras.ON_GROUND,
    *own_corrections.ON_GROUND,
    *own_fence.ON_GROUND,
    *own_gimbals.ON_GROUND,
    *own_gripper.ON_GROUND,
    *own_logs.ON_GROUND,
    *own_missions.ON_GROUND,
    *own_parachute.ON_GROUND,
    *own_parameters.ON_GROUND,
)
IN_FLIGHT = (*own_fence.IN_FLIGHT, *own_missions.IN_FLIGHT, *own_parameters.IN_FLIGHT)
