"""docs/reference/clients/grpcurl.md, run as it stands: each command against a daemon, each answer as shown."""

from __future__ import annotations

import os
import re
import shutil
import subprocess

import pytest

from tests.clients.toolchains import ROOT
from tests.conftest import DaemonProcess

PAGE = ROOT / "docs" / "reference" / "clients" / "grpcurl.md"
ADDRESS = "127.0.0.1:50051"
SEARCH_PATH = os.pathsep.join([os.environ.get("PATH", os.defpath), str(ROOT / "tools" / "bin")])


def commands_of_the_page() -> list[tuple[str, str]]:
    """Each command with its answer."""
    blocks = re.findall(r"^```console\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    found = []
    for block in blocks:
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, answer = part.partition("\n")
            found.append((command, answer))
    return found


def is_as_shown(answer: str, shown: str) -> bool:
    """Returns whether an answer is what the page shows; its … stands for anything."""
    pattern = ".*".join(re.escape(piece) for piece in shown.strip().split("…"))
    return re.fullmatch(pattern, answer.strip(), re.DOTALL) is not None


def test_the_page_is_so(daemon: DaemonProcess) -> None:
    if shutil.which("grpcurl", path=SEARCH_PATH) is None:
        pytest.skip(
            "NO GRPCURL: docs/reference/clients/grpcurl.md is not tested. Get it: make tools/bin/grpcurl (needs Go)"
        )
    commands = commands_of_the_page()
    called = " ".join(command for command, _ in commands)
    assert all(each in called for each in (" list", " describe", "/TakeOff", "/RecoverFromManual", "/Land"))
    daemon.wait_for("state", new="LANDED_ARMED")
    for command, shown in commands:
        assert ADDRESS in command
        done = subprocess.run(
            ["bash", "-c", command.replace(ADDRESS, daemon.address)],
            env={**os.environ, "PATH": SEARCH_PATH},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60.0,
        )
        assert is_as_shown(done.stdout, shown), f"{command}\nanswers\n{done.stdout}\nbut the page shows\n{shown}"


def test_an_answer_that_is_not_as_shown_is_found() -> None:
    assert is_as_shown('{\n  "id": "land-1"\n}\n', '{\n  "id": "land-…"\n}')
    assert not is_as_shown('{\n  "id": "hold-1"\n}\n', '{\n  "id": "land-…"\n}')
