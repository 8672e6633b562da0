"""Engine of all backends, whatever their autopilot: the thread, the readings, the commands, and the rules of the pilot.

The rules that keep a safety pilot in charge stand here and nowhere else; `limits` has their numbers.
See ``docs/evidence/decisions/0041-one-engine.md`` and ``docs/how-to/write-a-backend.md``.
"""
