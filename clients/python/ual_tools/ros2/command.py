"""``ual ros2`` runs the node of `ual_ros2`, also where no workspace of colcon has it."""

from __future__ import annotations

import json
import os
import shlex
import sys
from importlib.util import find_spec

import click

from ual_tools.app import Multi, command
from ual_tools.help import Section
from ual_tools.ros2 import found, interfaces
from ual_tools.session import CommandSession, pass_session

_NODE = "ual_ros2"


@command(
    "ros2",
    "ual ros2",
    "ual --ns uav_1,uav_2 ros2 -- --ros-args -p rate_hz:=100.0",
    'eval "$(ual ros2 --variables)"',
    section=Section.TEAMS,
    multi=Multi.ITSELF,
)
@click.option("--variables", "is_printing", is_flag=True, help="Only print what a shell needs to find ual_msgs.")
@click.argument("arguments", nargs=-1)
@pass_session
def ros2(session: CommandSession, is_printing: bool, arguments: tuple[str, ...]) -> None:
    """Run UAVs as nodes of ROS 2 until Ctrl-C.

    They are all of this computer, or those of --ns.

    ARGUMENTS after `--` go to the node, as those of `ros2 run`. The first time this builds ual_msgs, where no workspace
    has it.
    """
    if session.network_config is not None:
        text = "the node does not look on the network: say where the UAVs are, --ns uav_1,uav_2 --address HOST:PORT"
        raise click.UsageError(f"{text} (a gateway), or by its parameters ns and address")
    variables = _variables(session)
    if is_printing:
        for name, value in variables.items():
            click.echo(f"export {name}={shlex.quote(value)}")
        return
    words = [sys.executable, "-m", _NODE, *arguments, *_parameters(session)]
    os.execve(words[0], words, os.environ | variables)  # noqa: S606 (a node, as `ros2 run` starts it)


def _variables(session: CommandSession) -> dict[str, str]:
    """Returns what the environment needs, so that Python finds ROS, the interfaces and the node."""
    variables = interfaces.ready(found.ros(), interfaces.cache(), session.tell)
    if find_spec(_NODE) is None:
        before = variables.get("PYTHONPATH") or os.environ.get("PYTHONPATH", "")
        variables["PYTHONPATH"] = os.pathsep.join(filter(None, [before, str(interfaces.SOURCES / _NODE)]))
    return variables


def _parameters(session: CommandSession) -> list[str]:
    """Returns the options of `ual` as parameters of the node. JSON is YAML, which ROS reads."""
    names = [name for name in (session.ns or "").split(",") if name]
    parameters = {
        "ns": names if not session.is_all else [],
        "address": [session.address] if session.address else [],
        "tls_ca": session.tls_ca,
        "token_file": session.token_file,
        "tls_certificate": session.tls_certificate,
        "tls_key": session.tls_key,
        "lease": session.has_lease or session.takes_lease,
        "lease_take": session.takes_lease,
    }
    values = {
        name: value if isinstance(value, (list, bool)) else str(value) for name, value in parameters.items() if value
    }
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={json.dumps(value)}")]
    return ["--ros-args", *words] if words else []


COMMANDS = (ros2,)
