"""The DJI backend: enterprise aircraft through the ROS wrappers of DJI's SDKs. See ``docs/reference/backends/dji.md``.

It has not flown a real aircraft yet. The modules, from the top down (a contract in pyproject.toml checks it):

- ``backend``: the interface that the layers above call
- ``session``: the exchange with one aircraft: what comes, what is called, what is confirmed
- ``landing``: landings that were requested, and are confirmed
- ``commands``: commands as calls of services, and their answers
- ``discovery``: which wrapper there is, by its services
- ``telemetry``: from messages to snapshots
- ``authority``: the controller of the aircraft, where the wrapper does not say it, and whether the end releases it
- ``wrappers``: names, types and numbers of the two wrappers
- ``local_frame``, ``obstacles``, ``modes``, ``settings``
"""

from ual_daemon.backends.dji.backend import DjiBackend

__all__ = ["DjiBackend"]
