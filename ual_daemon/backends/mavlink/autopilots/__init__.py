"""What PX4 and ArduPilot do differently."""
