"""The packages of the extra ``record``: to write recordings, and to read them."""

from __future__ import annotations

from importlib import import_module

from ual.shared import extras

_READING = ("mcap.stream_reader", "lz4.frame")
"""Without lz4 mcap can be imported, and takes each chunk for the end of the file."""
_MODULES = ("mcap.writer", "lz4.frame", "mcap_protobuf.schema", "foxglove_schemas_protobuf.PoseInFrame_pb2")


def require(extra: str) -> None:
    """Checks that the packages are installed that a new recording needs; `extra` is what brings them.

    Raises:
        NotSupportedError: One is not; names the extra to install.

    """
    with extras.needs("a recording", extra):
        for module in _MODULES:
            import_module(module)


def require_reading(what: str = "a recording", extra: str = "ual-client[record]") -> None:
    """Checks that the package is installed that reads recordings; `extra` is what to install for `what`.

    Raises:
        NotSupportedError: It is not; names the extra.

    """
    with extras.needs(what, extra):
        for module in _READING:
            import_module(module)
