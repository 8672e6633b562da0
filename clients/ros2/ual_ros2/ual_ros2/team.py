"""What `team.launch.py` needs to know of a team. It needs no ROS."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence

MODELS = ("quadrotor", "hexarotor", "manipulator", "crazyflie")
"""The models in ``urdf``."""
_UAV = re.compile(r"^    # Each UAV\n(.*?)^    # End of it\n", re.DOTALL | re.MULTILINE)


def names(ual: str, file: str) -> list[str]:
    """Returns the namespaces of a team, as ``ual launch`` reads its file.

    Raises:
        RuntimeError: The file is wrong; the message is that of ``ual``.

    """
    command = [ual, "--json", "launch", "--print", file]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 (the user's own command)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    programs = [json.loads(line) for line in done.stdout.splitlines()]
    return [program["ns"] for program in programs if program["ns"]]


def rviz(template: str, names: Sequence[str], model: str) -> str:
    """Returns a configuration of rviz2 that shows UAVs, out of that which shows `uav_1`.

    Args:
        template: The text of ``rviz/uav.rviz``.
        names: The namespaces of the UAVs.
        model: The path of their URDF.

    """
    return _UAV.sub(lambda found: "".join(_of(name, found[1], model) for name in names), template)


def _of(name: str, displays: str, model: str) -> str:
    return displays.replace("uav_1", name).replace("Description File: ''", f"Description File: {json.dumps(model)}")
