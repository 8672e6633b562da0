"""Writes the command of a service that has none by hand: each member is a command, with its arguments."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tools.contract.parts import INTERFACE, ContractPart, PartMember
from tools.contract.python_source import classes

_TYPES = {"str": "", "int": ", type=int", "float": ", type=float"}
_EXAMPLES = {"str": "NAME", "int": "1", "float": "1.5"}
_LISTS = "get_all"
"""The member whose command is called ``list``."""


def commands(part: ContractPart) -> str:
    """Returns the group of a service."""
    about = (ast.get_docstring(classes(INTERFACE)[part.name]) or "").splitlines()[0].partition(" See ``")[0]
    members = [each for each in part.members if not each.is_stream]
    examples = ", ".join(f'"{_example(part, each)}"' for each in members)
    return (
        f'\n\n@click.group("{part.module}", cls=UalGroup, section=Section.CARRIED, examples=({examples},))\n'
        f'def {part.module}() -> None:\n    """{about}"""\n' + "".join(_command(part, each) for each in members)
    )


def _example(part: ContractPart, member: PartMember) -> str:
    """Returns a call of a command, with the arguments that have no default."""
    kinds = {each.arg: ast.unparse(each.annotation) for each in member.arguments if each.annotation}
    given = [_EXAMPLES.get(kinds[name], "") for name in _required(member)]
    return " ".join(("ual", part.module, _name(member), *given))


def _required(member: PartMember) -> list[str]:
    """Returns the arguments that have no default, and are given by their order."""
    return [each.arg for each in member.signature.args[1 : len(member.signature.args) - len(member.signature.defaults)]]


def _name(member: PartMember) -> str:
    return "list" if member.name == _LISTS else member.name.replace("_", "-")


def _command(part: ContractPart, member: PartMember) -> str:
    name = _name(member)
    declared = "".join(f"@click.{each}\n" for each in _parameters(part, member))
    arguments = "".join(f", {each.arg}: {ast.unparse(each.annotation)}" for each in member.arguments if each.annotation)
    call = f"uav.{part.module}.{member.name}({member.passed() if member.arguments else ''})"
    done = f'    session.emit({{"done": "{part.module} {name}"}}, "done")\n'
    shown = f'{{"{member.name}": found}}' if member.returned in (*_TYPES, "bool") else "found"
    told = f"    session.emit({shown}, str(found))\n"
    is_told = member.returned != "None"
    return (
        f'\n\n@{part.module}.command("{name}", cls=UalCommand, examples=("{_example(part, member)}",))\n'
        f"{declared}@pass_session\n"
        f"def _{part.module}_{member.name}(session: CommandSession{arguments}) -> None:\n"
        f'    """{member.documentation.splitlines()[0]}"""\n'
        f"    with session.connect() as uav:\n        {'found = ' * is_told}{call}\n{told if is_told else done}"
    )


def _parameters(part: ContractPart, member: PartMember) -> Iterator[str]:
    """Yields the declarations of a member's arguments: those without a default are arguments of the command."""
    given = len(member.signature.args) - len(member.signature.defaults)
    required = _required(member)
    defaults: dict[str, ast.expr | None] = dict(
        zip([each.arg for each in member.signature.args[given:]], member.signature.defaults, strict=True)
    )
    defaults |= {
        each.arg: value for each, value in zip(member.signature.kwonlyargs, member.signature.kw_defaults, strict=True)
    }
    for each in member.arguments:
        kind = "" if each.annotation is None else ast.unparse(each.annotation).removesuffix(" | None")
        default = defaults.get(each.arg)
        flag = each.arg.removeprefix("is_").replace("_", "-")
        if kind == "bool":
            shown = "False" if default is None else ast.unparse(default)
            yield f'option("--{flag}/--no-{flag}", "{each.arg}", default={shown})'
        elif kind not in _TYPES:
            path = f"ual_tools/{part.module}.py"
            raise SystemExit(f"{part.name}.{member.name} takes a {kind}: its command is by hand, in {path}")
        elif each.arg in required:
            yield f'argument("{each.arg}"{_TYPES[kind]})'
        else:
            shown = "" if default is None else f", default={ast.unparse(default)}"
            yield f'option("--{flag}", "{each.arg}"{_TYPES[kind]}{shown})'
