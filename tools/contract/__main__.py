"""Writes what follows from the contract: ``python -m tools.contract`` (``make proto``). Decision 48 says why.

With ``--check`` it writes nothing, and fails where something is out of date.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools import clients
from tools.contract import (
    calls_source,
    clients_source,
    core_servicers_source,
    extension,
    faces_source,
    lists_source,
    methods,
    roles_page,
    ros,
    servicers_source,
    values_source,
    wire_source,
)
from tools.contract.compiled import ROOT, compiled
from tools.contract.description import services
from tools.contract.formatting import formatted
from tools.contract.parts import CLIENT, parts, simulation, uav
from tools.contract.stubs import stubs
from tools.contract.values import Values, all_values

CALLS = CLIENT / "_service_calls"


def derived() -> dict[Path, str]:
    """Returns all that follows from the contract, by path."""
    contract = compiled()
    described = services(contract)
    page = ROOT / "docs" / "evidence" / "security.md"
    values = all_values(contract)
    return {
        **stubs(contract),
        **_values([each for each in values.values() if each.enums or each.messages]),
        CLIENT / "contract" / "methods.py": formatted(methods.source(described)),
        **_services(contract, values),
        page: roles_page.page(page.read_text(encoding="utf-8"), described),
        **ros.derived(contract),
        **_lists(contract),
        **clients.sources(),
        **{path: text for each in extension.EXAMPLES for path, text in extension.derived(each).items()},
    }


def _values(values: Sequence[Values]) -> dict[Path, str]:
    return {
        **{_path(each.module): formatted(values_source.source(each)) for each in values},
        **{CLIENT / "wire" / f"{each.wire}.py": formatted(wire_source.source(each)) for each in values},
    }


def _lists(contract: FileDescriptorSet) -> dict[Path, str]:
    found = lists_source.lists(parts(contract))
    return {path: formatted(source) if path.suffix == ".py" else source for path, source in found.items()}


def _path(module: str) -> Path:
    return CLIENT.parent.joinpath(*module.split(".")).with_suffix(".py")


def _services(contract: FileDescriptorSet, values: Mapping[str, Values]) -> dict[Path, str]:
    """Returns the calls, the servicers and the members of the class, of the services beside that of the UAV."""
    derivable = parts(contract)
    found = {
        CALLS / "uav.py": calls_source.source(values["ual"], [uav(contract)]),
        CALLS / "simulation.py": calls_source.source(values["simulation"], [simulation(contract)]),
    }
    found[core_servicers_source.UAV] = core_servicers_source.uav_source(values["ual"], uav(contract))
    world = core_servicers_source.simulation_source(values["simulation"], simulation(contract))
    found[core_servicers_source.SIMULATION] = world
    for file in sorted({each.file for each in derivable}):
        of_file = [each for each in derivable if each.file == file]
        found[CALLS / f"{file}.py"] = calls_source.source(values[file], of_file)
        found[servicers_source.ROOM / f"{file}.py"] = servicers_source.source(values[file], of_file)
    files = {service.name: Path(file.name).stem for file in contract.file for service in file.service}
    found[CALLS / "stubs.py"] = calls_source.stubs_source(files)
    found[clients_source.SYNC] = clients_source.sync_source(derivable)
    found[clients_source.AIO] = clients_source.aio_source(derivable)
    found[servicers_source.ROOM / "table.py"] = servicers_source.table_source(derivable)
    found[faces_source.PATH] = faces_source.source(derivable, uav(contract))
    return {path: formatted(source) for path, source in found.items()}


def links() -> dict[Path, str]:
    """Returns the links by which the client's wheel has the contract, each with its target."""
    room = CLIENT / "v1"
    return {room / each.name: os.path.relpath(each, room) for each in (ROOT / "proto" / "ual" / "v1").glob("*.proto")}


def out_of_date() -> list[Path]:
    """Returns the files that are not as they follow from the contract, and stubs of what is not in it any more."""
    wanted = derived()
    kept = {*wanted, calls_source.BY_HAND}
    there = (*(CLIENT / "v1").glob("*_pb2*"), *CALLS.glob("[a-z]*.py"), *ros.files())
    left_over = [path for path in there if path not in kept]
    left_over += [path for path in links() if not path.exists()]
    return left_over + [each for each, text in wanted.items() if not each.exists() or each.read_text("utf-8") != text]


def main() -> None:
    """Writes them, or says which are out of date."""
    if "--check" in sys.argv[1:]:
        if late := out_of_date():
            names = ", ".join(path.relative_to(ROOT).as_posix() for path in late)
            raise SystemExit(f"out of date: {names}: make proto")
        return
    for path, text in derived().items():
        path.write_text(text, encoding="utf-8")
    for path, target in links().items():
        if not path.exists():
            path.symlink_to(target)


if __name__ == "__main__":
    main()
