from typing import Any

import pytest

from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.settings import Endpoint, default_url, parse_url
from ual_daemon.settings import ConfigError


@pytest.mark.parametrize(
    ("ns", "port"),
    [("uav_1", 14540), ("uav_2", 14541), ("uav_12", 14551), ("drone", 14540), ("a_2_b", 14540), ("uav2", 14540)],
)
def test_the_default_is_where_px4s_simulator_sends_the_vehicle_of_the_namespace(ns: str, port: int) -> None:
    assert default_url(ns) == f"udpin://127.0.0.1:{port}"


@pytest.mark.parametrize(
    ("url", "endpoint"),
    [
        ("udp://:14540", Endpoint("0.0.0.0", 14540, is_listening=True)),
        ("udp://127.0.0.1:14541", Endpoint("127.0.0.1", 14541, is_listening=True)),
        ("udpin://192.168.1.2:14550", Endpoint("192.168.1.2", 14550, is_listening=True)),
        ("udpin://:14550", Endpoint("0.0.0.0", 14550, is_listening=True)),
        ("udpin://[::1]:14550", Endpoint("::1", 14550, is_listening=True)),
        ("udpout://drone.local:14580", Endpoint("drone.local", 14580, is_listening=False)),
    ],
)
def test_urls_are_understood(url: str, endpoint: Endpoint) -> None:
    assert parse_url(url) == endpoint


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("tcp://127.0.0.1:5760", "tcp:// is not supported"),
        ("serial:///dev/ttyUSB0:57600", "serial:// is not supported"),
        ("14540", "no scheme"),
        ("", "no scheme"),
        ("udp://127.0.0.1", "a port"),
        ("udp://:0", "a port"),
        ("udp://:70000", "ort"),
        ("udp://:abc", "ort"),
        ("udpout://:14580", "a host"),
        ("udp://:14540/x", "more than a host and a port"),
        ("udp://a@b:14540", "more than a host and a port"),
        ("udp://[::1:14540", ""),
    ],
)
def test_a_url_that_cannot_be_used_is_refused_in_one_line_that_says_what_is_supported(url: str, why: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_url(url)
    text = str(caught.value)
    assert text.startswith("mavlink.url: ")
    assert why in text
    assert "udpout://HOST:PORT" in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"urk": 1}, "mavlink.urk"),
        ({"system_id": 0}, "mavlink.system_id"),
        ({"system_id": 255}, "mavlink.system_id"),
        ({"pose_rate_hz": float("inf")}, "mavlink.pose_rate_hz"),
        ({"url": "tcp://x:1"}, "mavlink.url"),
    ],
)
def test_bad_settings_are_refused_with_their_key(settings: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        MavlinkBackend(BackendOptions("uav_1", settings=settings))
    assert caught.value.key == key


def test_the_command_line_wins_over_the_settings_and_they_over_the_default() -> None:
    configured = {"url": "udp://:2"}
    assert MavlinkBackend(BackendOptions("uav_1", "udp://:1", configured)).options.url == "udp://:1"
    assert MavlinkBackend(BackendOptions("uav_1", None, configured)).options.url == "udp://:2"
    assert MavlinkBackend(BackendOptions("uav_3")).options.url == "udpin://127.0.0.1:14542"
