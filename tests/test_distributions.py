"""The two distributions: their versions, and the licence that they carry."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager

import ual
import ual_daemon

ROOT = Path(__file__).parents[1]
VERSIONS = [(".", ual_daemon.__version__), ("clients/python", ual.__version__)]
PROGRAMS = [
    ("ual_daemon.program.main", f"ual-daemon {ual_daemon.__version__}"),
    ("ual._cli", f"ual, version {ual.__version__}"),
]


@pytest.mark.parametrize(("project", "version"), VERSIONS)
def test_the_wheel_has_the_version_of_the_package(project: str, version: str) -> None:
    assert ProjectMetadata(str(ROOT / project), PluginManager()).version == version


@pytest.mark.parametrize(("module", "shown"), PROGRAMS)
def test_a_program_shows_the_version_of_its_package(module: str, shown: str) -> None:
    command = [sys.executable, "-c", f"from {module} import main; main()", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert (done.returncode, done.stdout.strip()) == (0, shown), done.stderr


def test_the_daemon_asks_for_the_client_of_this_repository() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.findall(r'"ual-client==([^"]+)"', text) == [ual.__version__]


@pytest.mark.parametrize("project", [".", "clients/python"])
def test_the_wheel_carries_the_licence(project: str) -> None:
    builder = WheelBuilder(str(ROOT / project))
    assert builder.metadata.core.license_expression == "Apache-2.0"
    assert builder.metadata.core.license_files == ["LICENSE"]
    text = (ROOT / project / "LICENSE").read_text(encoding="utf-8")
    assert text == (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text
