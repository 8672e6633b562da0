from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ual import discovery
from ual._target import DaemonTarget
from ual.discovery import Registration
from ual.errors import InvalidArgumentError

GONE_PID = 2**31 - 5


@pytest.fixture(autouse=True)
def here(runtime_dir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("UAL_NS", "UAL_ADDRESS"):
        monkeypatch.delenv(name, raising=False)
    runtime_dir.mkdir()
    return runtime_dir


def register(ns: str, address: str = "127.0.0.1:6000", pid: int | None = None) -> Registration:
    registration = Registration(ns, os.getpid() if pid is None else pid, address, "light", 1.5)
    registration.write()
    return registration


@pytest.mark.parametrize(
    ("ns", "port"),
    [
        ("uav_1", 50051),
        ("uav_2", 50052),
        ("uav_10", 50060),
        ("uav_007", 50057),
        ("uav", 50051),
        ("uav2", 50051),
        ("red_3_blue", 50051),
        ("uav_99999", 50051),
    ],
)
def test_the_port_follows_the_number_of_the_namespace(ns: str, port: int) -> None:
    assert discovery.default_port(ns) == port
    assert discovery.default_address(ns) == f"127.0.0.1:{port}"


def test_the_directory_is_configured_or_temporary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(discovery.RUNTIME_DIR_VARIABLE, str(tmp_path))
    assert discovery.runtime_dir() == tmp_path
    monkeypatch.delenv(discovery.RUNTIME_DIR_VARIABLE)
    assert discovery.runtime_dir().name == "ual"


def test_a_registration_is_read_as_it_was_written(here: Path) -> None:
    registration = register("uav_3", "unix:/run/ual/uav_3.sock")
    assert Registration.read(discovery.registry_file("uav_3")) == registration
    assert [file.name for file in here.iterdir()] == ["uav_3.json"]


def as_json(**changed: object) -> str:
    """A registration of uav_1 that is alive, but for what is changed."""
    values = {"ns": "uav_1", "pid": 1, "address": "127.0.0.1:6000", "backend": "light", "started_s": 1.5}
    return json.dumps(values | changed)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"ns": "uav_1"}', '{"ns": "a", "pid": "x"}', "\x00\xff"])
def test_a_file_that_is_no_registration_is_none(text: str) -> None:
    refuse(text)


@pytest.mark.parametrize(
    "text",
    [
        as_json(pid=float("inf")),
        as_json(ns="uav_2"),
        as_json(backend="\x1b[2J"),
        as_json(address="\ud800"),
        as_json(backend="b" * 5000),
        "[" * 4000,
        "[" * 200_000,
    ],
    ids=["infinite", "of another", "control characters", "no text", "long", "deep", "deeper"],
)
def test_a_file_that_was_laid_to_do_harm_is_none(text: str) -> None:
    refuse(text)


def refuse(text: str) -> None:
    file = discovery.registry_file("uav_1")
    file.write_text(as_json())
    assert Registration.read(file) is not None
    file.write_text(text)
    assert Registration.read(file) is None
    assert discovery.list_daemons() == []


def test_a_pipe_is_no_registration_and_not_waited_for(here: Path) -> None:
    os.mkfifo(here / "uav_1.json")
    register("uav_2")
    assert [each.ns for each in discovery.list_daemons()] == ["uav_2"]
    assert discovery.registered("uav_1") is None


def test_a_linked_registration_is_not_followed(here: Path, tmp_path: Path) -> None:
    register("uav_1")
    (here / "uav_1.json").rename(tmp_path / "elsewhere.json")
    (here / "uav_1.json").symlink_to(tmp_path / "elsewhere.json")
    assert discovery.list_daemons() == []


def test_a_pid_that_somebody_else_has_by_now_is_no_daemon() -> None:
    discovery.lock_file("uav_1").touch()
    register("uav_1", pid=os.getpid())
    register("uav_2", "127.0.0.1:6002")
    assert discovery.registered("uav_1") is None
    assert discovery.find() == "127.0.0.1:6002"


def test_a_daemon_whose_pid_is_not_observed_from_here_is_there_by_its_lock() -> None:
    register("uav_1", pid=GONE_PID)
    with discovery.lock_file("uav_1").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert discovery.registered("uav_1") is not None
    assert discovery.registered("uav_1") is None


def test_where_the_lock_cannot_be_looked_at_it_goes_by_the_pid(here: Path) -> None:
    (here / "uav_1.lock").symlink_to(here / "nowhere")
    register("uav_1")
    assert discovery.registered("uav_1") is not None
    register("uav_1", pid=GONE_PID)
    assert discovery.registered("uav_1") is None


def test_a_daemon_that_was_killed_is_none() -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    for pid in (ended.pid, GONE_PID, 0, -1, 2**40):
        register("uav_1", pid=pid)
        assert discovery.registered("uav_1") is None
        assert discovery.list_daemons() == []
        assert discovery.find("uav_1") == "127.0.0.1:50051"


def test_daemons_are_listed_by_name_and_number() -> None:
    for ns in ("uav_10", "uav_2", "blimp", "uav_1"):
        register(ns)
    assert [each.ns for each in discovery.list_daemons()] == ["blimp", "uav_1", "uav_2", "uav_10"]


def test_no_directory_means_no_daemons(here: Path) -> None:
    here.rmdir()
    assert discovery.list_daemons() == []
    assert discovery.find() == "127.0.0.1:50051"


def test_a_daemon_is_found_where_it_registered() -> None:
    register("uav_4", "unix:/tmp/uav_4.sock")
    assert discovery.find("uav_4") == "unix:/tmp/uav_4.sock"
    assert discovery.find() == "unix:/tmp/uav_4.sock"


def test_one_of_several_must_be_named() -> None:
    register("uav_1")
    register("uav_2")
    with pytest.raises(InvalidArgumentError, match="uav_1, uav_2"):
        discovery.find()


# --- What a client makes of it ----------------------------------------------------------------------------------------


def test_a_target_follows_a_daemon_that_moves() -> None:
    target = DaemonTarget("uav_5", None, None)
    assert target.address() == "127.0.0.1:50055"
    register("uav_5", "127.0.0.1:7001")
    assert target.address() == "127.0.0.1:7001"
    register("uav_5", "127.0.0.1:7002")
    assert target.address() == "127.0.0.1:7002"


def test_a_target_expects_a_daemon_that_is_gone_where_it_was() -> None:
    target = DaemonTarget("uav_5", None, None)
    register("uav_5", "127.0.0.1:7001")
    assert target.address() == "127.0.0.1:7001"
    discovery.registry_file("uav_5").unlink()
    assert target.address() == "127.0.0.1:7001"


def test_a_target_without_a_name_becomes_that_of_the_only_daemon() -> None:
    target = DaemonTarget(None, None, None)
    assert target.address() == "127.0.0.1:50051"
    assert not target.metadata
    register("uav_6", "127.0.0.1:7006")
    assert target.address() == "127.0.0.1:7006"
    register("uav_7", "127.0.0.1:7007")
    assert target.address() == "127.0.0.1:7006"
    assert target.metadata == (("ual-ns", "uav_6"),)


def test_an_address_wins_over_the_environment_and_that_over_the_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    register("uav_1", "127.0.0.1:7001")
    monkeypatch.setenv("UAL_ADDRESS", "drone:50051")
    monkeypatch.setenv("UAL_NS", "uav_8")
    assert DaemonTarget(None, None, None).address() == "drone:50051"
    assert DaemonTarget(None, None, None).ns == "uav_8"
    assert DaemonTarget("uav_1", "other:1", None).address() == "other:1"
    assert DaemonTarget("uav_1", "other:1", None).metadata == (("ual-ns", "uav_1"),)


@pytest.mark.parametrize("address", ["rubbish", "host:", "host:x", ":50051", "unix:", "host:123456", "http://host:1"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(InvalidArgumentError, match="HOST:PORT or unix:PATH"):
        DaemonTarget("uav_1", address, None)


@pytest.mark.parametrize("address", ["host:1", "10.0.0.1:50051", "[::1]:50051", "unix:/run/x.sock", "unix:x.sock"])
def test_an_address_is_taken_as_it_is(address: str) -> None:
    assert DaemonTarget("uav_1", address, None).address() == address


def test_a_certificate_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match=r"tls_ca: cannot read .*ca\.pem: No such file"):
        DaemonTarget("uav_1", None, tmp_path / "ca.pem")


def test_a_registration_is_one_json_object() -> None:
    register("uav_1")
    values = json.loads(discovery.registry_file("uav_1").read_text())
    assert values == {
        "ns": "uav_1",
        "pid": os.getpid(),
        "address": "127.0.0.1:6000",
        "backend": "light",
        "started_s": 1.5,
    }
