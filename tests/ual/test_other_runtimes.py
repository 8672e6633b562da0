"""The client where Python runs otherwise: in forked processes, under gevent, on several event loops."""

from __future__ import annotations

import asyncio
import subprocess
import sys

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess

FORKED = """
import os, sys, ual
from ual.geometry import Twist
uav = ual.Uav(address=sys.argv[1])
for _ in range(18):
    uav.telemetry()
    if not os.fork():
        try:
            uav.telemetry()
            try:
                uav.set_velocity(Twist())
            except ual.WrongStateError:
                os._exit(0)
        finally:
            os._exit(1)
    if os.wait()[1]:
        sys.exit("a call failed in the child")
uav.telemetry()
"""

FORKED_SUBSCRIBER = """
import os, sys, threading, ual
def listens(uav):
    got = threading.Event()
    with uav.subscribe(lambda _: got.set(), 10.0):
        return got.wait(60.0)
with ual.Uav(address=sys.argv[1]) as uav:
    with uav.subscribe(lambda _: None, 10.0) as subscription:
        if not os.fork():
            heard = listens(uav)
            subscription.close()
            uav.close()
            os._exit(0 if heard else 1)
        if os.wait()[1]:
            sys.exit("the child heard nothing")
        sys.exit(0 if listens(uav) else 1)
"""

FORKED_HOLDER = """
import os, sys, ual
uav = ual.Uav(address=sys.argv[1])
with uav.lease("survey") as lease:
    if not os.fork():
        lease.release()
        uav.close()
        os._exit(0)
    os.wait()
    other = ual.Uav(address=sys.argv[1])
    try:
        other.set_home()
    except ual.LeaseHeldError:
        sys.exit(0)
sys.exit("the child has released the lease of its parent")
"""

FORKED_ASYNCIO = """
import asyncio, os, sys, ual
async def ask():
    async with ual.aio.Uav(address=sys.argv[1]) as uav:
        await uav.telemetry()
def forked(call):
    sys.stdout.flush()
    if not os.fork():
        try:
            call()
        except ual.UalError as error:
            print(error, flush=True)
            os._exit(0)
        os._exit(1)
    if os.wait()[1]:
        sys.exit("the child did not say it")
with ual.Team([sys.argv[1]]) as team:
    forked(team.telemetry)
    team.telemetry()
    forked(team.telemetry)
    forked(lambda: asyncio.run(ask()))
    team.telemetry()
"""

GEVENT = """
from gevent import monkey
monkey.patch_all()
import gevent, gevent.event, sys, ual
with ual.Uav(address=sys.argv[1]) as uav:
    got = gevent.event.Event()
    with uav.subscribe(lambda _: got.set(), 10.0):
        assert got.wait(60.0)
    try:
        uav.set_velocity(ual.Twist())
    except ual.WrongStateError:
        print("done")
"""

GEVENT_TOO_LATE = """
import sys
from ual import Uav, UalError
from gevent import monkey
monkey.patch_all()
try:
    Uav(address=sys.argv[1]).subscribe(print)
except UalError as error:
    print(error)
"""

GEVENT_ASYNCIO = """
from gevent import monkey
monkey.patch_all()
import asyncio, sys, ual
async def ask():
    async with ual.aio.Uav(address=sys.argv[1]) as uav:
        await uav.telemetry()
try:
    asyncio.run(ask())
except ual.UalError as error:
    print(error)
with ual.Team([sys.argv[1]]) as team:
    try:
        team.telemetry()
    except ual.TeamError as error:
        print(error)
"""


@pytest.fixture(autouse=True)
def armed(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")


def run(program: str, daemon: DaemonProcess) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program, daemon.address]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_client_works_in_a_forked_process_and_in_its_parent(daemon: DaemonProcess) -> None:
    done = run(FORKED, daemon)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_forked_process_has_subscriptions_of_its_own_and_ends(daemon: DaemonProcess) -> None:
    done = run(FORKED_SUBSCRIBER, daemon)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_forked_process_leaves_the_lease_to_its_parent(daemon: DaemonProcess) -> None:
    done = run(FORKED_HOLDER, daemon)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_asyncio_that_does_not_survive_a_fork_says_so(daemon: DaemonProcess) -> None:
    done = run(FORKED_ASYNCIO, daemon)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("which gRPC's asyncio does not survive: this process may crash") == 3


def test_telemetry_flows_under_gevent(daemon: DaemonProcess) -> None:
    done = run(GEVENT, daemon)
    assert (done.stdout, done.returncode) == ("done\n", 0), done.stderr


def test_what_cannot_run_under_gevent_says_so(daemon: DaemonProcess) -> None:
    done = run(GEVENT_TOO_LATE, daemon)
    assert "monkey.patch_all() was called after ual's client was imported" in done.stdout, done.stderr
    done = run(GEVENT_ASYNCIO, daemon)
    assert done.stdout.count("ual.aio and ual.Team do not run under gevent's") == 2, done.stderr


OTHER_LOOP = "belongs to another event loop"


def test_a_client_of_another_event_loop_says_so(daemon: DaemonProcess) -> None:
    uav = ual.aio.Uav(address=daemon.address)

    async def ask() -> None:
        await uav.info()

    async def listen() -> None:
        async for _ in uav.subscribe():
            return

    asyncio.run(ask())
    for other in (ask, listen):
        with pytest.raises(ual.UalError, match=OTHER_LOOP):
            asyncio.run(other())


def test_what_flows_on_one_event_loop_is_not_lost_on_another(daemon: DaemonProcess) -> None:
    uav = ual.aio.Uav(address=daemon.address)
    subscription = uav.subscribe()
    here = ual.PoseStamped(ual.Pose.at(0.0, 0.0, 0.0, 0.0))

    async def send(count: int) -> None:
        for _ in range(count):
            await uav.set_external_pose(here)

    async def listen() -> None:
        await anext(subscription)

    loop = asyncio.new_event_loop()
    loop.run_until_complete(send(3))
    loop.run_until_complete(listen())
    for other in (send(1), listen(), uav.close()):
        with pytest.raises(ual.UalError, match=OTHER_LOOP):
            asyncio.run(asyncio.wait_for(other, LIMIT_S))
    loop.run_until_complete(send(1))
    loop.run_until_complete(uav.close())
    loop.close()
