"""What is offered beside flying, through MAVROS' plugins. See ``docs/decisions/0047-services-beside-flying.md``.

- ``parameters``: the autopilot's parameters, of the plugin param
- ``services``: the services of MAVROS that take long, each job in its turn, and what their errors mean
"""
