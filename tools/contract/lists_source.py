"""Writes the lists of what is by hand for each service: its checks, its command, and what a backend offers for it.

So a file by hand is enough: no other one names it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path

from tools.contract.commands_source import commands
from tools.contract.compiled import PROTO, ROOT
from tools.contract.parts import CLIENT, ContractPart
from tools.contract.python_source import functions, imports, names_in, parsed

_CHECKS = CLIENT / "conformance"
_COMMANDS = CLIENT.parent / "ual_tools"
_OTHERS = {"corrections", "mission"}
"""The parts whose commands are called otherwise."""
_MAKE = "``make proto`` writes this file: do not edit it."
_OFFERS = (
    ROOT / "ual_daemon" / "backends" / "light",
    ROOT / "ual_daemon" / "backends" / "mavlink" / "offers",
)
"""Folders in which a module may offer a service: its function ``make_driver`` makes the offer."""
_PAGE = ROOT / "docs" / "reference" / "contract.rst"


def lists(parts: Sequence[ContractPart]) -> dict[Path, str]:
    """Returns the modules, and the page of the contract."""
    owners = [each for each in parts if not each.bound]
    return {
        _CHECKS / "own.py": _checks(),
        _COMMANDS / "services.py": _commands(owners),
        **{room / "derived.py": _offers(room) for room in _OFFERS},
        _PAGE: _page(),
    }


def _checks() -> str:
    """Returns the module with the checks of all services."""
    found = {path.stem: _assigned(path) for path in sorted(_CHECKS.glob("own_*.py"))}
    rows = ""
    for name in ("ON_GROUND", "IN_FLIGHT"):
        checks = ", ".join(f"*{module}.{name}" for module, names in found.items() if name in names)
        rows += f"{name} = ({checks})\n"
    return (
        f'"""The checks of the services beside flying. {_MAKE}"""\n\nfrom __future__ import annotations\n\n'
        f"from ual.conformance import {', '.join(found)}\n\n{rows}"
    )


def _assigned(path: Path) -> set[str]:
    targets = (each.targets for each in parsed(path).body if isinstance(each, ast.Assign))
    return {each.id for found in targets for each in found if isinstance(each, ast.Name)}


def _commands(owners: Sequence[ContractPart]) -> str:
    """Returns the module with the command of each service: one by hand, or what follows from its members."""
    by_hand = [each.module for each in owners if (_COMMANDS / f"{each.module}.py").exists()]
    derived = [each for each in owners if each.module not in by_hand and each.module not in _OTHERS]
    rows = "".join(f"    *{each}.COMMANDS,\n" for each in by_hand) + "".join(
        f"    {each.module},\n" for each in derived
    )
    body = "".join(map(commands, derived))
    return (
        f'"""The commands of the services beside flying. {_MAKE}"""\n\nfrom __future__ import annotations\n\n'
        f"import click\n\nfrom ual_tools import {', '.join(by_hand)}\n"
        + "from ual_tools.app import UalCommand, UalGroup\n"
        "from ual_tools.help import Section\n"
        "from ual_tools.session import CommandSession, pass_session\n"
        * bool(derived)
        + f"{body}\nCOMMANDS: tuple[click.Command, ...] = (\n{rows})\n"
    )


def _offers(room: Path) -> str:
    """Returns the module with what a backend offers."""
    found = {path.stem: functions(parsed(path)) for path in sorted(room.glob("*.py"))}
    made = {module: each["make_driver"] for module, each in found.items() if "make_driver" in each}
    first = next(iter(made))
    arguments = ast.unparse(made[first].args)
    if other := [module for module, each in made.items() if ast.unparse(each.args) != arguments]:
        raise SystemExit(
            f"{room.relative_to(ROOT)}: make_driver() of {', '.join(other)} has not the arguments ({arguments})"
        )
    passed = ", ".join(each.arg for each in made[first].args.args)
    package = ".".join(room.relative_to(ROOT).parts)
    rows = "".join(f"        {module}.make_driver({passed}),\n" for module in made)
    return (
        f'"""Services that are offered by modules that nothing else names. {_MAKE}"""\n\n'
        f"from __future__ import annotations\n\n"
        f"{imports(room / f'{first}.py', names_in(f'def _({arguments}): pass'))}"
        f"from {package} import {', '.join(made)}\n\n\n"
        f"def offers({arguments}) -> tuple[object, ...]:\n"
        f'    """Returns what is offered."""\n    return (\n{rows}    )\n'
    )


def _page() -> str:
    """Returns the page with the files of the contract, that of the UAV first."""
    head, _, _ = _PAGE.read_text(encoding="utf-8").partition("``ual/v1/")
    return head + "\n".join(map(_section, _files()))


def _files() -> Iterator[str]:
    found = sorted(path.stem for path in (PROTO / "ual" / "v1").glob("*.proto") if path.stem != "options")
    return iter(sorted(found, key=lambda each: each != "ual"))


def _section(file: str) -> str:
    title = f"``ual/v1/{file}.proto``"
    return f"{title}\n{'-' * len(title)}\n\n.. literalinclude:: ../../proto/ual/v1/{file}.proto\n   :language: proto\n"
