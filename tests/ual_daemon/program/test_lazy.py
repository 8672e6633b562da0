"""Modules that load late do what they always do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S

TLS = Path(__file__).parents[2] / "data" / "tls"


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
    """Programs set the HTTPS context of Python in this way, to trust a certificate of their own."""
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
