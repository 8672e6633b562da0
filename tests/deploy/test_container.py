"""The image of deploy/container, and the manifests of deploy/kubernetes."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml

import ual
from tests.conftest import LIMIT_S, DaemonProcess, daemon_environment
from tests.pages import ROOT
from tests.ports import free_port
from tests.waiting import until
from ual import discovery
from ual.types import State

CONTAINER, KUBERNETES = ROOT / "deploy" / "container", ROOT / "deploy" / "kubernetes"
IMAGE = f"ual:{ual.__version__}"
HEALTH = (sys.executable, str(CONTAINER / "health.py"))
GRACE_S = 75


def instructions() -> list[tuple[str, str]]:
    """The instructions of the Containerfile: each by its name, with its text in one line."""
    lines = [line for line in (CONTAINER / "Containerfile").read_text().splitlines() if not line.startswith("#")]
    text = "\n".join(lines).replace("\\\n", " ")
    return [(name, rest.strip()) for name, _, rest in (line.partition(" ") for line in text.splitlines() if line)]


def last_stage() -> list[tuple[str, str]]:
    found = instructions()
    return found[max(i for i, (name, _) in enumerate(found) if name == "FROM") :]


# --- The Containerfile ------------------------------------------------------------------------------------------------


def test_the_image_runs_one_process_without_root() -> None:
    stage = dict(last_stage())
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", stage["USER"]), "a number, so that Kubernetes knows that it is not root"
    assert json.loads(stage["ENTRYPOINT"]) == ["ual-daemon"]
    assert json.loads(stage["HEALTHCHECK"].partition("CMD ")[2]) == ["ual-health"]
    assert stage["STOPSIGNAL"] == "SIGTERM"


def test_what_is_copied_and_installed_is_named() -> None:
    found = instructions()
    assert {name for name, _ in found} <= {
        *("ARG", "COPY", "ENTRYPOINT", "ENV", "FROM", "HEALTHCHECK", "LABEL", "RUN", "STOPSIGNAL", "USER", "WORKDIR")
    }
    (base,) = [rest for name, rest in found if name == "ARG" and rest.startswith("BASE=")]
    assert not base.endswith(":latest")
    assert re.search(r":\d", base)
    for name, rest in found:
        if name == "RUN" and "pip install" in rest:
            for each in rest.split("pip install")[1:]:
                assert "--no-cache-dir" in each
                assert "--require-hashes" in each or "--no-index --no-deps" in each


def requirements(name: str) -> dict[str, tuple[str, ...]]:
    """Requirements of a file, each with its hashes."""
    text = (CONTAINER / name).read_text(encoding="utf-8").replace("\\\n", "")
    lines = [line.partition(" --hash=") for line in text.splitlines() if not line.startswith("#")]
    return {requirement.strip(): tuple(hashes.split("--hash=")) for requirement, _, hashes in lines}


@pytest.mark.parametrize("name", ["requirements.txt", "sbom-requirements.txt"])
def test_each_package_of_the_image_is_named_by_its_hashes(name: str) -> None:
    found = requirements(name)
    assert found
    for requirement, hashes in found.items():
        assert re.match(r"[a-z0-9-]+==\d", requirement), requirement
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64} *", each) for each in hashes), requirement


def test_the_image_has_the_versions_that_are_tested() -> None:
    tested = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    versions = {re.split(" *;", line)[0] for line in tested}
    assert {re.split(" *;", each)[0].strip() for each in requirements("requirements.txt")} <= versions


def test_labels_say_what_it_is() -> None:
    (labels,) = [rest for name, rest in last_stage() if name == "LABEL"]
    found = set(re.findall(r"org\.opencontainers\.image\.(\w+)=", labels))
    assert found == {"title", "description", "licenses", "version", "revision"}


def test_the_script_that_builds_says_what_is_missing(tmp_path: Path) -> None:
    copy = tmp_path / "deploy" / "container"
    shutil.copytree(CONTAINER, copy)
    environment = {"PATH": "/usr/bin:/bin"}
    done = subprocess.run([copy / "build"], env=environment, capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.returncode, done.stderr) == (1, "deploy/container/build: no wheels in dist: make dist\n")


# --- Health -----------------------------------------------------------------------------------------------------------


def health(environment: dict[str, str]) -> tuple[int, str]:
    done = subprocess.run(HEALTH, env=environment, capture_output=True, text=True, timeout=LIMIT_S)
    return done.returncode, done.stderr


def test_it_is_healthy_while_its_uav_has_an_autopilot(runtime_dir: Path) -> None:
    environment = daemon_environment(runtime_dir)
    assert health(environment) == (1, "no daemon is registered\n")
    ready = DaemonProcess(("--listen", "127.0.0.1:0"), "uav_1", environment)
    deaf = DaemonProcess(
        ("--listen", "127.0.0.1:0", "--backend", "mavlink", "--url", f"udpin://127.0.0.1:{free_port()}"),
        "uav_2",
        environment,
    )
    try:
        ready.wait_for("state", new="LANDED_DISARMED")
        deaf.wait_for("listening")
        assert health({**environment, "UAL_NS": "uav_1"}) == (0, "")
        assert health({**environment, "UAL_NS": "uav_2"}) == (1, f"{deaf.address}: NOT_SERVING\n")
        assert health(environment) == (1, f"{deaf.address}: NOT_SERVING\n")
    finally:
        ready.close()
        deaf.close()


def test_the_file_of_a_user_is_read_next_to_what_another_user_has_left(runtime_dir: Path) -> None:
    """A killed daemon's registration is another user's, and only that user may remove it: the next one has its user's
    number.
    """
    environment = daemon_environment(runtime_dir)
    daemon = DaemonProcess(("--listen", "127.0.0.1:0"), "uav_1", environment)
    try:
        daemon.wait_for("state", new="LANDED_DISARMED")
        written = runtime_dir / "uav_1.json"
        own = runtime_dir / f"uav_1.{os.getuid()}.json"
        own.write_text(written.read_text())
        written.write_text(json.dumps({"ns": "uav_1", "pid": 1 << 30, "address": "127.0.0.1:1"}))
        assert health({**environment, "UAL_NS": "uav_1"}) == (0, "")
        assert health(environment) == (0, "")
        forged = runtime_dir / f"uav_1.{os.getuid() + 1}.json"
        forged.write_text(own.read_text().replace(daemon.address, "127.0.0.1:2"))
        assert health(environment) == (0, "")
    finally:
        daemon.close()


def test_what_speaks_something_else_is_not_healthy(runtime_dir: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        runtime_dir.mkdir()
        discovery.Registration("uav_1", os.getpid(), address, "light", 0.0).write()

        def answer() -> None:
            with server.accept()[0] as connection:
                connection.recv(4096)
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        with ThreadPoolExecutor(1) as pool:
            answered = pool.submit(answer)
            said = health(daemon_environment(runtime_dir))
            answered.result()
    assert said == (1, f"{address}: it does not speak HTTP/2: TLS? Give it a `--listen unix:PATH` more\n")


def test_an_answer_has_a_limit_however_often_the_daemon_says_something(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(CONTAINER)
    probe = importlib.import_module("health")
    monkeypatch.setattr(probe, "LIMIT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def say_nothing_new() -> None:
            with server.accept()[0] as connection, suppress(ConnectionError):
                while True:
                    connection.sendall(probe.frame(probe.PING, probe.ACKNOWLEDGED, 0, bytes(8)))
                    time.sleep(0.02)  # the rate of a server that drips

        with ThreadPoolExecutor(1) as pool:
            pool.submit(say_nothing_new)
            with pytest.raises(TimeoutError):
                probe.status(f"127.0.0.1:{server.getsockname()[1]}")


def test_it_loads_little_as_it_runs_next_to_a_flight() -> None:
    """By modules, as a clock depends on the computer: `grpc` alone loads 300."""
    done = subprocess.run(
        [sys.executable, "-IS", "-X", "importtime", str(CONTAINER / "health.py")],
        env={"UAL_RUNTIME_DIR": "/nowhere"},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert len(done.stderr.splitlines()) < 60, done.stderr


# --- Flown ------------------------------------------------------------------------------------------------------------

CONFINE = """
set -e
mount -o remount,bind,ro /
mount -t tmpfs -o mode=1777 tmpfs /tmp
mkdir -m 1777 /tmp/run
exec unshare --user --map-user=10001 --map-group=10001 -- "$@"
"""


def can_confine() -> bool:
    """Returns whether this computer lets a test confine a process: root in a sandbox may not."""
    probe = ["unshare", "--mount", "bash", "-c", CONFINE, "confine", "true"]
    return shutil.which("unshare") is not None and subprocess.run(probe, capture_output=True).returncode == 0


def test_it_flies_with_a_read_only_root_and_without_the_rights_of_root() -> None:
    """As the image runs it: another user, no capabilities, nothing to write to but /tmp."""
    if not can_confine():
        pytest.skip("unshare MAY NOT CONFINE HERE: the read-only root is NOT TESTED")
    listen = f"127.0.0.1:{free_port()}"
    environment = {"PATH": "/usr/bin:/bin", "UAL_RUNTIME_DIR": "/tmp/run", "PYTHONDONTWRITEBYTECODE": "1"}
    flags = ["--auto-arm", "--set", "light.speed_factor=10", "--listen", listen, "--log-format", "json"]
    command = ["unshare", "--mount", "bash", "-c", CONFINE, "confine", sys.executable, "-m", "ual_daemon", *flags]
    process = subprocess.Popen(command, env=environment, cwd="/", stderr=subprocess.PIPE, text=True)
    try:
        status = Path(f"/proc/{process.pid}/status")
        with ual.Uav(address=listen) as uav:
            until(lambda: _state(uav) is State.LANDED_ARMED, "an armed UAV", seen=process.poll)
            assert re.search(r"^CapEff:\t0+$", status.read_text(), re.MULTILINE)
            mounts = Path(f"/proc/{process.pid}/mounts").read_text()
            assert re.search(r"^\S+ / \S+ ro[,\s]", mounts, re.MULTILINE)
            uav.take_off(2.0)
            uav.land()
    finally:
        process.send_signal(signal.SIGTERM)
        _, stderr = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0, stderr


def _state(uav: ual.Uav) -> State | None:
    try:
        return uav.state()
    except ual.errors.DaemonUnreachableError:  # it starts
        return None


def engine() -> str | None:
    """The container engine that runs here."""
    for each in ("docker", "podman"):
        if shutil.which(each) and subprocess.run([each, "info"], capture_output=True).returncode == 0:
            return each
    return None


@pytest.mark.slow
def test_the_image_flies() -> None:
    run = engine()
    if run is None:
        pytest.skip("NEITHER DOCKER NOR PODMAN RUNS HERE: the image is NOT FLOWN")
    subprocess.run(["make", "dist"], cwd=ROOT, check=True)
    subprocess.run([CONTAINER / "build"], env={**os.environ, "ENGINE": run}, check=True)
    listen = f"127.0.0.1:{free_port()}"
    confined = ["--read-only", "--tmpfs", "/tmp", "--volume", "/run/ual", "--cap-drop", "ALL"]
    confined += ["--security-opt", "no-new-privileges", "--network", "host", "--stop-timeout", str(GRACE_S)]
    started = [run, "run", "--detach", "--rm", *confined, IMAGE, "--auto-arm", "--listen", listen]
    name = subprocess.run(started, capture_output=True, text=True, check=True).stdout.strip()
    try:
        with ual.Uav(address=listen) as uav:
            until(lambda: _state(uav) is State.LANDED_ARMED, "an armed UAV")
            subprocess.run([run, "exec", name, "ual-health"], check=True)
            uav.take_off(2.0)
            uav.land()
    finally:
        subprocess.run([run, "stop", name], check=True, capture_output=True)


# --- Kubernetes -------------------------------------------------------------------------------------------------------


def manifests() -> list[dict[str, Any]]:
    names = yaml.safe_load((KUBERNETES / "kustomization.yaml").read_text())["resources"]
    return [each for name in names for each in yaml.safe_load_all((KUBERNETES / name).read_text())]


def test_a_pod_may_do_no_more_than_the_image_needs() -> None:
    (fleet,) = [each for each in manifests() if each["kind"] == "StatefulSet"]
    pod = fleet["spec"]["template"]["spec"]
    (container,) = pod["containers"]
    assert f"{pod['securityContext']['runAsUser']}:{pod['securityContext']['runAsGroup']}" == dict(last_stage())["USER"]
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert pod["terminationGracePeriodSeconds"] == GRACE_S
    assert "livenessProbe" not in container, "nothing may end a daemon that flies"
    assert {each["mountPath"] for each in container["volumeMounts"]} == {"/run/ual", "/tmp"}


def test_all_parts_of_a_fleet_mean_the_same_pods() -> None:
    labels = {"app.kubernetes.io/name": "ual"}
    found = {each["kind"]: each["spec"] for each in manifests()}
    assert found["StatefulSet"]["template"]["metadata"]["labels"] == labels | {"ual": "daemon"}
    assert found["StatefulSet"]["selector"]["matchLabels"] == labels
    assert found["Service"]["selector"] == labels
    assert found["PodDisruptionBudget"]["selector"]["matchLabels"] == labels
    assert found["NetworkPolicy"]["podSelector"]["matchLabels"] == labels


def test_the_variables_of_a_pod_are_those_of_the_daemon() -> None:
    (container,) = next(each for each in manifests() if each["kind"] == "StatefulSet")["spec"]["template"]["spec"][
        "containers"
    ]
    variables = {each["name"]: each.get("value", "") for each in container["env"]}
    environment = {name: value.replace("$(INDEX)", "1") for name, value in variables.items()}
    done = subprocess.run(
        [sys.executable, "-m", "ual_daemon", *container["args"], "--print-config"],
        env={"PATH": os.environ["PATH"], discovery.RUNTIME_DIR_VARIABLE: "/run/ual", **environment},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 0, done.stderr
    settings = yaml.safe_load(done.stdout)
    assert (settings["ns"], settings["listen"], settings["metrics"]) == ("uav_1", ["0.0.0.0:50051"], "0.0.0.0:9110")


def test_the_schemas_of_kubernetes_hold() -> None:
    validate = pytest.importorskip(
        "kubernetes_validate", reason="kubernetes-validate IS MISSING, the manifests are NOT CHECKED BY SCHEMA"
    )
    for each in manifests():
        validate.validate(each, "1.31", strict=True)
