"""Random missions on a real autopilot in simulation, under random faults, and an independent judge of each flight.

``python -m tests.campaign --autopilot ardupilot --flights 100 --seed 1``; see docs/evidence/campaign.md.
"""
