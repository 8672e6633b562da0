"""The stubs of Python: messages, services, and their types."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tools.contract.compiled import ROOT, contract_files, run_protoc, without_options

PACKAGE = ROOT / "clients" / "python"
_PLUGINS = Path(sys.executable).parent


def stubs(contract: FileDescriptorSet, files: Sequence[str] = (), package: Path = PACKAGE) -> dict[Path, str]:
    """Returns the modules of ``ual.v1``, or of other `files` of a contract, by path."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made"
        made.mkdir()
        image = Path(folder) / "contract.binpb"
        image.write_bytes(without_options(contract).SerializeToString())
        run_protoc(
            f"--descriptor_set_in={image}",
            *(f"--plugin={_PLUGINS / name}" for name in ("protoc-gen-mypy", "protoc-gen-mypy_grpc")),
            *(f"--{kind}_out={made}" for kind in ("python", "grpc_python")),
            *(f"--{kind}_out=quiet:{made}" for kind in ("mypy", "mypy_grpc")),
            *(files or contract_files()),
        )
        return {
            package / path.relative_to(made): path.read_text(encoding="utf-8")
            for path in sorted(made.rglob("*"))
            if path.is_file()
        }
