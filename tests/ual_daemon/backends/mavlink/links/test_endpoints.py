import re

import pytest

from ual_daemon.backends.mavlink.links.endpoints import (
    Endpoint,
    SerialEndpoint,
    TcpEndpoint,
    UdpEndpoint,
    parse_address,
    parse_url,
    vehicle_urls,
)
from ual_daemon.settings import ConfigError


@pytest.mark.parametrize(
    ("url", "endpoint"),
    [
        ("udp://:14540", UdpEndpoint("0.0.0.0", 14540, is_listening=True)),
        ("udp://0.0.0.0:14540", UdpEndpoint("0.0.0.0", 14540, is_listening=True)),
        ("udpin://127.0.0.1:14541", UdpEndpoint("127.0.0.1", 14541, is_listening=True)),
        ("udpin://:14550", UdpEndpoint("0.0.0.0", 14550, is_listening=True)),
        ("udpin://[::1]:14550", UdpEndpoint("::1", 14550, is_listening=True)),
        ("udpout://drone.local:14580", UdpEndpoint("drone.local", 14580, is_listening=False)),
        ("tcp://127.0.0.1:5760", TcpEndpoint("127.0.0.1", 5760, is_listening=False)),
        ("tcpout://127.0.0.1:5760", TcpEndpoint("127.0.0.1", 5760, is_listening=False)),
        ("tcpin://:5790", TcpEndpoint("0.0.0.0", 5790, is_listening=True)),
        ("tcpin://127.0.0.1:5790", TcpEndpoint("127.0.0.1", 5790, is_listening=True)),
        ("serial:///dev/ttyACM0:921600", SerialEndpoint("/dev/ttyACM0", 921600)),
        ("/dev/ttyUSB0:57600", SerialEndpoint("/dev/ttyUSB0", 57600)),
        ("serial:///tmp/ttyV0:57600", SerialEndpoint("/tmp/ttyV0", 57600)),
        ("/tmp/ttyV0:57600", SerialEndpoint("/tmp/ttyV0", 57600)),
        ("serial:/dev/ttyACM0:57600", SerialEndpoint("/dev/ttyACM0", 57600)),
        ("serial:///dev/serial/by-path/pci-0:1.0:115200", SerialEndpoint("/dev/serial/by-path/pci-0:1.0", 115200)),
    ],
)
def test_urls_are_understood(url: str, endpoint: Endpoint) -> None:
    assert parse_url(url) == endpoint


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("14540", "no scheme"),
        ("", "no scheme"),
        ("file:///tmp/x", "file:// is not supported"),
        ("udpin://127.0.0.1", "a port"),
        ("tcp://127.0.0.1", "a port"),
        ("udp://:0", "a port"),
        ("udp://:70000", "it needs a port from 1 to 65535"),
        ("udp://:abc", "it needs a port from 1 to 65535"),
        ("udpout://:14580", "a host"),
        ("tcp://:5760", "a host"),
        ("udp://:14540/x", "more than a host and a port in it; write udp://:14540;"),
        ("udpin://[::1:14540", "its host is no name and no IP address"),
        # ambiguous: some listen there, some call there
        ("udp://10.0.0.7:14550", "write udpin://10.0.0.7:14550 to listen there or udpout://10.0.0.7:14550 to call;"),
        # MAVROS
        ("udp://:14540@127.0.0.1:14580", "write udpout://127.0.0.1:14580 to call;"),
        ("udp://:14540@", "write udpin://:14540;"),
        ("tcp-l://:5760", "write tcpin://;"),
        ("serial:///dev/ttyACM0?baudrate=57600", "write serial:///dev/ttyACM0:57600;"),
        # pymavlink, MAVProxy
        ("udp:127.0.0.1:14550", "write udpin://127.0.0.1:14550;"),
        ("udpin:0.0.0.0:14550", "write udpin://0.0.0.0:14550;"),
        ("tcp:127.0.0.1:5760", "write tcp://127.0.0.1:5760;"),
        ("/dev/ttyACM0,57600", "write serial:///dev/ttyACM0:57600;"),
        # MAVSDK
        ("serial_flowcontrol:///dev/ttyACM0:57600", "write serial://;"),
        ("serial:///dev/ttyACM0", "it needs a baud rate; write serial:///dev/ttyACM0:57600, or"),
        ("serial://ttyACM0", "it needs a baud rate; write serial:///dev/ttyACM0:57600, or"),
        ("serial:ttyACM0", "it needs a baud rate; write serial:///dev/ttyACM0:57600, or"),
        ("serial:///dev/ttyACM0:", "it needs a baud rate"),
        ("serial:///dev/ttyACM0:fast", "it needs a baud rate"),
        ("serial:///dev/ttyACM0:7", "7 is no baud rate"),
        ("serial://dev/ttyACM0:57600", "write serial:///dev/ttyACM0:57600;"),
        ("serial://ttyACM0:57600", "write serial:///dev/ttyACM0:57600;"),
        ("serial:///ttyACM0:57600", "write serial:///dev/ttyACM0:57600;"),
        ("serial:///tmp/ttyV0", "it needs a baud rate; write serial:///tmp/ttyV0:57600, or"),
        ("serial://tmp/ttyV0:57600", "write serial:///tmp/ttyV0:57600;"),
        ("udpout://255.255.255.255:14550", "several vehicles at once (broadcast, multicast); write udpin://:14550 to"),
        ("udpin://239.255.145.50:14550", "several vehicles at once"),
        ("udpbcast://192.168.1.255:14550", "write udpin://;"),
        ("serial://", "a baud rate"),
    ],
)
def test_a_url_that_cannot_be_used_is_refused_in_one_message_with_the_right_spelling(url: str, why: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_url(url)
    text = str(caught.value)
    assert text.startswith("mavlink.url: ")
    assert why in text
    assert "udpout://HOST:PORT" in text
    assert "\n" not in text


def test_a_url_may_name_the_system_id_behind_any_link() -> None:
    udp = UdpEndpoint("0.0.0.0", 14550, is_listening=True)
    assert parse_address("udp://:14550") == (udp, None)
    assert parse_address("udp://:14550?system_id=7") == (udp, 7)
    assert parse_address("serial:///dev/ttyUSB0:57600?system_id=254") == (SerialEndpoint("/dev/ttyUSB0", 57600), 254)


def test_a_url_may_name_several_vehicles() -> None:
    assert vehicle_urls("udp://:14550") == ["udp://:14550"]
    assert vehicle_urls("/dev/ttyUSB0:57600?system_id=3,1") == [
        "/dev/ttyUSB0:57600?system_id=3",
        "/dev/ttyUSB0:57600?system_id=1",
    ]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "not numbers; write udp://:14550?system_id=1 or udp://:14550?system_id=1,2,3"),
        ("1,", "not numbers"),
        ("1-3", "not numbers"),
        ("0", "system ids are from 1 to 254"),
        ("1,255", "system ids are from 1 to 254"),
    ],
)
def test_system_ids_that_no_vehicle_has_are_refused(text: str, why: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(why)):
        vehicle_urls(f"udp://:14550?system_id={text}")
