"""The MAVROS backend: PX4 and ArduPilot multirotors through ROS 1 or ROS 2. See ``docs/reference/backends/mavros.md``.

The modules, from the top down (a contract in pyproject.toml checks it):

- ``backend``: the interface that the layers above call
- ``offers``: what is offered besides flying, by MAVROS' plugins
- ``session``: the exchange with one autopilot through MAVROS over time; belongs to the link's thread
- ``commands``: commands as calls of MAVROS' services, and their answers
- ``discovery``: what MAVROS is connected to, and the session with it
- ``parameters``, ``streams``, ``vehicle``: what is requested of MAVROS: parameters, rates, what it is connected to
- ``telemetry``: what MAVROS publishes, as a snapshot
- ``missions``: what MAVROS publishes of the lists that the autopilot keeps
- ``geoid``: how MAVROS' altitudes are read
- ``messages``, ``topics``: names, types and fields
- ``settings``

What PX4 and ArduPilot are is in ``ual_daemon.backends.firmwares``, the way to ROS in ``ual_daemon.backends.rosbridge``
"""

from ual_daemon.backends.mavros.backend import MavrosBackend

__all__ = ["MavrosBackend"]
