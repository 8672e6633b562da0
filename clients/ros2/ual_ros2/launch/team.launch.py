"""Starts the daemons of a team, and one node for all of them: ``ros2 launch ual_ros2 team.launch.py team:=team.yaml``.

Ctrl-C ends it as `ual launch` ends: the UAVs that the team flies land first.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from ual_ros2 import team

LANDING_S = 180
"""A landing is waited for, before the team is killed."""


def generate_launch_description() -> LaunchDescription:
    """Returns what is started."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("team", description="the file of the team: see `ual launch`"),
            DeclareLaunchArgument("rate_hz", default_value="30.0", description="how often poses are published"),
            DeclareLaunchArgument("rviz", default_value="false", description="whether to show the team in rviz2"),
            DeclareLaunchArgument("model", default_value="quadrotor", choices=team.MODELS),
            DeclareLaunchArgument("ual", default_value="ual", description="the command `ual`, where it is not on PATH"),
            OpaqueFunction(function=_start),
        ]
    )


def _start(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ("team", "rate_hz", "rviz", "model", "ual")}
    ual, file = team.path(given["ual"]), team.path(given["team"])
    names = team.names(ual, file)
    daemons = ExecuteProcess(
        cmd=[ual, "launch", file],
        name="team",
        output="screen",
        sigterm_timeout=str(LANDING_S),
        sigkill_timeout="10",
        on_exit=Shutdown(reason="the team has ended"),
    )
    parameters = {"ns": names, "rate_hz": team.rate_hz(given["rate_hz"])}
    node = Node(
        package="ual_ros2", executable="node", output="screen", parameters=[parameters], respawn=True, respawn_delay=1.0
    )
    shown = [_rviz(names, given["model"])] if given["rviz"].lower() == "true" else []
    return [*shown, node, daemons]  # the daemons last: if one before fails, none is left behind


def _rviz(names: list[str], model: str) -> Node:
    """Returns rviz2. Where it is missing, nothing is started: `launch` would leave behind what it has started."""
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        raise RuntimeError("rviz2 is not installed: `sudo apt install ros-jazzy-rviz2`, or leave out rviz") from None
    share = Path(get_package_share_directory("ual_ros2"))
    text = team.rviz((share / "rviz" / "uav.rviz").read_text(), names, str(share / "urdf" / f"{model}.urdf"))
    with tempfile.NamedTemporaryFile("w", prefix="ual_", suffix=".rviz", delete=False) as file:
        file.write(text)
    return Node(package="rviz2", executable="rviz2", arguments=["-d", file.name])
