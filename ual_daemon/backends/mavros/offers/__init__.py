"""Services other than flying, through MAVROS' plugins. See ``docs/evidence/decisions/0047``.

- ``lists``: the mission, the fence and the rally points, of the plugins waypoint, geofence and rallypoint
- ``parameters``: the autopilot's parameters, of the plugin param
- ``services``: the services of MAVROS that take long, each job in its turn, and what their errors mean
"""
