"""The files of the contract, as they are generated: what is new in the contract is in each test of all of it."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Final

from google.protobuf.descriptor import FileDescriptor

import ual.v1


def _files() -> tuple[FileDescriptor, ...]:
    names = sorted(each.name for each in pkgutil.iter_modules(ual.v1.__path__) if each.name.endswith("_pb2"))
    found = (importlib.import_module(f"ual.v1.{name}") for name in sorted(names, key=lambda each: each != "ual_pb2"))
    return tuple(each.DESCRIPTOR for each in found)


FILES: Final[tuple[FileDescriptor, ...]] = _files()
"""Files of the contract; the UAV's first, as the others use it."""
SERVICES: Final = tuple(each.full_name for file in FILES for each in file.services_by_name.values())
"""The full names of the services."""
