"""What the pages say of code is so: their programs run, their excerpts and tables are those of the code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from ual_daemon.backends.light import LightSettings

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
HOVER = ROOT / "examples" / "third_party_backend"


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def test_the_excerpts_of_write_a_backend_are_the_example() -> None:
    code = (HOVER / "ual_hover" / "backend.py").read_text(encoding="utf-8")
    *excerpts, program = blocks(DOCS / "write-a-backend.md", "python")
    assert len(excerpts) >= 5
    for excerpt in excerpts:
        assert excerpt in code
    assert "conformance.run" in program  # tests/examples runs it
    [entry_point] = blocks(DOCS / "write-a-backend.md", "toml")
    assert entry_point in (HOVER / "pyproject.toml").read_text(encoding="utf-8")


def test_the_settings_of_the_light_backend_are_all_listed_with_their_defaults() -> None:
    page = (DOCS / "backends" / "light.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| `(\w+)` \| (.+?) \| ", page.split("## Settings")[1], re.MULTILINE))
    defaults = msgspec.to_builtins(LightSettings())
    assert listed == {
        name: str(list(value) if isinstance(value, (list, tuple)) else value) for name, value in defaults.items()
    }


@pytest.mark.parametrize("program", blocks(DOCS / "backends" / "light.md", "python"), ids=["stepped", "several"])
def test_the_programs_of_the_light_backends_page_run(program: str) -> None:
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, timeout=100.0)
    assert done.returncode == 0, done.stderr


LINK = re.compile(r"\]\((?!https?:|#)([^)#]+)(?:#[^)]*)?\)")
PAGES = sorted([*DOCS.rglob("*.md"), *ROOT.glob("*.md"), *(ROOT / "examples").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_link_leads_nowhere(page: Path) -> None:
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []
