"""``ual launch``: a team of UAVs by one command. See docs/how-to/launch.md and docs/evidence/decisions/0031."""

from ual_tools.launch.command import COMMANDS

__all__ = ["COMMANDS"]
