"""Small parts that UAL's own distributions share. Programs do not need them: they may change in any version."""
