"""Delay until a fleet in several daemons is listed, and until ended UAVs are gone."""

from __future__ import annotations

import math
import signal
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from benchmarks.children import Child, Process
from benchmarks.network import namespaces
from benchmarks.network.goals import NetworkFigure
from benchmarks.network.site import ROUTERS, Site

_DAEMONS = 5
_FAILOVER_S = 2.0
_LISTED_S, _KILLED_S, _STOPPED_S, _RIGHT_S = 3.0, 1.0, 3.0, 3.0
_CUT_S = 60.0
_STEADY_S = 6.0
_START_LIMIT_S = 120.0


@dataclass(frozen=True)
class _Fleet:
    """Daemons of a site that all serve, its routers, and a program that listens."""

    site: Site
    spans: list[str]
    routers: list[Process]
    listener: Child
    daemons: list[Process]


def _fly(uavs: int, stack: ExitStack, *, is_split: bool) -> _Fleet:
    each = uavs // _DAEMONS
    spans = [f"uav_{i * each + 1}-{(i + 1) * each}" for i in range(_DAEMONS)]
    directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="ual-network-")))
    lan = stack.enter_context(namespaces.lan())
    site = Site(directory, lan, spans, stack, is_split=is_split)
    routers = [site.router(name) for name in ROUTERS]
    listener = site.listener()
    daemons = [_daemon(site, span, i * each + 1, each, stack) for i, span in enumerate(spans)]
    for daemon, span in zip(daemons, spans, strict=True):
        _wait_until_serving(daemon, directory / f"{span}.log")
    return _Fleet(site, spans, routers, listener, daemons)


def measure_failover(uavs: int) -> list[NetworkFigure]:
    """Measures what a program sees that starts after the first of two routers was killed, with the UAVs in the air."""
    with ExitStack() as stack:
        fleet = _fly(uavs, stack, is_split=False)
        fleet.listener.ask("until", count=uavs, limit_s=_START_LIMIT_S)
        at_s = time.monotonic()
        fleet.routers[0].popen.kill()
        found = [_discovered(fleet.listener, uavs, _FAILOVER_S, " at once after router_1 was killed")]
        back = fleet.listener.ask("until", count=uavs, is_exact=True)
        found.append(NetworkFigure("router_1 is killed: who runs sees all again", back["at_s"] - at_s, "s", _STOPPED_S))
        found.append(_discovered(fleet.listener, uavs, _FAILOVER_S, " once who runs sees all again"))
        return found


def _discovered(listener: Child, uavs: int, most_s: float, when: str = "") -> NetworkFigure:
    seen = listener.ask("discover", limit_s=_START_LIMIT_S)
    what = f"a program that starts{when} lists {seen['count']} of {uavs}"
    return NetworkFigure(what, seen["took_s"] if seen["count"] == uavs else math.inf, "s", most_s)


def measure(uavs: int, seconds: float) -> list[NetworkFigure]:
    """Measures a fleet of so many."""
    each = uavs // _DAEMONS
    with ExitStack() as stack:
        fleet = _fly(uavs, stack, is_split=True)
        served_s = time.monotonic()
        site, spans, routers, listener, daemons = fleet.site, fleet.spans, fleet.routers, fleet.listener, fleet.daemons
        lan = site.lan
        listed = listener.ask("until", count=uavs, limit_s=_START_LIMIT_S)
        found = [
            NetworkFigure(
                f"{uavs} UAVs in {_DAEMONS} daemons: all listed after all serve",
                listed["at_s"] - served_s,
                "s",
                _LISTED_S,
            )
        ]
        found.append(_discovered(listener, uavs, _LISTED_S))
        found += _cost(listener, daemons, routers, seconds)
        found += _stopped(listener, daemons[1], uavs, each)
        found += _restarted_router(site, routers, listener, uavs)
        if isinstance(lan, namespaces.Lan):
            found += _cut_off(lan, spans[2], listener, uavs, each)
        found += _killed(listener, daemons[0], uavs, each)
        return found


def _daemon(site: Site, span: str, first: int, count: int, stack: ExitStack) -> Process:
    site.lan.add(span)
    log = stack.enter_context((site.directory / f"{span}.log").open("wb"))
    command = [*site.lan.prefix(span), sys.executable, "-m", "ual_daemon", "--backend", "light", "--ns", f"uav_{first}"]
    flags = ["--fleet", str(count), "--auto-arm", "--listen", f"unix:{site.directory}/{{ns}}.sock"]
    return stack.enter_context(
        Process(
            [*command, *flags, "--network", site.config(span)],
            environment={"UAL_RUNTIME_DIR": str(site.directory / f"run-{span}")},
            stderr=log,
        )
    )


def _wait_until_serving(daemon: Process, log: Path) -> None:
    end_s = time.monotonic() + _START_LIMIT_S
    while "serving" not in log.read_text():
        if time.monotonic() > end_s or daemon.popen.poll() is not None:
            raise TimeoutError(log.read_text()[-2000:])
        time.sleep(0.02)


def _cost(listener: Child, daemons: list[Process], routers: list[Process], seconds: float) -> list[NetworkFigure]:
    """Returns the costs of the dashboard: a listener to all at 1 Hz, the routers, and a daemon with its simulation."""
    before = [listener.ask("processor")["processor_s"], *(each.processor_s() for each in (*routers, *daemons))]
    time.sleep(seconds)
    after = [listener.ask("processor")["processor_s"], *(each.processor_s() for each in (*routers, *daemons))]
    shares = [100.0 * (b - a) / seconds for a, b in zip(before, after, strict=True)]
    return [
        NetworkFigure("processor: who listens to all at 1 Hz", shares[0], "%"),
        NetworkFigure("processor: both routers", sum(shares[1:3]), "%"),
        NetworkFigure("processor: the daemons together, with their simulation", sum(shares[3:]), "%"),
        NetworkFigure("memory: the larger router", max(each.resident_mib() for each in routers), "MiB"),
    ]


def _killed(listener: Child, daemon: Process, uavs: int, each: int) -> list[NetworkFigure]:
    at_s = time.monotonic()
    daemon.popen.kill()
    gone = listener.ask("until", count=uavs - each, is_exact=True)
    return [NetworkFigure(f"a daemon is killed: its {each} are gone", gone["at_s"] - at_s, "s", _KILLED_S)]


def _stopped(listener: Child, daemon: Process, uavs: int, each: int) -> list[NetworkFigure]:
    at_s = time.monotonic()
    daemon.popen.send_signal(signal.SIGSTOP)
    gone = listener.ask("until", count=uavs - each, is_exact=True)
    daemon.popen.send_signal(signal.SIGCONT)
    on_s = time.monotonic()
    back = listener.ask("until", count=uavs, is_exact=True)
    return [
        NetworkFigure(f"a daemon is stopped (SIGSTOP): its {each} are gone", gone["at_s"] - at_s, "s", _STOPPED_S),
        NetworkFigure("it goes on: they are there again", back["at_s"] - on_s, "s", _RIGHT_S),
    ]


def _restarted_router(site: Site, routers: list[Process], listener: Child, uavs: int) -> list[NetworkFigure]:
    """The daemons' router is killed, and started again: from its start on, when is all right."""
    routers[0].popen.kill()
    routers[0].popen.wait()
    listener.ask("until", count=0, is_exact=True)
    begun_s = time.monotonic()
    routers[0] = site.router(ROUTERS[0])
    at_s = time.monotonic()
    back = listener.ask("until", count=uavs, is_exact=True)
    return [
        NetworkFigure("a router that was killed is started again: until it routes", at_s - begun_s, "s"),
        NetworkFigure("from then on until presence is right", max(0.0, back["at_s"] - at_s), "s", _RIGHT_S),
    ]


def _cut_off(lan: namespaces.Lan, name: str, listener: Child, uavs: int, each: int) -> list[NetworkFigure]:
    at_s = time.monotonic()
    lan.cut(name, is_up=False)
    gone = listener.ask("until", count=uavs - each, is_exact=True)
    time.sleep(_CUT_S)
    on_s = time.monotonic()
    lan.cut(name, is_up=True)
    back = listener.ask("until", count=uavs, is_exact=True)
    steady = listener.ask("steady", seconds=_STEADY_S)
    return [
        NetworkFigure(f"a computer is cut off: its {each} are gone", gone["at_s"] - at_s, "s", _STOPPED_S),
        NetworkFigure("it is back after a minute: presence is right", back["at_s"] - on_s, "s", _RIGHT_S),
        NetworkFigure("in the seconds after that: UAVs that are missing", float(uavs - steady["count"]), "", 0.0),
    ]
