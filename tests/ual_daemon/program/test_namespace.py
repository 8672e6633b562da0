from __future__ import annotations

import fcntl
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from ual import discovery
from ual_daemon.program.namespace import Namespace, NamespaceError

HOLD = """
import sys
from ual_daemon.program.namespace import Namespace
namespace = Namespace("uav_1")
if sys.argv[1:]:
    namespace.register(*sys.argv[1:])
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "run" / "ual"
    monkeypatch.setenv(discovery.RUNTIME_DIR_VARIABLE, str(path))
    return path


def hold(*registration: str, program: str = HOLD) -> subprocess.Popen[str]:
    """Another process that holds uav_1."""
    process = subprocess.Popen(
        [sys.executable, "-c", program, *registration], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


def test_a_daemon_is_found_until_it_releases_the_namespace() -> None:
    with Namespace("uav_1") as namespace:
        assert discovery.registered("uav_1") is None
        namespace.register("127.0.0.1:50051", "light")
        found = discovery.registered("uav_1")
        assert found is not None
        assert (found.pid, found.address, found.backend) == (os.getpid(), "127.0.0.1:50051", "light")
    assert discovery.registered("uav_1") is None
    with Namespace("uav_1"):
        pass


def test_a_namespace_in_use_is_refused_with_pid_and_address() -> None:
    process = hold("127.0.0.1:4711", "light")
    try:
        with pytest.raises(NamespaceError, match=rf"uav_1 is already flown by pid {process.pid} at 127.0.0.1:4711"):
            Namespace("uav_1")
        with Namespace("uav_2"):
            pass
    finally:
        end(process)


def test_a_holder_that_is_still_starting_is_reported_by_its_pid() -> None:
    process = hold()
    try:
        with pytest.raises(NamespaceError, match=rf"pid {process.pid}, which is still starting"):
            Namespace("uav_1")
    finally:
        end(process)


def test_a_pid_that_others_left_in_the_files_is_not_taken_for_the_holder(runtime_dir: Path) -> None:
    """As where another user locks a file that this user's daemon left."""
    runtime_dir.mkdir(parents=True)
    registration = {"ns": "uav_1", "pid": 1, "address": "127.0.0.1:4711", "backend": "light", "started_s": 0.0}
    (runtime_dir / "uav_1.json").write_text(json.dumps(registration))
    with (runtime_dir / "uav_1.lock").open("w+") as held:
        held.write("999999")
        held.flush()
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(NamespaceError, match=rf"by pid {os.getpid()} of user \w+, which has the lock") as caught:
            Namespace("uav_1")
    assert "999999" not in str(caught.value)
    assert "4711" not in str(caught.value)


def test_what_a_killed_daemon_left_is_no_holder(runtime_dir: Path) -> None:
    end(hold("127.0.0.1:4711", "light"))
    assert (runtime_dir / "uav_1.json").exists()
    with Namespace("uav_1") as namespace:
        namespace.register("127.0.0.1:4712", "light")
        assert json.loads((runtime_dir / "uav_1.json").read_text())["pid"] == os.getpid()


def test_what_a_killed_daemon_left_is_not_taken_for_one_that_starts(runtime_dir: Path) -> None:
    end(hold("127.0.0.1:4711", "light"))
    assert (runtime_dir / "uav_1.json").exists()
    with Namespace("uav_1"):
        assert discovery.registered("uav_1") is None
        with pytest.raises(NamespaceError, match=rf"pid {os.getpid()}, which is still starting"):
            Namespace("uav_1")


def test_clients_that_poll_do_not_keep_a_daemon_from_starting(
    runtime_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runtime_dir.mkdir(parents=True)
    with (runtime_dir / "uav_1.lock").open("w") as looking:
        fcntl.flock(looking, fcntl.LOCK_SH)
        looks: list[float] = []

        def turn_away(pause_s: float) -> None:
            looks.append(pause_s)
            fcntl.flock(looking, fcntl.LOCK_UN)

        monkeypatch.setattr("ual_daemon.program.namespace.time.sleep", turn_away)
        with Namespace("uav_1"):
            assert len(looks) == 1


def test_the_directory_is_shared_as_tmp_is(runtime_dir: Path) -> None:
    old_umask = os.umask(0o077)
    try:
        with Namespace("uav_1") as namespace:
            namespace.register("127.0.0.1:4711", "light")
            assert stat.S_IMODE(runtime_dir.stat().st_mode) == 0o1777
            for file in ("uav_1.lock", "uav_1.json"):
                assert stat.S_IMODE((runtime_dir / file).stat().st_mode) == 0o644
    finally:
        os.umask(old_umask)


def test_a_linked_lock_is_not_followed(runtime_dir: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    runtime_dir.mkdir(parents=True)
    (runtime_dir / "uav_1.lock").symlink_to(victim)
    with pytest.raises(NamespaceError, match=r"cannot open .*uav_1\.lock"):
        Namespace("uav_1")
    assert victim.read_text() == "precious"


def test_a_linked_registration_is_replaced_not_followed(runtime_dir: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    runtime_dir.mkdir(parents=True)
    (runtime_dir / "uav_1.json").symlink_to(victim)
    with Namespace("uav_1") as namespace:
        namespace.register("127.0.0.1:4711", "light")
        assert not (runtime_dir / "uav_1.json").is_symlink()
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("lay", ["link", "file", "open"])
def test_a_directory_that_cannot_be_trusted_is_refused(runtime_dir: Path, tmp_path: Path, lay: str) -> None:
    runtime_dir.parent.mkdir()
    if lay == "link":
        runtime_dir.symlink_to(tmp_path)
    elif lay == "file":
        runtime_dir.write_text("")
    else:
        runtime_dir.mkdir()
        runtime_dir.chmod(0o777)
    with pytest.raises(NamespaceError, match=discovery.RUNTIME_DIR_VARIABLE):
        Namespace("uav_1")


def test_a_directory_that_cannot_be_made_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(discovery.RUNTIME_DIR_VARIABLE, "/proc/ual")
    with pytest.raises(NamespaceError, match=r"cannot open /proc/ual/uav_1\.lock: No such file"):
        Namespace("uav_1")


def test_a_directory_that_was_removed_holds_the_namespace_and_is_written_again(runtime_dir: Path) -> None:
    with Namespace("uav_1") as namespace:
        namespace.register("127.0.0.1:50051", "light")
        shutil.rmtree(runtime_dir)
        with pytest.raises(NamespaceError, match="uav_1 is already flown by a daemon, whose files"):
            Namespace("uav_1")
        namespace.keep(0.0)
        found = discovery.registered("uav_1")
        assert found is not None
        assert found.address == "127.0.0.1:50051"
        with pytest.raises(NamespaceError, match=r"flown by pid \d+ at 127\.0\.0\.1:50051"):
            Namespace("uav_1")
    assert discovery.registered("uav_1") is None


@pytest.mark.skipif(os.geteuid() != 0, reason="needs files of two users")
def test_what_a_killed_daemon_of_another_user_left_is_passed_by(monkeypatch: pytest.MonkeyPatch) -> None:
    as_other = HOLD.replace("import sys\n", "import os, sys\n").replace(
        "namespace = ", "os.setuid(12345)\nnamespace = "
    )
    with tempfile.TemporaryDirectory() as folder:  # pytest's own is closed to other users
        Path(folder).chmod(0o755)
        monkeypatch.setenv(discovery.RUNTIME_DIR_VARIABLE, f"{folder}/ual")
        end(hold("127.0.0.1:50051", "light"))
        other = hold("127.0.0.1:50052", "light", program=as_other)
        try:
            found = discovery.registered("uav_1")
            assert found is not None
            assert (found.pid, found.address) == (other.pid, "127.0.0.1:50052")
            assert [each.address for each in discovery.list_daemons()] == ["127.0.0.1:50052"]
        finally:
            end(other)
        assert discovery.registered("uav_1") is None
