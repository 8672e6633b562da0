"""The ROS 2 that this Python imports."""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from ual.errors import NotSupportedError

_MISSING = (
    "this Python ({0}.{1}) does not find rclpy. Install ROS 2 (https://docs.ros.org/en/jazzy/Installation.html). "
    "Then run `. /opt/ros/jazzy/setup.bash`, with the name of your distribution, in this shell. "
    "`ual` must be installed for the Python of that ROS"
)
_INDEX = "share/ament_index"


@dataclass(frozen=True)
class RosInstallation:
    """Installation of ROS 2."""

    prefixes: tuple[Path, ...]
    """The directories that ament searches, the nearest first."""

    def version_of(self, package: str) -> str:
        """Returns the version of a package, or an empty string where it has none."""
        for prefix in self.prefixes:
            manifest = prefix / "share" / package / "package.xml"
            if manifest.is_file() and (found := re.search(r"<version>(.*?)</version>", manifest.read_text())):
                return found[1]
        return ""


def ros() -> RosInstallation:
    """Returns the ROS 2 that this Python imports.

    Raises:
        NotSupportedError: There is none; the message says what to do.

    """
    if find_spec("rclpy") is None:
        raise NotSupportedError(_MISSING.format(*sys.version_info))
    named = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    here = Path(sys.prefix)  # where wheels put it
    return RosInstallation((*named, here) if (here / _INDEX).is_dir() and here not in named else tuple(named))
