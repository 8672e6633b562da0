"""Makes Zenoh's configuration from our settings, and its access control by certificate. Pure."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ual.network import keys
from ual.network.settings import NetworkSettings, Scouting

LEASE_MS = 2000
"""A process that is stopped, or whose computer is cut off, is gone after this time."""
_KEEP_ALIVE_COUNT = 4
"""Signs of life in a lease."""
_OPEN_MS = 2000
"""Milliseconds that a connection may take. TCP asks at 0 and 1 s, then ever more seldom: a new attempt is sooner
there.
"""
_MULTICAST_GROUP = "224.0.0.224"
_RETRY = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5}
_LARGEST_MESSAGE_BYTES = 4 << 20
"""The longest message that is taken from others."""
_OFF = {"enabled": False}

_TO_LISTENERS = ["put", "liveliness_token"]
_FROM_LISTENERS = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]

_LISTEN, _BE_TOLD, _BE_ASKED, _PASS_ON = "to listen", "to be told", "to be asked", "to pass on"
"""Names of rules; a publisher's has its own name."""

Json = dict[str, Any]
_Allowed = tuple[str, Sequence[str] | None, Sequence[str]]
"""A group of certificates with the same rights: its name, the names in their certificates (None: any), and which rules.
"""


def of(settings: NetworkSettings) -> str:
    """Returns the configuration of a program that joins the network, as text for Zenoh.

    Zenoh tries each router once: with a `timeout_ms` it would try the first one until that time is up.
    """
    config: Json = {
        "transport": transport(settings),
        "scouting": {"multicast": _OFF, "gossip": _OFF},
        "adminspace": _OFF,
    }
    if settings.connect:
        config["mode"] = "client"
        config["connect"] = {
            "endpoints": list(settings.connect),
            "timeout_ms": 0,
            "exit_on_failure": True,
            "retry": _RETRY,
        }
    else:
        config |= _among_peers(settings)
    return json.dumps(config)


def _among_peers(settings: NetworkSettings) -> Json:
    """Returns what differs where programs find each other by multicast."""
    is_lan = settings.means is Scouting.LAN
    multicast: Json = {"enabled": True, "address": f"{_MULTICAST_GROUP}:{settings.scouting_port}"}
    config: Json = {
        "mode": "peer",
        "listen": {"endpoints": ["tls/0.0.0.0:0" if is_lan else "tcp/127.0.0.1:0"]},
        "scouting": {"multicast": multicast if is_lan else {**multicast, "interface": "lo"}, "gossip": _OFF},
    }
    if is_lan:
        config["access_control"] = _access_among_peers(settings.site, settings.publishers)
    return config


def transport(settings: NetworkSettings) -> Json:
    """Returns how links are kept, and by which certificates."""
    link: Json = {
        "protocols": ["tls", "quic"] if settings.has_certificate else ["tcp"],
        "tx": {"lease": LEASE_MS, "keep_alive": _KEEP_ALIVE_COUNT},
        "rx": {"max_message_size": _LARGEST_MESSAGE_BYTES},
    }
    if settings.has_certificate:
        link["tls"] = _tls(settings)
    return {"link": link, "unicast": {"open_timeout": _OPEN_MS}, "shared_memory": _OFF}


def _tls(settings: NetworkSettings) -> Json:
    certificate, key = str(settings.certificate), str(settings.key)
    return {
        "root_ca_certificate": str(settings.authority),
        "enable_mtls": True,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "listen_certificate": certificate,
        "listen_private_key": key,
        # Peers of a LAN find each other by address, and know each other by the team's authority.
        "verify_name_on_connect": settings.means is not Scouting.LAN,
        "close_link_on_expiration": True,
    }


def access_control(site: str, publishers: Sequence[str], observers: Sequence[str], routers: Sequence[str]) -> Json:
    """Returns the rules by the names in certificates.

    A UAV publishes under its own name and sees nothing. An observer sees, and publishes nothing. Routers pass on.
    Others can do nothing.
    """
    everything = [keys.all_of(site)]
    common = [
        _rule(_LISTEN, "ingress", _FROM_LISTENERS, everything),
        _rule(_BE_TOLD, "egress", _TO_LISTENERS, everything),
        _rule(_BE_ASKED, "egress", _FROM_LISTENERS, everything),
        _rule(_PASS_ON, "ingress", _TO_LISTENERS, everything),
    ]
    rules = common + [_rule_of(site, publisher) for publisher in publishers]
    allowed: list[_Allowed] = []
    if observers:
        allowed.append(("observers", observers, [_LISTEN, _BE_TOLD]))
    if routers:
        allowed.append(("routers", routers, [_LISTEN, _BE_TOLD, _BE_ASKED, _PASS_ON]))
    allowed += [(publisher, [publisher], [publisher, _BE_ASKED]) for publisher in publishers]
    return _access(rules, allowed)


def _access_among_peers(site: str, publishers: Sequence[str]) -> Json:
    """Returns the rules of a program on a LAN without routers. It takes each UAV's word from that UAV only. Every
    holder of a certificate of the team may listen.
    """
    everything = [keys.all_of(site)]
    common = [
        _rule(_LISTEN, "ingress", _FROM_LISTENERS, everything),
        _rule(_BE_TOLD, "egress", _TO_LISTENERS, everything),
        _rule(_BE_ASKED, "egress", _FROM_LISTENERS, everything),
    ]
    allowed: list[_Allowed] = [("team", None, [_LISTEN, _BE_TOLD, _BE_ASKED])]
    allowed += [(publisher, [publisher], [publisher]) for publisher in publishers]
    return _access(common + [_rule_of(site, publisher) for publisher in publishers], allowed)


def _access(rules: Sequence[Json], allowed: Sequence[_Allowed]) -> Json:
    """Returns access control that denies what no rule allows."""
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": list(rules),
        "subjects": [
            {"id": name} if names is None else {"id": name, "cert_common_names": list(names)}
            for name, names, _ in allowed
        ],
        "policies": [{"rules": list(ids), "subjects": [name]} for name, _, ids in allowed],
    }


def _rule_of(site: str, publisher: str) -> Json:
    return _rule(publisher, "ingress", _TO_LISTENERS, [keys.all_of(site, publisher)])


def router(
    settings: NetworkSettings,
    *,
    listen: Sequence[str],
    connect: Sequence[str] = (),
    publishers: Sequence[str] = (),
    observers: Sequence[str] = (),
    routers: Sequence[str] = (),
) -> Json:
    """Returns the configuration of a router, for ``zenohd --config`` or ``ual router``.

    Args:
        settings: Its site and its certificate.
        listen: Where it is reached.
        connect: The routers that it connects to.
        publishers: Those that may tell, by the names in their certificates.
        observers: Those that may listen.
        routers: The other routers.

    """
    config: Json = {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": list(connect), "timeout_ms": -1, "exit_on_failure": False, "retry": _RETRY},
        "scouting": {"multicast": _OFF},
        "transport": transport(settings),
        "adminspace": _OFF,
    }
    if settings.has_certificate:
        config["access_control"] = access_control(settings.site, publishers, observers, routers)
    return config


def _rule(name: str, flow: str, messages: Sequence[str], key_exprs: Sequence[str]) -> Json:
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": list(key_exprs),
    }
