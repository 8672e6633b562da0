"""The version of ual-daemon."""

__version__ = "0.1.0"
