"""The documentation as one HTML site: `make docs` builds it into build/docs.

The source directory is the repository's root, so that links between the pages work on the site as they do in a
checkout. Links to other files of the repository become downloads.
"""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring

import ual.aio
import ual.interface
from ual_daemon import __version__

project = "UAL"
author = "the UAL contributors"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "benchmarks/*.md",
    "clients/*/README.md",
    "clients/third_party/*/README.md",
    "deploy/**.md",
    "docs/**",
    "examples/**.md",
]
exclude_patterns = [".*", "build", "tools", "**/node_modules", "clients/*/build", "clients/*/target"]
myst_heading_anchors = 4

default_role = "py:obj"  # `name` in a docstring links where the name is documented
autodoc_member_order = "bysource"
python_maximum_signature_line_length = 100
autodoc_typehints_format = "short"
autodoc_default_options = {
    "members": True,
    "undoc-members": True,
    "show-inheritance": True,
    # All but what these bring along:
    "inherited-members": "object, int, dict, tuple, Enum, BaseException, Exception, OSError, ValueError, Struct",
}

nitpick_ignore_regex = [
    ("py:obj", r".*"),  # names in docstrings of which no page tells
    ("py:.*", r"(abc|collections|concurrent|enum|msgspec|pathlib|typing|typing_extensions)\..*"),
    ("py:class", r"(.*\.)?[A-Z](_co)?"),  # type variables
    ("py:class", r"-?[0-9.]+"),  # limits in `Annotated`
    ("py:class", r"Path"),  # of a msgspec structure, whose types are text
    ("py:class", r"ual\.shared\..*"),  # bases of public classes, of which no page tells
]

html_theme = "furo"
html_title = f"UAL {version}"
html_extra_path = ["_site"]
html_static_path = ["_assets"]
html_css_files = ["ual.css"]
html_js_files = ["search-words.js", "search-ranking.js"]

_SEARCH_WORDS = re.compile(r"^(?:<!-- search:|\.\. search:)(.*?)(?:-->|$)", re.MULTILINE | re.DOTALL)
"""Phrases that a page's reader may type, and that its text need not have: a comment of the page."""

_GOOGLE_STYLE = Config(napoleon_numpy_docstring=False, napoleon_use_ivar=True)
_INTERFACE = {"UAL": "Uav"}
"""Names of the interface's protocols that its implementations do not have."""


def setup(app: Sphinx) -> None:
    """Connects what is below."""
    app.connect("autodoc-process-docstring", _complete)
    app.connect("missing-reference", _find_public)
    app.connect("build-finished", _write_search_words)


def _write_search_words(app: Sphinx, error: Exception | None) -> None:
    """Writes the search words of all pages for `search-ranking.js`."""
    if error is not None:
        return
    words = {name: phrases for name in sorted(app.env.found_docs) if (phrases := _search_words(app.env.doc2path(name)))}
    text = f"window.UAL_SEARCH_WORDS = {json.dumps(words, indent=0)};\n"
    (Path(app.outdir) / "_static" / "search-words.js").write_text(text, encoding="utf-8")


def _search_words(page: str | Path) -> list[str]:
    found = _SEARCH_WORDS.search(Path(page).read_text(encoding="utf-8"))
    return [phrase.strip() for phrase in found[1].split(",")] if found else []


def _complete(_: Sphinx, what: str, name: str, __: object, ___: object, lines: list[str]) -> None:
    """Takes the docstring of a member that has none from the interface, and turns Google style into markup."""
    if not any(lines):
        lines[:] = _docstring_of_interface(name).splitlines()
    # The extension napoleon would take the words before a colon in an attribute's docstring for its type.
    kind = "" if what in ("attribute", "data", "property") else what
    lines[:] = GoogleDocstring(list(lines), _GOOGLE_STYLE, None, kind, name).lines()


def _docstring_of_interface(name: str) -> str:
    owner, _, member = name.rpartition(".")
    owner = owner.rpartition(".")[2]
    protocol = getattr(ual.interface, _INTERFACE.get(owner, owner), None)
    return inspect.getdoc(getattr(protocol, member, None)) or ""


def _find_public(app: Sphinx, env: Any, node: Any, content: nodes.Element) -> nodes.Element | None:  # noqa: ANN401
    """Links a type to where it is documented: where it is public, as a protocol, or by its short name in `ual`."""
    if node.get("refdomain") != "py":
        return None
    parts = str(node["reftarget"]).split(".")
    public = ".".join(part for part in parts if not part.startswith("_"))
    is_private = any(part.startswith("_") for part in parts)
    name = parts[-1].lstrip("_")
    for target in (public, f"ual.interface.{name}", f"ual.{name}"):
        found = env.domains["py"].resolve_xref(env, node["refdoc"], app.builder, "class", target, node, content)
        if found is not None:
            return found
    return content if is_private else None
