"""``ual launch``: a team of UAVs by one command. docs/launch.md describes it; docs/decisions/0031 says why it is so."""

from ual_tools.launch.command import COMMANDS

__all__ = ["COMMANDS"]
