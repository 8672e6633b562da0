"""What a daemon does not need is not loaded: it costs memory, and time at the start."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, DaemonProcess
from ual import Uav, _discovery
from ual.types import State

NEVER = {
    "_hashlib",
    "_ssl",
    "email",
    "importlib.metadata",
    "numpy",
    "secrets",
    "shapely",
    "tempfile",
    "unittest",
    "zipfile",
}
TLS = Path(__file__).parents[2] / "data" / "tls"


def loaded(daemon: DaemonProcess) -> set[str]:
    """The modules that it has loaded."""
    return set(re.findall(r"^import time:.*\| +(\S+)$", daemon.stderr, re.MULTILINE))


def start(runtime_dir: Path, *flags: str) -> DaemonProcess:
    variables = {_discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir), "PYTHONPROFILEIMPORTTIME": "1"}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
    return DaemonProcess(("--listen", "127.0.0.1:0", *flags), "uav_1", environment | variables)


def test_a_light_uav_flies_without_what_it_does_not_need(runtime_dir: Path) -> None:
    with closing(start(runtime_dir, "--auto-arm", "--set", "light.speed_factor=10")) as daemon:
        with Uav(address=daemon.address) as uav:
            daemon.wait_for("state", new="LANDED_ARMED")
            uav.take_off(2.0)
            assert uav.state() is State.FLYING_AUTO
        found = loaded(daemon)
    assert {"ual_daemon.program.lazy", "grpc.aio", "ual_daemon.flight.manoeuvre"} <= found
    assert not found & (NEVER | {"pymavlink"})


def test_a_mavlink_uav_waits_without_what_it_does_not_need(runtime_dir: Path) -> None:
    with closing(start(runtime_dir, "--backend", "mavlink", "--url", "udpout://127.0.0.1:9")) as daemon:
        with Uav(address=daemon.address) as uav:
            assert uav.state() is State.UNINITIALIZED
        found = loaded(daemon)
    assert {"pymavlink", "asyncio"} <= found
    assert not found & (NEVER | {"yaml"})


@pytest.mark.parametrize("first", ["hashlib", "ssl", "asyncio"])
def test_what_loads_late_does_what_it_always_does(first: str) -> None:
    code = f"""
import sys
from ual_daemon.program import lazy

assert not {{"asyncio", "ssl", "hashlib"}} & set(sys.modules)
lazy.prepare()
import asyncio, hashlib, ssl
assert not {{"_hashlib", "_ssl"}} & set(sys.modules)

def use_hashlib():
    assert hashlib.sha256(b"").hexdigest().startswith("e3b0c442")
    assert not hasattr(hashlib, "nonsense")

def use_ssl():
    from ssl import SSLContext
    assert isinstance(ssl.create_default_context(), SSLContext)

async def talk():
    async def greet(reader, writer):
        writer.write(b"hello")
        writer.close()

    its = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    its.load_cert_chain({str(TLS / "certificate.pem")!r}, {str(TLS / "key.pem")!r})
    ours = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    ours.check_hostname = False
    ours.verify_mode = ssl.CERT_NONE
    async with await asyncio.start_server(greet, "127.0.0.1", 0, ssl=its) as server:
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname(), ssl=ours)
        assert await reader.read() == b"hello"
        writer.close()

def use_asyncio():
    asyncio.run(talk())

use_{first}()
use_hashlib()
use_ssl()
use_asyncio()
"""
    assert subprocess.run([sys.executable, "-c", code], timeout=LIMIT_S).returncode == 0


def test_what_is_set_before_it_is_loaded_is_set_for_everybody() -> None:
    """As Python's HTTPS is told to trust a certificate of one's own."""
    code = """
import sys
from importlib.util import find_spec
from ual_daemon.program import lazy

lazy.prepare()
import ssl
assert find_spec("ssl") and find_spec("hashlib")
ssl._create_default_https_context = ssl._create_unverified_context
ssl.OURS = 1
import http.client
assert "_ssl" in sys.modules
assert http.client.HTTPSConnection("localhost")._context.verify_mode == ssl.CERT_NONE
assert sys.modules["ssl"].OURS == ssl.OURS == 1
"""
    assert subprocess.run([sys.executable, "-c", code], timeout=LIMIT_S).returncode == 0
