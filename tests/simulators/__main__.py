"""A simulated autopilot as a program: ``python -m tests.simulators px4 --udp 14540 --ground 18570``.

Prints its ports in one line of JSON, and runs until it is terminated or its standard input is closed.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot
from tests.simulators.crazyflie import Crazyflie
from tests.simulators.faults import BadLink, Faults
from tests.simulators.ports import Port, TcpPort, UdpPort
from tests.simulators.px4 import Px4
from tests.simulators.runner import run

HOST = "127.0.0.1"


def main(arguments: list[str] | None = None) -> None:
    """Runs one until its standard input ends."""
    options = _parser().parse_args(arguments)
    if options.kind == "crazyflie":
        _run_crazyflie(options)
        return
    if options.udp is not None:
        link: Port = UdpPort((HOST, options.listen), (HOST, options.udp))
    elif options.tcp is not None:
        link = TcpPort((HOST, options.tcp))
    else:
        link = UdpPort((HOST, options.listen))
    assert isinstance(link, (UdpPort, TcpPort))
    places = {"link": link.address[1]}
    faults = Faults(options.loss, options.delay, options.jitter, options.duplication, options.corruption)
    if faults != Faults():
        link = BadLink(link, options.seed, faults, faults)
    autopilot: Autopilot
    common = {"system_id": options.system_id, "seed": options.seed, "wander_m": options.wander}
    if options.kind == "px4":
        ground = None if options.ground is None else UdpPort((HOST, options.ground))
        other = None if options.other is None else UdpPort((HOST, 0), (HOST, options.other))
        autopilot = Px4(link, ground, other=other, **common)
        if ground is not None:
            places["ground"] = ground.address[1]
    else:
        links, radio = [link], None
        if options.ground is not None:
            ground_link, radio = TcpPort((HOST, options.ground)), UdpPort((HOST, options.radio))
            links.append(ground_link)
            places |= {"ground": ground_link.address[1], "radio": radio.address[1]}
        if options.other is not None:
            other_link = TcpPort((HOST, options.other))
            links.append(other_link)
            places["other"] = other_link.address[1]
        autopilot = ArduPilot(links, radio, **common)
    for assignment in options.parameter:
        name, _, value = assignment.partition("=")
        autopilot.parameters[name] = type(autopilot.parameters[name])(float(value))
    if options.log is not None:
        autopilot.files.files[f"{autopilot.files.directory}/{options.log}"] = bytes(range(256)) * 200
    print(json.dumps(places), flush=True)
    stopped = threading.Event()
    threading.Thread(target=run, args=(autopilot, stopped, options.speed), daemon=True).start()
    sys.stdin.read()
    stopped.set()


def _run_crazyflie(options: argparse.Namespace) -> None:
    port = UdpPort((HOST, options.listen))
    faults = Faults(options.loss, options.delay, options.jitter, options.duplication, options.corruption)
    crazyflie = Crazyflie(port if faults == Faults() else BadLink(port, options.seed, faults, faults))
    print(json.dumps({"link": port.address[1]}), flush=True)
    stopped = threading.Event()
    threading.Thread(target=run, args=(crazyflie, stopped, options.speed), daemon=True).start()
    sys.stdin.read()
    stopped.set()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.simulators", description=__doc__)
    parser.add_argument("kind", choices=("px4", "ardupilot", "crazyflie"))
    parser.add_argument("--udp", type=int, metavar="PORT", help="sends to this UDP port, as PX4's onboard link does")
    parser.add_argument("--listen", type=int, default=0, metavar="PORT", help="its own UDP port (0: any)")
    parser.add_argument("--tcp", type=int, metavar="PORT", help="a TCP server instead (0: any port)")
    parser.add_argument(
        "--ground", type=int, metavar="PORT", help="a link for a ground station: PX4 UDP, ArduPilot TCP"
    )
    parser.add_argument("--other", type=int, metavar="PORT", help="a third link: PX4 sends there, ArduPilot serves TCP")
    parser.add_argument("--radio", type=int, default=0, metavar="PORT", help="ArduPilot: the transmitter's UDP port")
    parser.add_argument("--system-id", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", type=float, default=1.0, help="how fast its time runs")
    parser.add_argument("--wander", type=float, default=0.0, metavar="M", help="how far off its estimate wanders")
    parser.add_argument("--parameter", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--log", metavar="NAME", help="has a log of this name")
    for name in ("loss", "delay", "jitter", "duplication", "corruption"):
        parser.add_argument(f"--{name}", type=float, default=0.0, help="of the link, both ways (see faults.py)")
    return parser


if __name__ == "__main__":
    main()
