"""What PX4 and ArduPilot are, whatever protocol reaches them: for all backends that fly them."""
