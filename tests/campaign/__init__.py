"""Random missions on a real autopilot in simulation, under random faults, and an independent judge of each flight.

``python -m tests.campaign --autopilot ardupilot --url tcp://127.0.0.1:5760 --flights 100 --seed 1``; see docs/campaign.md.
"""
