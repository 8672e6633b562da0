"""The lease by the clients, against a real daemon, and in the process."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.waiting import until, until_async
from ual import State, Twist, Vector3, _calls
from ual.errors import LeaseHeldError, LeaseLostError, TaskAbortedError, TeamError, UnauthenticatedError
from ual.interface import Uav
from ual_daemon import UAL

FAR = ual.Pose.at(500.0, 0.0, 3.0)


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TOKEN", "UAL_TOKEN_FILE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def uav(daemon: DaemonProcess) -> Iterator[ual.Uav]:
    with ual.Uav(address=daemon.address) as uav:
        uav.wait_for(State.LANDED_ARMED, timeout_s=LIMIT_S)
        yield uav


@contextmanager
def another(daemon: DaemonProcess) -> Iterator[ual.Uav]:
    with ual.Uav(address=daemon.address) as uav:
        yield uav


def wait_until_at_rest(uav: Uav) -> None:
    stands = threading.Event()
    with uav.subscribe(
        lambda sample: stands.set() if sample.velocity and sample.velocity.linear.norm() < 0.05 else None
    ):
        assert stands.wait(LIMIT_S)


def test_while_one_has_it_another_is_refused_and_reported_who(daemon: DaemonProcess, uav: ual.Uav) -> None:
    with uav.lease("survey"), another(daemon) as other:
        uav.take_off(3.0)
        with pytest.raises(LeaseHeldError, match="survey") as caught:
            other.land()
        assert caught.value.metadata["identity"] == "local"
        held = other.lease_info()
        assert held is not None
        assert (held.holder, held.identity) == ("survey", "local")
        with pytest.raises(LeaseHeldError):
            other.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
        assert other.state() is State.FLYING_AUTO  # reading needs none
    assert uav.lease_info() is None
    uav.land()


def test_a_stream_of_setpoints_of_another_ends_when_one_acquires_it(daemon: DaemonProcess, uav: ual.Uav) -> None:
    uav.take_off(3.0)
    stopped: list[ual.UalError] = []

    def stream() -> None:
        with another(daemon) as other:
            try:
                while True:
                    other.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
            except ual.UalError as error:
                stopped.append(error)

    thread = threading.Thread(target=stream)
    thread.start()
    flies = threading.Event()
    with uav.subscribe(lambda sample: flies.set() if sample.velocity and sample.velocity.linear.x > 0.5 else None):
        assert flies.wait(LIMIT_S)
    with uav.lease("survey"):
        thread.join(LIMIT_S)
        assert [type(error) for error in stopped] == [LeaseHeldError]
        uav.set_velocity(Twist(Vector3(0.0, 1.0, 0.0)))
    wait_until_at_rest(uav)


def test_a_task_of_the_holder_ends_with_its_lease(uav: ual.Uav) -> None:
    uav.take_off(3.0)
    with uav.lease():
        task = uav.go_to_waypoint(FAR, blocking=False)
    with pytest.raises(TaskAbortedError, match="released the lease"):
        task.wait(LIMIT_S)
    wait_until_at_rest(uav)


def test_a_commander_takes_it_and_the_holder_is_notified(daemon: DaemonProcess, uav: ual.Uav) -> None:
    with another(daemon) as other:
        lease = uav.lease("survey")
        assert lease.lost is None
        with other.lease("film", take=True):
            with pytest.raises(LeaseLostError, match="taken by film"):
                uav.take_off(3.0)
            wait_for_loss(lease)
        lease.release()
        uav.take_off(3.0)  # without a lease


def wait_for_loss(lease: ual.interface.Lease) -> None:
    assert isinstance(until(lambda: lease.lost, "the holder's notice"), LeaseLostError)


def test_a_program_that_hangs_loses_it_and_the_uav_holds(daemon: DaemonProcess, uav: ual.Uav) -> None:
    uav.take_off(3.0)
    program = subprocess.Popen([sys.executable, "-c", HANGING, daemon.address], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    with program, program.stdout:
        assert program.stdout.readline() == "flying\n"
        program.send_signal(signal.SIGSTOP)
        daemon.wait_for("lease_ends")
        wait_until_at_rest(uav)
        program.send_signal(signal.SIGCONT)
        assert program.stdout.readline().startswith("LEASE_LOST")
    uav.land()


HANGING = """
import sys, time, ual
with ual.Uav(address=sys.argv[1]) as uav, uav.lease("hanging"):
    task = uav.go_to_waypoint(ual.Pose.at(500.0, 0.0, 3.0), blocking=False)
    print("flying", flush=True)
    try:
        while True:
            uav.set_velocity(ual.Twist(ual.Vector3(1.0, 0.0, 0.0)))
            time.sleep(0.05)
    except ual.UalError as error:
        print(error.reason, flush=True)
"""


def test_a_killed_program_loses_it_and_the_uav_holds(daemon: DaemonProcess, uav: ual.Uav) -> None:
    uav.take_off(3.0)
    program = subprocess.Popen([sys.executable, "-c", HANGING, daemon.address], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    with program, program.stdout:
        assert program.stdout.readline() == "flying\n"
        program.kill()
        daemon.wait_for("lease_ends")
    wait_until_at_rest(uav)
    uav.land()


def test_a_daemon_that_was_restarted_does_not_know_it(start_daemon: StartDaemon) -> None:
    first = start_daemon("--auto-arm")
    with ual.Uav(address=first.address) as uav:
        lease = uav.lease()
        first.signal(signal.SIGTERM)
        assert first.wait() == 0
        start_daemon("--auto-arm", listen=first.address).wait_for("listening")
        wait_for_loss(lease)


def test_for_asyncio(daemon: DaemonProcess, uav: ual.Uav) -> None:
    async def fly() -> None:
        async with ual.aio.Uav(address=daemon.address) as other:
            async with other.lease("survey") as lease:
                with pytest.raises(LeaseHeldError):
                    await asyncio.to_thread(uav.land)
                await other.take_off(3.0)
                assert lease.lost is None
            assert await other.lease_info() is None
            lease = await other.lease("again")
            await lease.release()
            await lease.release()
            await other.land()

    asyncio.run(fly())


def test_a_team_gets_all_leases_or_none(start_daemon: StartDaemon) -> None:
    names = ["uav_1", "uav_2"]
    for name in names:
        start_daemon("--auto-arm", ns=name).wait_for("listening")
    with ual.Team(names) as team, ual.Uav("uav_2") as other:
        with other.lease("film"):
            with pytest.raises(TeamError, match=r"uav_2: LEASE_HELD: .*film"):
                team.lease("survey")
            assert team.lease_info()["uav_1"] is None
        with team.lease("survey") as lease:
            with pytest.raises(LeaseHeldError):
                other.lease("film")
            assert lease.lost == {}
        assert set(team.lease_info().values()) == {None}


def test_in_the_process() -> None:
    with UAL("light", backend_settings={"speed_factor": 20.0}) as uav:
        uav.wait_for(State.LANDED_DISARMED, timeout_s=LIMIT_S)
        uav.arm()
        with uav.lease("me") as lease:
            uav.take_off(3.0)
            held = uav.lease_info()
            assert held is not None
            assert held.holder == "me"
            threading.Thread(target=uav.vehicle.acquire_lease, args=("another", "local"), kwargs={"take": True}).start()
            wait_for_loss(lease)
            assert isinstance(lease.lost, LeaseLostError)
            with pytest.raises(LeaseLostError):
                uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
            with pytest.raises(LeaseLostError):
                uav.land()
        with pytest.raises(LeaseHeldError, match="another"):
            uav.land()
        with uav.lease(take=True):
            uav.land()


def test_a_lease_that_the_daemon_does_not_release_keeps_no_client_open(
    daemon: DaemonProcess, uav: ual.Uav, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """As of a token that was revoked meanwhile. Without its holder the lease ends by itself."""

    def refuse(_: str) -> None:
        raise UnauthenticatedError("the token was revoked")

    monkeypatch.setattr(_calls, "release_lease", refuse)
    with another(daemon) as holder:
        holder.lease("survey")
    assert repr(holder).endswith("closed>")
    assert "the lease was not released: the token was revoked" in caplog.text
    until(lambda: uav.lease_info() is None)

    async def run() -> ual.aio.Uav:
        async with ual.aio.Uav(address=daemon.address) as holder:
            await holder.lease("survey")
        return holder

    assert repr(asyncio.run(run())).endswith("closed>")


def test_a_close_that_is_cancelled_leaves_nothing_open(daemon: DaemonProcess) -> None:
    async def run() -> None:
        uav = ual.aio.Uav(address=daemon.address)
        await uav.lease("survey")
        closing = asyncio.create_task(uav.close())
        await asyncio.sleep(0)  # it has begun, and waits for the daemon
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        assert repr(uav).endswith("closed>")

    asyncio.run(run())


def test_for_asyncio_a_lease_that_was_lost_can_be_acquired_again(
    daemon: DaemonProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[str] = []
    keep = _calls.keep_lease

    def keep_and_note(lease_id: str) -> _calls.Call[None]:
        kept.append(lease_id)
        return keep(lease_id)

    monkeypatch.setattr(_calls, "keep_lease", keep_and_note)

    async def run() -> None:
        async with ual.aio.Uav(address=daemon.address) as first, ual.aio.Uav(address=daemon.address) as second:
            lease = await first.lease("survey")
            async with second.lease("rescue", take=True):
                await until_async(lambda: lease.lost is not None)
                await lease.release()
            await lease
            assert lease.lost is None
            kept.clear()
            await until_async(lambda: bool(kept))
            await lease.release()
            assert await second.lease_info() is None

    asyncio.run(asyncio.wait_for(run(), LIMIT_S))
