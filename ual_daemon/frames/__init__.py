"""The tree of frames, and the conversion of poses and positions between frames."""
