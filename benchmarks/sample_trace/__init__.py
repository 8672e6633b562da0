"""Breakdown of the time of one telemetry sample: ``python -m benchmarks.sample_trace``.

The functions that a sample passes are wrapped from outside, in the daemon and in the program. So a trace costs nothing
where none is made. `stations` lists the functions.
"""
