"""Writes a team as a compose file: one service for each program, on the network of the host."""

from __future__ import annotations

from typing import Any

import yaml

from ual_tools import __version__
from ual_tools.launch.boot import RUNTIME_DIR, CannotExpressError, landing_of, test_of
from ual_tools.launch.team import Program, ReadyCondition, Team

IMAGE = f"ual:{__version__}"
"""Image that deploy/container/build makes."""
_CONFINED = {"read_only": True, "tmpfs": ["/tmp"], "cap_drop": ["ALL"], "security_opt": ["no-new-privileges:true"]}  # noqa: S108
"""Confinement of the image, which needs no more."""


def text(team: Team) -> str:
    """Returns the text of the compose file.

    Raises:
        CannotExpressError: A program has no image, or compose cannot do what the file says.
    """
    services = {each.name: _service(team, each) for each in team.programs}
    whole = {"name": team.name.lower(), "services": services, "volumes": {"ual": {}}}
    return _heading(team) + yaml.safe_dump(_escaped(whole), sort_keys=False, allow_unicode=True, width=120)


def _heading(team: Team) -> str:
    ending = [each.name for each in team.programs if each.is_ending_team and not each.is_daemon]
    lines = [f"The team {team.name}, written by `ual launch --compose`."]
    if ending:
        lines.append(
            f"Compose does not end the team when {', '.join(ending)} has ended: --abort-on-container-exit does."
        )
    return "".join(f"# {line}\n" for line in lines)


def _service(team: Team, program: Program) -> dict[str, Any]:
    image = program.image or _own_image(program)
    where = str(team.file.parent)
    service: dict[str, Any] = {
        "image": image,
        "entrypoint": [],
        "command": ["ual-daemon" if program.is_daemon else program.argv[0], *program.argv[1:]],
        "working_dir": str(program.cwd),
        "environment": {"UAL_RUNTIME_DIR": RUNTIME_DIR, **program.env},
        "volumes": [f"ual:{RUNTIME_DIR}", f"{where}:{where}"],
        "network_mode": "host",
        "init": True,
        "restart": program.restart.value,
        "stop_signal": program.stop_signal.name,
        "stop_grace_period": f"{program.stop_limit_s:g}s",
        **(_CONFINED if image == IMAGE else {}),
    }
    if program.needs:
        service["depends_on"] = {name: {"condition": _condition(team, name)} for name in program.needs}
    test = _test(program)
    if test is not None:
        service["healthcheck"] = {
            "test": test,
            # Often until it is ready, seldom during a flight. A daemon waits for its autopilot as long as it takes.
            "start_period": f"{1_000_000 if (limit_s := program.ready_limit_s) is None else max(1, round(limit_s))}s",
            "start_interval": "1s",
            "interval": "10s",
            "retries": 3,
        }
    landing = landing_of(team, program, "ual")
    if landing is not None:
        service["pre_stop"] = [{"command": ["bash", "-c", landing]}]
    return service


def _own_image(program: Program) -> str:
    """Returns the image for a program that the file names none for: that of UAL, for UAL's programs."""
    if program.is_daemon or program.argv[0] == "ual":
        return IMAGE
    raise CannotExpressError(f"{program.name}: a compose file needs its image (or one for the whole team: image)")


def _test(program: Program) -> list[str] | None:
    """Returns the command of the health check. A daemon's is a small program of its image: it runs in flight, too."""
    if program.ready.condition is ReadyCondition.SERVING:
        return ["CMD", "env", f"UAL_NS={program.ns}", "ual-health"]
    test = test_of(program, "ual")
    return None if test is None else ["CMD", "bash", "-c", test]


def _condition(team: Team, name: str) -> str:
    program = next(each for each in team.programs if each.name == name)
    if program.ready.condition is ReadyCondition.EXIT:
        return "service_completed_successfully"
    return "service_started" if program.ready.condition is ReadyCondition.STARTED else "service_healthy"


def _escaped(value: object) -> object:
    """Returns the same value with ``$`` doubled: compose would take it for a variable."""
    if isinstance(value, dict):
        return {key: _escaped(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_escaped(each) for each in value]
    return value.replace("$", "$$") if isinstance(value, str) else value
