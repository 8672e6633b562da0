"""``ual teleop``: flies a UAV by hand, from a keyboard or a joystick.

A device (`keyboard`) gives sticks and actions to a `pilot`, which commands the chosen UAV without ever blocking
(`vehicle`). The `loop` reads the device at a fixed rate and draws the `board`.
"""
