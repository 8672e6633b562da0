"""Makes a team of its file."""

from __future__ import annotations

import re
import shlex
import shutil
import signal
import sys
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import TypedDict

from ual import discovery
from ual_tools.launch.team import AtEnd, Program, Ready, ReadyCondition, Restart, Team
from ual_tools.strict_yaml.loading import YamlFileError
from ual_tools.strict_yaml.nodes import Node, read

_NAMESPACE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")  # as the daemon has it
_NAME = re.compile(r"[a-zA-Z0-9][a-zA-Z0-9_-]{0,62}")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_MOST_UAVS = 1000

_TEAM = ("name", "at_end", "land_limit_s", "image", "before", "uavs", "after")
_ENDING = ("env", "restart", "ends_team", "ready_limit_s", "stop_limit_s", "log_file", "image")
_PROGRAM = ("name", "run", "cwd", "ready", "stop_signal", *_ENDING)
_AFTER = (*_PROGRAM, "end")
_UAV = (
    "ns",
    "count",
    "first",
    "backend",
    "url",
    "listen",
    "model",
    "home_pose",
    "config_file",
    "config",
    "with",
    *_ENDING,
)
_OF_FLAGS = ("ns", "backend", "url", "listen", "home_pose", "fleet", "fleet_url", "fleet_spacing_m", "workers")
_READY = tuple(
    each.value for each in (ReadyCondition.PORT, ReadyCondition.FILE, ReadyCondition.LOG, ReadyCondition.EXIT)
)
_SIGNALS = {
    each.name.removeprefix("SIG"): each for each in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
}

_PROGRAM_READY_LIMIT_S = 60.0
_PROGRAM_STOP_LIMIT_S = 10.0
_DAEMON_STOP_LIMIT_S = 75.0
"""A landing that runs ends first, for 60 s at most."""


class _Ending(TypedDict):
    """Fields of `Program` that daemons and other programs share."""

    env: Mapping[str, str]
    restart: Restart
    is_ending_team: bool
    ready_limit_s: float | None
    stop_limit_s: float
    log_file: Path | None
    image: str | None


def load(path: Path) -> Team:
    """Reads the file of a team.

    Raises:
        YamlFileError: It is not valid; the message names the line and the key.
    """
    root = read(path)
    path = path.absolute()
    values = root.entries(_TEAM)
    if "uavs" not in values:
        raise root.error("uavs: a team has UAVs")
    name = values["name"].text() if "name" in values else path.stem
    if not _NAME.fullmatch(name):
        raise values.get("name", root).error(f"the team's name {name!r}: use letters, digits, _ and -")
    shared = {"team": name, "dir": str(path.parent)}
    image = values["image"].text() if "image" in values else None
    before = _chain(values.get("before"), shared, path.parent, (), _PROGRAM, image)
    first = _last(before, ())
    members = _members(values["uavs"], shared, path.parent, first, image)
    daemons = [each for each in members if each.is_daemon]
    of_all = {**shared, "uavs": ",".join(each.ns for each in daemons)}
    after = _chain(values.get("after"), of_all, path.parent, tuple(each.name for each in daemons), _AFTER, image)
    programs = [*before, *members, *after]
    _refuse_twins(root, programs)
    return Team(
        name=name,
        file=path,
        programs=programs,
        at_end=values["at_end"].choice(AtEnd) if "at_end" in values else AtEnd.LAND,
        land_limit_s=values["land_limit_s"].number() if "land_limit_s" in values else 120.0,
    )


def _refuse_twins(root: Node, programs: list[Program]) -> None:
    names = [each.name for each in programs]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise root.error(f"two programs have the name {name!r}; use {{index}} in it")


def _last(programs: list[Program], otherwise: tuple[str, ...]) -> tuple[str, ...]:
    return (programs[-1].name,) if programs else otherwise


def _chain(
    node: Node | None,
    names: Mapping[str, str],
    directory: Path,
    needs: tuple[str, ...],
    known: tuple[str, ...],
    image: str | None,
) -> list[Program]:
    """Returns programs of which each waits for the one before it; the first one waits for `needs`."""
    found: list[Program] = []
    for each in [] if node is None else node.items():
        found.append(_program(each.named(names), directory, _last(found, needs), known, image))
    return found


def _members(
    node: Node, names: Mapping[str, str], directory: Path, needs: tuple[str, ...], image: str | None
) -> list[Program]:
    found: list[list[Program]] = []
    index = 1
    for entry in node.items():
        values = entry.entries(_UAV)
        index = values["first"].whole(0) if "first" in values else index
        for _ in range(values["count"].whole(1) if "count" in values else 1):
            found.append(_uav(entry, {**names, "index": str(index)}, directory, needs, image))
            index += 1
            if len(found) > _MOST_UAVS:
                raise entry.error(f"more than {_MOST_UAVS} UAVs; a simulated fleet is one daemon with --fleet")
    if not found:
        raise node.error("a team has UAVs")
    return list(chain.from_iterable(found))


def _uav(
    entry: Node, names: Mapping[str, str], directory: Path, needs: tuple[str, ...], image: str | None
) -> list[Program]:
    """Returns the programs next to the daemon, and the daemon."""
    values = entry.named(names).entries()
    ns = values["ns"].text() if "ns" in values else f"uav_{names['index']}"
    if not _NAMESPACE.fullmatch(ns):
        raise values.get("ns", entry).error(
            f"{ns!r} is not a namespace: letters, digits and _, at most 64, no digit first"
        )
    names = {**names, "ns": ns, "port": str(discovery.default_port(ns))}
    if "model" in values:
        names["model"] = values["model"].text()
    values = entry.named(names).entries()
    companions = _chain(values.get("with"), names, directory, needs, _PROGRAM, image)
    daemon = Program(
        name=ns,
        ns=ns,
        argv=(_daemon_program(), *_flags(ns, values, directory)),
        cwd=directory,
        needs=_last(companions, needs),
        ready=Ready(ReadyCondition.SERVING),
        **_ending(values, directory, image, is_daemon=True),
    )
    return [*companions, daemon]


def _flags(ns: str, values: Mapping[str, Node], directory: Path) -> list[str]:
    flags = ["--ns", ns]
    for key in ("backend", "url"):
        if key in values:
            flags += [f"--{key}", values[key].text()]
    for address in _addresses(values):
        flags += ["--listen", address]
    if "config_file" in values:
        flags += ["--config", str(directory / values["config_file"].text())]
    if "home_pose" in values:
        flags += ["--set", f"home_pose={values['home_pose'].flow()}"]
    config = values["config"].entries() if "config" in values else {}
    for key, value in config.items():
        if key in _OF_FLAGS:
            raise value.error(
                "it is a key of the UAV itself" if key in _UAV else "each UAV has a daemon of its own here"
            )
        flags += ["--set", f"{key}={value.flow()}"]
    return flags


def _addresses(values: Mapping[str, Node]) -> list[str]:
    """Returns where a daemon is to listen: one address, or a list of them."""
    if "listen" not in values:
        return []
    listen = values["listen"]
    return [each.text() for each in listen.items()] if listen.is_list else [listen.text()]


def _daemon_program() -> str:
    """Returns where ``ual-daemon`` is: beside ``ual``, else on the path.

    Raises:
        YamlFileError: It is not installed.
    """
    programs = [program for program in (sys.argv[0], sys.executable) if Path(program).is_absolute()]
    siblings = (Path(program).parent / "ual-daemon" for program in programs)
    found = next(filter(None, map(shutil.which, (*map(str, siblings), "ual-daemon"))), None)
    if found is None:
        raise YamlFileError("ual-daemon is not installed here: pip install ual-daemon (docs/how-to/installation.md)")
    return found


def _program(node: Node, directory: Path, needs: tuple[str, ...], known: tuple[str, ...], image: str | None) -> Program:
    values = node.entries(known)
    for key in ("name", "run"):
        if key not in values:
            raise node.error(f"{key}: is missing")
    name = values["name"].text()
    if not _NAME.fullmatch(name):
        raise values["name"].error(f"{name!r}: use letters, digits, _ and -")
    return Program(
        name=name,
        argv=_argv(values["run"]),
        cwd=directory / values["cwd"].text() if "cwd" in values else directory,
        needs=needs,
        ready=_ready(values["ready"], directory) if "ready" in values else Ready(),
        is_ended_first="end" in known and ("end" not in values or _is_first(values["end"])),
        stop_signal=_signal(values["stop_signal"]) if "stop_signal" in values else signal.SIGTERM,
        **_ending(values, directory, image, is_daemon=False),
    )


def _is_first(node: Node) -> bool:
    text = node.text()
    if text not in ("first", "last"):
        raise node.error(f"expected first (before the UAVs land) or last, got {text!r}")
    return text == "first"


def _ending(values: Mapping[str, Node], directory: Path, image: str | None, *, is_daemon: bool) -> _Ending:
    """Returns what a daemon and any other program have alike."""
    restart = Restart.ALWAYS if is_daemon else Restart.NO
    ready_limit_s = None if is_daemon else _PROGRAM_READY_LIMIT_S
    stop_limit_s = _DAEMON_STOP_LIMIT_S if is_daemon else _PROGRAM_STOP_LIMIT_S
    return {
        "env": _environment(values["env"]) if "env" in values else {},
        "restart": values["restart"].choice(Restart) if "restart" in values else restart,
        "is_ending_team": values["ends_team"].boolean() if "ends_team" in values else is_daemon,
        "ready_limit_s": values["ready_limit_s"].number() if "ready_limit_s" in values else ready_limit_s,
        "stop_limit_s": values["stop_limit_s"].number() if "stop_limit_s" in values else stop_limit_s,
        "log_file": directory / values["log_file"].text() if "log_file" in values else None,
        "image": values["image"].text() if "image" in values else image,
    }


def _environment(node: Node) -> dict[str, str]:
    found = {}
    for name, value in node.entries().items():
        if not _VARIABLE.fullmatch(name):
            raise value.error("is not the name of a variable")
        found[name] = value.text()
    return found


def _argv(node: Node) -> tuple[str, ...]:
    """Returns a command: a list of its words, or one text that is split as a shell does. No shell sees it."""
    if node.is_list:
        words = tuple(each.text() for each in node.items())
    else:
        text = node.text()
        try:
            words = tuple(shlex.split(text))
        except ValueError as error:
            raise node.error(f"{error}: {text!r}") from None
    if not words:
        raise node.error("expected a command")
    return words


def _signal(node: Node) -> signal.Signals:
    name = node.text().removeprefix("SIG")
    if name not in _SIGNALS:
        raise node.error(f"expected {', '.join(_SIGNALS)}, got {name!r}")
    return _SIGNALS[name]


def _ready(node: Node, directory: Path) -> Ready:
    values = node.entries(_READY)
    if len(values) != 1:
        raise node.error(f"expected one of {', '.join(_READY)}")
    name, value = next(iter(values.items()))
    condition = ReadyCondition(name)
    if condition is ReadyCondition.PORT:
        return Ready(condition, _port(value))
    if condition is ReadyCondition.FILE:
        return Ready(condition, str(directory / value.text()))
    if condition is ReadyCondition.LOG:
        return Ready(condition, _pattern(value))
    if not value.boolean():
        raise value.error("expected true")
    return Ready(condition)


def _port(node: Node) -> str:
    """Returns HOST:PORT."""
    text = node.text()
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdecimal()) or not 0 < int(port) < 65536:
        raise node.error(f"expected PORT or HOST:PORT of TCP, got {text!r}")
    return f"{host or discovery.LOOPBACK}:{port}"


def _pattern(node: Node) -> str:
    text = node.text()
    try:
        re.compile(text)
    except re.error as error:
        raise node.error(f"is not a regular expression: {error}") from None
    return text
