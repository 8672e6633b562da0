"""The packages of the extra ``record``."""

from __future__ import annotations

from importlib import import_module

from ual import _extras

_MODULES = ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf.PoseInFrame_pb2")


def require(distribution: str = "ual-client") -> None:
    """Checks that the packages are installed that recordings need; `distribution` is what has the extra.

    Raises:
        NotSupportedError: One is not; names the extra to install.

    """
    with _extras.needs("a recording", "record", distribution):
        for module in _MODULES:
            import_module(module)
