"""What PX4 and ArduPilot do differently: modes, limits, commands and setpoints of each, with units and axes."""
