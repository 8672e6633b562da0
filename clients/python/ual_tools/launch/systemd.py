"""Writes a team as units of systemd: one for each program, and a target that starts and ends them together."""

from __future__ import annotations

import getpass
import shutil
from pathlib import Path

from ual_tools.launch.boot import RUNTIME_DIR, CannotExpressError, landing_of, test_of
from ual_tools.launch.team import Program, ReadyCondition, Restart, Team

_LAND_MARGIN_S = 10.0
"""The landing ends by its own limit, not by that of the unit."""

HARDENING = """\
DynamicUser=yes
SupplementaryGroups=dialout
Environment=UAL_RUNTIME_DIR=/run/ual
Nice=-10
OOMScoreAdjust=-500
LimitNOFILE=65536
NoNewPrivileges=yes
CapabilityBoundingSet=
ProtectSystem=strict
ProtectHome=read-only
ReadWritePaths=/run/ual
PrivateTmp=yes
ProtectProc=invisible
ProtectClock=yes
ProtectHostname=yes
ProtectControlGroups=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX
RestrictNamespaces=yes
RestrictRealtime=yes
LockPersonality=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallFilter=~@privileged
SystemCallErrorNumber=EPERM
DevicePolicy=closed
DeviceAllow=char-ttyACM rw
DeviceAllow=char-ttyAMA rw
DeviceAllow=char-ttyS rw
DeviceAllow=char-ttyUSB rw
DeviceAllow=char-usb_device rw
"""
"""Of a daemon: as deploy/systemd/ual-daemon@.service has it, but homes are read: ``ual`` may be installed in one."""


def units(team: Team) -> dict[str, str]:
    """Returns the text of each unit by its name.

    Raises:
        CannotExpressError: systemd cannot do what the file says.
    """
    found = {_unit(team, each): _service(team, each) for each in team.programs}
    return {**found, _target_name(team): _target(team), **_end(team)}


def _unit(team: Team, program: Program) -> str:
    return f"ual-{team.name}-{program.name}.service"


def _target_name(team: Team) -> str:
    return f"ual-{team.name}.target"


def _target(team: Team) -> str:
    wants = " ".join(_unit(team, each) for each in team.programs)
    return f"""\
[Unit]
Description=UAL team {team.name}
Wants={wants}

[Install]
WantedBy=multi-user.target
"""


def _end(team: Team) -> dict[str, str]:
    """Returns the unit that ends the team, if a program may."""
    if not any(map(_may_end, team.programs)):
        return {}
    text = f"""\
[Unit]
Description=Ends the UAL team {team.name}

[Service]
Type=oneshot
ExecStart={_word(_found("systemctl"))} --no-block stop {_target_name(team)}
"""
    return {f"ual-{team.name}-end.service": text}


def _may_end(program: Program) -> bool:
    """Returns whether its end ends the team. A daemon is always started again here: nobody may be there to do it."""
    return program.is_ending_team and not program.is_daemon


def _service(team: Team, program: Program) -> str:
    needs = " ".join(_unit(team, each) for each in team.programs if each.name in program.needs)
    lines = [
        "[Unit]",
        f"Description=UAL team {team.name}: {program.name}",
        f"PartOf={_target_name(team)}",
        f"After=network.target {needs}".rstrip(),
        *([f"Wants={needs}"] if needs else []),
        "StartLimitIntervalSec=0",
        *([f"{key}=ual-{team.name}-end.service" for key in ("OnSuccess", "OnFailure")] if _may_end(program) else []),
        "",
        "[Service]",
        *_commands(team, program),
        *_times(team, program),
        f"WorkingDirectory={_path(program.cwd)}",
        *(f"Environment={_word(f'{name}={value}', is_command=False)}" for name, value in program.env.items()),
        *([f"StandardOutput=append:{_path(program.log_file)}", "StandardError=inherit"] if program.log_file else []),
    ]
    return "\n".join(lines) + "\n" + (HARDENING if program.is_daemon else _of_user())


def _of_user() -> str:
    return f"User={getpass.getuser()}\nEnvironment=UAL_RUNTIME_DIR={RUNTIME_DIR}\n"


def _commands(team: Team, program: Program) -> list[str]:
    ual = _found("ual", sibling=team.daemons[0].argv[0])
    is_exit = program.ready.condition is ReadyCondition.EXIT
    first = [_found(program.argv[0], program.cwd), *program.argv[1:]]
    lines = ["Type=oneshot", "RemainAfterExit=yes"] if is_exit else ["Type=exec"]
    lines.append(f"ExecStart={' '.join(map(_word, first))}")
    test = test_of(program, ual)
    if test is not None:
        lines.append(f"ExecStartPost={_bash(f'until {test}; do sleep 0.2; done 2>/dev/null')}")
    landing = landing_of(team, program, ual)
    if landing is not None:
        lines.append(f"ExecStop=-{_bash(landing)}")
    return lines


def _times(team: Team, program: Program) -> list[str]:
    limit_s = (
        max(program.stop_limit_s, team.land_limit_s + _LAND_MARGIN_S) if program.is_daemon else program.stop_limit_s
    )
    restart = Restart.NO if program.ready.condition is ReadyCondition.EXIT else program.restart
    return [
        f"Restart={restart.value}",
        "RestartSec=1",
        *(["RestartPreventExitStatus=2"] if program.is_daemon else []),
        f"KillSignal={program.stop_signal.name}",
        f"TimeoutStartSec={'infinity' if program.ready_limit_s is None else f'{program.ready_limit_s:g}'}",
        f"TimeoutStopSec={limit_s:g}",
    ]


def _found(name: str, cwd: Path | None = None, sibling: str | None = None) -> str:
    """Returns where a program is: units name it by its whole path."""
    if sibling is not None and (near := shutil.which(str(Path(sibling).parent / name))):
        return near
    local = str((cwd or Path()) / name) if "/" in name else name
    found = shutil.which(local)
    if found is None:
        raise CannotExpressError(f"{name} is not installed here, and a unit names a program by its whole path")
    return found


def _bash(command: str) -> str:
    return " ".join(map(_word, (_found("bash"), "-c", command)))


def _path(path: Path) -> str:
    return str(path).replace("%", "%%")


def _word(word: str, *, is_command: bool = True) -> str:
    """Returns one word in systemd's quotes, so that nothing in it is expanded."""
    escaped = word.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("%", "%%")
    escaped = escaped.replace("$", "$$") if is_command else escaped
    is_plain = escaped and not set(escaped) & set(" \t'\";\\")
    return escaped if is_plain else f'"{escaped}"'
