"""Smooth trajectories within limits. Pure mathematics.

| module | content |
|---|---|
| `motion` | the state at one time of a trajectory, and the interface of trajectories |
| `envelope` | the limits of velocity, acceleration and jerk |
| `pulse` | changes of speed |
| `bend` | from any motion to rest, or towards a goal |
| `straight` | straight to a goal; braking |
| `path` | through many waypoints: `run` (legs and rounded corners, `leg`) between stops, after `simplify` |
| `stay` | holding a place for some time |
| `moved` | a trajectory at another place |
| `heading`, `turn`, `facing` | where the nose points |
| `pieces` | motion as pieces of constant jerk |
"""

from ual_daemon.trajectory.envelope import acceleration_limit, speed_limit
from ual_daemon.trajectory.motion import Motion, Trajectory
from ual_daemon.trajectory.moved import Moved
from ual_daemon.trajectory.path import Chain, PathWaypoint, path
from ual_daemon.trajectory.run import Run
from ual_daemon.trajectory.straight import Brake, StraightTrajectory

__all__ = [
    "Brake",
    "Chain",
    "Motion",
    "Moved",
    "PathWaypoint",
    "Run",
    "StraightTrajectory",
    "Trajectory",
    "acceleration_limit",
    "path",
    "speed_limit",
]
