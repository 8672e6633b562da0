"""The Crazyflie backend: quadrotors of Bitcraze over CRTP. See ``docs/reference/backends/crazyflie.md``.

The modules, from the top down (a contract in pyproject.toml checks it):

- ``backend``: the interface that the layers above call
- ``session``: the conversation with one Crazyflie over time, and the thread that receives
- ``connecting``: what is requested of a Crazyflie before it can be flown, step by step
- ``commander``: which of the firmware's two commanders flies, and the setpoints
- ``telemetry``, ``contact``, ``supervisor``: from logged variables to snapshots and words
- ``log_blocks``, ``toc``, ``requests``, ``packets``: CRTP
- ``links``, ``outbox``: UDP; Crazyradio and USB through cflib's drivers
- ``settings``
"""

from ual_daemon.backends.crazyflie.backend import CrazyflieBackend

__all__ = ["CrazyflieBackend"]
