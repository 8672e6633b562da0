"""Where things are: the tree of frames, and poses and positions between them."""
