"""The node's parameters."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import zip_longest
from pathlib import Path
from typing import Any

import ual
from ual.shared import environment
from ual_ros2.messages import Entity

DEFAULTS: dict[str, tuple[Any, str]] = {
    "ns": ("", "the UAVs' namespaces, one or a list; empty: all UAVs of this computer"),
    "address": ("", "where their daemons are, host:port or unix:path, in the same order; empty: on this computer"),
    "tls_ca": ("", "a file with the certificates to trust, for daemons that use TLS"),
    "tls_certificate": ("", "this program's own certificate, a PEM file"),
    "tls_key": ("", "the private key of this certificate"),
    "token_file": ("", "a file with the token that is shown to the daemons"),
    "lease": (False, "whether to be the only program that flies the UAVs, while the node is active"),
    "lease_holder": ("ual_ros2", "how this program is called where others are refused by its lease"),
    "lease_take": (False, "whether to take the lease from its holder, which only a commander may"),
    "rate_hz": (30.0, "how often pose, velocity, odom, ref_pose and tf are published"),
    "slow_rate_hz": (2.0, "how often battery, fix and health are published, and frames are looked for"),
    "camera_rate_hz": (5.0, "how often each picture of a camera that is heard is fetched and published"),
    "feedback_rate_hz": (10.0, "how often actions give feedback"),
    "transform_tolerance": (1.0, "how many seconds after a frame was on /tf goals and setpoints may be in it"),
    "refuse_late": (True, "whether what was sent too long ago, or is stamped so, is refused"),
    "enable_stamped_cmd_vel": (False, "whether cmd_vel is TwistStamped, whose frame and stamp count, and no Twist"),
    "log_directory": ("", "the directory that logs of the autopilot are downloaded to; empty: none are"),
    "autostart": (True, "whether the node configures and activates itself"),
}
_IS_ONE_OR_MANY = ("ns", "address")
_WHEN_READ = "{0} is read when the node is configured: `ros2 lifecycle set` it to deactivate and cleanup first"


@dataclass(frozen=True)
class NodeSettings:
    """The parameters, read once when the node is configured."""

    uavs: tuple[tuple[str, str], ...]
    """Name and address of each UAV; one of both may be empty. None: all UAVs of this computer."""
    tls_ca: str | None
    credentials: ual.Credentials
    lease_holder: str | None
    """None: fly without a lease."""
    lease_take: bool
    rate_hz: float
    slow_rate_hz: float
    camera_rate_hz: float
    feedback_rate_hz: float
    transform_tolerance_s: float
    refuses_late: bool
    has_stamped_cmd_vel: bool
    log_directory: Path | None
    """None: the node writes no logs."""


def declare(node: Entity) -> None:
    """Declares the parameters. Their types are checked here: ROS' own words for a wrong one do not help."""
    from rcl_interfaces.msg import ParameterDescriptor  # imported late: all else here needs no ROS

    for name, (default, text) in DEFAULTS.items():
        node.declare_parameter(name, default, ParameterDescriptor(description=text, dynamic_typing=True))


def unknown(given: Iterable[str], known: Container[str]) -> list[str]:
    """Returns the words for those that are given and that the node does not have, with the nearest that it has."""
    wrong = sorted(name for name in given if name not in known and not name.startswith("qos_overrides."))
    near = {name: get_close_matches(name, DEFAULTS, 1) for name in wrong}
    return [
        f"there is no parameter {name}" + "".join(f": do you mean {other}?" for other in near[name]) for name in wrong
    ]


def refusal(given: Mapping[str, Any], *, is_configured: bool) -> str:
    """Returns why these values cannot be set now. Empty: they can."""
    ours = {name: value for name, value in given.items() if name in DEFAULTS}
    if ours and is_configured:
        return _WHEN_READ.format(", ".join(ours))
    try:
        for name, value in ours.items():
            _require_type(name, value)
            if name.endswith("rate_hz"):
                _rate(ours, name)
            if name == "transform_tolerance":
                _tolerance_s(ours)
    except ual.InvalidArgumentError as error:
        return error.message
    return ""


def read(node: Entity) -> NodeSettings:
    """Reads the parameters.

    Raises:
        InvalidArgumentError: One of them is none that the node can work with.

    """
    return settings_of({name: node.get_parameter(name).value for name in DEFAULTS})


def settings_of(given: Mapping[str, Any]) -> NodeSettings:
    """Checks the values of the parameters; see `read`."""
    for name in DEFAULTS:
        _require_type(name, given[name])
    return NodeSettings(
        uavs=_pairs(_listed(given["ns"]), _listed(given["address"])),
        tls_ca=given["tls_ca"] or None,
        credentials=_credentials(given),
        lease_holder=str(given["lease_holder"]) if given["lease"] else None,
        lease_take=bool(given["lease_take"]),
        rate_hz=_rate(given, "rate_hz"),
        slow_rate_hz=_rate(given, "slow_rate_hz"),
        camera_rate_hz=_rate(given, "camera_rate_hz"),
        feedback_rate_hz=_rate(given, "feedback_rate_hz"),
        transform_tolerance_s=_tolerance_s(given),
        refuses_late=bool(given["refuse_late"]),
        has_stamped_cmd_vel=bool(given["enable_stamped_cmd_vel"]),
        log_directory=_directory(given["log_directory"]),
    )


def require_name(ns: str) -> str:
    """Returns a namespace that ROS can have in the names of topics.

    Raises:
        InvalidArgumentError: ROS allows letters, digits, underscores and no digit at the beginning.

    """
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", ns):
        raise _invalid("ns", f"{ns!r} cannot be in a name of ROS: only letters, digits and underscores can")
    return ns


def _require_type(name: str, value: Any) -> None:  # noqa: ANN401 (what ROS has read)
    default = DEFAULTS[name][0]
    if isinstance(default, bool):
        _require(isinstance(value, bool), name, value, "true or false")
    elif isinstance(default, float):
        _require(isinstance(value, (int, float)) and not isinstance(value, bool), name, value, "a number")
    elif name in _IS_ONE_OR_MANY and not isinstance(value, str):
        _require(isinstance(value, Sequence) and all(isinstance(each, str) for each in value), name, value, "text")
    else:
        _require(isinstance(value, str), name, value, "text")


def _require(is_right: bool, name: str, value: object, what: str) -> None:
    if not is_right:
        raise _invalid(name, f"{value!r} is not {what}")


def _listed(value: str | list[str]) -> list[str]:
    listed = [value] if isinstance(value, str) else list(value)
    return [each for each in listed if each]


def _pairs(names: list[str], addresses: list[str]) -> tuple[tuple[str, str], ...]:
    if len(set(names)) < len(names):
        raise _invalid("ns", f"{', '.join(names)} names a UAV twice")
    if len(addresses) == 1:  # of the only one, or of a gateway to all of them
        addresses = addresses * max(len(names), 1)
    if names and addresses and len(names) != len(addresses):
        text = f"there are {len(addresses)} addresses for {len(names)} namespaces; give one for each, or a gateway's"
        raise _invalid("address", text)
    if not addresses and (network := environment.value(environment.NETWORK_VARIABLE)):
        text = f"the node does not look on the network ({environment.NETWORK_VARIABLE}={network})"
        raise _invalid("address", f"{text}: unset that, or say where the UAVs are")
    return tuple(zip_longest(names, addresses, fillvalue=""))


def _credentials(given: Mapping[str, Any]) -> ual.Credentials:
    """Returns the credentials of the parameters, and of the environment where one is not given, as for every client."""
    names = ("token_file", "tls_certificate", "tls_key")
    return ual.Credentials.from_environment(*(given[name] or None for name in names))


def _directory(path: str) -> Path | None:
    if not path:
        return None
    if not Path(path).is_dir():
        raise _invalid("log_directory", f"{path} is no directory")
    return Path(path).absolute()


def _rate(given: Mapping[str, Any], name: str) -> float:
    rate_hz = given[name]
    if not 0.0 < rate_hz <= 1000.0:
        raise _invalid(name, f"{rate_hz} is not a rate of 0 to 1000 Hz")
    return float(rate_hz)


def _tolerance_s(given: Mapping[str, Any]) -> float:
    tolerance_s = given["transform_tolerance"]
    if not tolerance_s > 0.0:
        raise _invalid("transform_tolerance", f"{tolerance_s} is not a time above 0 s")
    return float(tolerance_s)


def _invalid(name: str, text: str) -> ual.InvalidArgumentError:
    return ual.InvalidArgumentError(f"{name}: {text}", {"field": name})
