"""Names in the pages (the .md files) of this repository, and whether each exists. Each check returns the mistakes."""

from __future__ import annotations

import functools
import importlib
import os
import pkgutil
import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import click
from google.protobuf import descriptor_pool

from ual import v1
from ual_daemon.program.main import main as daemon
from ual_tools.main import cli

ROOT = Path(__file__).parents[1]
PROGRAMS: dict[str, click.Command] = {"ual": cli, "ual-daemon": daemon}
for _module in pkgutil.iter_modules(v1.__path__, f"{v1.__name__}."):
    if _module.name.endswith("_pb2"):  # so that its messages are in the pool, whatever other tests have imported
        importlib.import_module(_module.name)
_POOL = descriptor_pool.Default()  # type: ignore[no-untyped-call]
_FINDERS = (_POOL.FindMessageTypeByName, _POOL.FindServiceByName, _POOL.FindMethodByName, _POOL.FindEnumTypeByName)
_NOT_OURS = {".git", ".venv", "node_modules", "build", "dist", "target", "gen", "bin"}
"""Folders of what is installed or generated."""
_MADE = {"tools/bin", "tools/bin/grpcurl", "tools/node_modules"}
"""Files that `make` creates."""
_FOREIGN = {"grpc/_server.py", "px4_sitl"}
"""Files and make targets of other projects."""

_FENCE = re.compile(r"^( *)```(.*)\n((?:.*\n)*?)\1```", re.MULTILINE)
_INDENTED = re.compile(r"(?:^(?: {4}|\t).*\n)+", re.MULTILINE)
_SPAN = re.compile(r"`([^`\n]+)`")
_LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")
_PATH = re.compile(r"(?<![\w./@-])(?:ual_daemon|tests|docs|proto|clients|deploy|examples|benchmarks)/[\w./*@-]*[\w*]")
_FILE = re.compile(r"[\w./-]+\.(?:py|proto)")
_NAME = re.compile(r"(?<![\w./-])(?:ual|ual_tools|ual_daemon|benchmarks)(?:\.[A-Za-z_]\w*)+(?:/\w+)?")
_MAKE = re.compile(r"(?:^|[;&|$] )\s*make ([a-z][\w/-]*)", re.MULTILINE)
_PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b|…|\[")


@dataclass(frozen=True)
class Page:
    """A page, its text apart from its code."""

    path: Path
    text: str

    @functools.cached_property
    def blocks(self) -> list[str]:
        """The blocks of code, fenced or indented; without those of other languages than the shell's and ours."""
        fenced = [block for _, language, block in _FENCE.findall(self.text) if language in ("", "console", "python")]
        return [*fenced, *_INDENTED.findall(_FENCE.sub("", self.text))]

    @functools.cached_property
    def spans(self) -> list[str]:
        """The pieces of code within the text."""
        return _SPAN.findall(_INDENTED.sub("", _FENCE.sub("", self.text)))

    @property
    def code(self) -> list[str]:
        return [*self.blocks, *self.spans]


def read(path: Path) -> Page:
    return Page(path, path.read_text(encoding="utf-8"))


@functools.cache
def files() -> frozenset[str]:
    """The files of the repository, by their paths from its root."""
    found = set()
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in _NOT_OURS]
        found |= {(Path(folder) / name).relative_to(ROOT).as_posix() for name in names}
    return frozenset(found)


def pages() -> list[Path]:
    return sorted(ROOT / name for name in files() if name.endswith(".md"))


# --- Links -----------------------------------------------------------------------------------------------------------


def anchors(page: Page) -> set[str]:
    """The anchors that GitHub, and the site, give to the headings of a page."""
    headings = re.findall(r"^#{1,6} +(.+?)\s*$", _FENCE.sub("", page.text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Page) -> list[str]:
    """Links whose file, or whose anchor in it, does not exist."""
    broken = []
    for target, anchor in _LINK.findall(_INDENTED.sub("", _FENCE.sub("", page.text))):
        path = page.path.parent / target if target else page.path
        other = page if path == page.path else read(path) if path.suffix == ".md" and path.is_file() else None
        if (other is None and not path.is_file()) or (other is not None and anchor and anchor not in anchors(other)):
            broken.append(f"{target}#{anchor}" if anchor else target)
    return broken


# --- Names of files and modules ---------------------------------------------------------------------------------------


def missing_paths(page: Page) -> list[str]:
    """Paths from the root, and names of our source files, that do not exist."""
    paths = {path for path in _PATH.findall(_LINK.sub("", page.text)) if not _exists(path)}
    names = {span for span in page.spans if _FILE.fullmatch(span) and not _is_file_called(span)}
    return sorted(paths | names)


def _exists(path: str) -> bool:
    return path in _MADE or any(ROOT.glob(path)) or bool(set(Path(path).parts) & {"build", "target", "gen", "dist"})


def _is_file_called(name: str) -> bool:
    return name in _FOREIGN or any(f"/{file}".endswith(f"/{name.removeprefix('./')}") for file in files())


def missing_names(page: Page) -> list[str]:
    """Modules and their members, and messages, services and methods of the contract, that do not exist."""
    named = {name for code in page.code for name in _NAME.findall(code)}
    return sorted(name for name in named if not (_is_in_contract(name) or _is_in_code(name) or _is_file_called(name)))


def _is_in_contract(name: str) -> bool:
    return name in ("ual.v1", "ual.v2") or any(_finds(find, name.replace("/", ".")) for find in _FINDERS)


def _finds(find: Callable[[str], object], name: str) -> bool:
    try:
        find(name)
    except KeyError:
        return False
    return True


def _is_in_code(name: str) -> bool:
    module, members = name.partition("/")[0], list[str]()
    while module:
        try:
            found: object = importlib.import_module(module)
        except ModuleNotFoundError:
            module, _, member = module.rpartition(".")
            members.insert(0, member)
        else:
            return _has(found, members)
    return False


def _has(value: object, members: list[str]) -> bool:
    for member in members:
        if not hasattr(value, member):
            return member in getattr(value, "__annotations__", {})
        value = getattr(value, member)
    return True


def missing_targets(page: Page) -> list[str]:
    """Targets of `make` that do not exist."""
    known = set(re.findall(r"^([\w/.-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    return sorted({target for code in page.code for target in _MAKE.findall(code)} - known - _FOREIGN)


_RELATIVE = re.compile(r"\bPATH=(?:[^\s`]*:)?(\.[^\s:`]*)")


def relative_search_paths(page: Page) -> list[str]:
    """Relative folders that are put on PATH: Go refuses the programs in them, and they change with each `cd`."""
    return [folder for code in page.code for folder in _RELATIVE.findall(code)]


# --- Commands ---------------------------------------------------------------------------------------------------------


def commands(page: Page) -> Iterator[tuple[str, bool]]:
    """The calls of our programs, and whether each stands in a block, that is to be typed as it is."""
    for code, is_block in [*((block, True) for block in page.blocks), *((span, False) for span in page.spans)]:
        for line in code.replace("\\\n", " ").splitlines():
            for part in re.split(r"(?:^|\s)#\s.*|(?:;|\||&|\s>)(?=\s|$)", line):
                if found := re.match(r"\s*(?:\$ )?(?:UAL_\w+=\S+ )*(?:/opt/ual/bin/)?(ual(?:-daemon)?(?: .*)?)$", part):
                    yield found[1].strip(), is_block


def shown_answers(page: Page) -> list[tuple[str, str]]:
    """The calls of our programs whose answer the page shows beneath; without those that another program reads."""
    found = []
    for block in page.blocks:
        for part in re.split(r"^ *\$ ", block, flags=re.MULTILINE)[1:]:
            call, _, answer = part.partition("\n")
            if re.match(r"ual(-daemon)? ", call) and "|" not in call:
                found.append((call, "\n".join(line.strip() for line in answer.splitlines())))
    return found


def wrong_commands(page: Page) -> list[str]:
    """Calls of our programs that these would refuse: commands, flags and arguments that they do not know."""
    checked = [(call, why_wrong(call, is_block=is_block)) for call, is_block in commands(page)]
    return [f"{call}: {why}" for call, why in checked if why]


def why_wrong(call: str, *, is_block: bool = True) -> str | None:
    """Why a program would refuse a call; None where it would not. Arguments are checked where all of them are given."""
    program, *words = shlex.split(call)
    command, context, given = PROGRAMS[program], click.Context(PROGRAMS[program], info_name=program), list[str]()
    while words:
        word = words.pop(0)
        if word == "--":  # what follows is another program's
            given += [word, *words]
            break
        if _is_flag(word) and not _takes(command, word):
            return f"no flag {word}"
        if _is_flag(word) or not isinstance(command, click.Group):
            given.append(word)
            if _is_flag(word) and _has_value(command, word) and words:
                given.append(words.pop(0))
        elif word in command.commands:
            context = click.Context(command.commands[word], parent=context, info_name=word)
            command, given = command.commands[word], []
        else:
            return None if _PLACEHOLDER.search(word) else f"no command {word}"
    is_complete = is_block and not isinstance(command, click.Group) and not _PLACEHOLDER.search(call)
    return _refusal(command, context, given) if is_complete else None


def _is_flag(word: str) -> bool:
    return word.startswith("--")


def _option(command: click.Command, word: str) -> click.Option | None:
    name = word.partition("=")[0].strip("[]")
    options = (each for each in command.params if isinstance(each, click.Option))
    return next((each for each in options if name in (*each.opts, *each.secondary_opts)), None)


def _takes(command: click.Command, word: str) -> bool:
    return word.partition("=")[0] == "--help" or _option(command, word) is not None


def _has_value(command: click.Command, word: str) -> bool:
    option = _option(command, word)
    return option is not None and not option.is_flag and "=" not in word


def _refusal(command: click.Command, context: click.Context, given: list[str]) -> str | None:
    try:
        command.make_context(context.info_name, given, parent=context.parent)
    except click.exceptions.Exit:  # --help, --version
        return None
    except click.UsageError as error:
        why = error.format_message()
        return None if "does not exist" in why else why
    return None
