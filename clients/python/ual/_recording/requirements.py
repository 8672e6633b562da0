"""The packages of the extra ``record``."""

from __future__ import annotations

from importlib import import_module

from ual.errors import NotSupportedError

_MODULES = ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf.PoseInFrame_pb2")


def require(distribution: str = "ual-client") -> None:
    """Checks that the packages are installed that recordings need; `distribution` is what has the extra.

    Raises:
        NotSupportedError: One is not; names the extra to install.

    """
    try:
        for module in _MODULES:
            import_module(module)
    except ImportError as error:
        raise NotSupportedError(
            f"recordings need the extra 'record': pip install '{distribution}[record]' ({error})"
        ) from None
