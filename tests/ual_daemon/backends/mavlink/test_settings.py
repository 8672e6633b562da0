from typing import Any

import pytest

from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.settings import default_url
from ual_daemon.settings import ConfigError


@pytest.mark.parametrize(
    ("ns", "port"),
    [("uav_1", 14540), ("uav_2", 14541), ("uav_12", 14551), ("drone", 14540), ("a_2_b", 14540), ("uav2", 14540)],
)
def test_the_default_is_where_px4s_simulator_sends_the_vehicle_of_the_namespace(ns: str, port: int) -> None:
    assert default_url(ns) == f"udpin://127.0.0.1:{port}"


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"urk": 1}, "mavlink.urk"),
        ({"system_id": 0}, "mavlink.system_id"),
        ({"system_id": 255}, "mavlink.system_id"),
        ({"pose_rate_hz": float("inf")}, "mavlink.pose_rate_hz"),
        ({"url": "udp://x:1"}, "mavlink.url"),
        ({"signing_key_file": "/nowhere/key"}, "mavlink.signing_key_file"),
    ],
)
def test_bad_settings_are_refused_with_their_key(settings: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        MavlinkBackend(BackendOptions("uav_1", settings=settings))
    assert caught.value.key == key


def test_the_command_wins_over_the_settings_and_they_over_the_default() -> None:
    configured = {"url": "udp://:2"}
    assert MavlinkBackend(BackendOptions("uav_1", "udp://:1", configured)).options.url == "udp://:1"
    assert MavlinkBackend(BackendOptions("uav_1", None, configured)).options.url == "udp://:2"
    assert MavlinkBackend(BackendOptions("uav_3")).options.url == "udpin://127.0.0.1:14542"
