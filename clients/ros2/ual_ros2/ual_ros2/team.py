"""Facts about a team for `team.launch.py`. It needs no ROS."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

MODELS = ("quadrotor", "hexarotor", "manipulator", "crazyflie")
"""The models in ``urdf``."""
_NO_UAL = (
    "`ual` does not run. Activate the environment in which it is installed, or name it (ual:=/home/me/env/bin/ual)"
)
_UAV = re.compile(r"^    # Each UAV\n(.*?)^    # End of it\n", re.DOTALL | re.MULTILINE)


def names(ual: str, file: str) -> list[str]:
    """Returns the namespaces of a team, as ``ual launch`` reads its file.

    Raises:
        RuntimeError: The file is wrong; the message is that of ``ual``. Or there is no ``ual``.

    """
    command = [ual, "--json", "launch", "--print", file]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 (the user's own)
    except OSError as error:
        raise RuntimeError(f"{_NO_UAL}: {error}") from None
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    programs = [json.loads(line) for line in done.stdout.splitlines()]
    return [program["ns"] for program in programs if program["ns"]]


def rate_hz(given: str) -> float:
    """Returns the rate that is given as text.

    Raises:
        RuntimeError: It is none.

    """
    try:
        return float(given)
    except ValueError:
        raise RuntimeError(f"rate_hz: {given!r} is not a number") from None


def path(given: str) -> str:
    """Returns a path with the home directory for ``~``, which shells leave as it is in ``ual:=~/env/bin/ual``."""
    return str(Path(given).expanduser()) if given.startswith("~") else given


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
