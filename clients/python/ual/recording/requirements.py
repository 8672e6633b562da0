"""The packages of the extra ``record``: to write recordings, and to read them."""

from __future__ import annotations

from importlib import import_module

from ual.shared import extras

_READING = "mcap.stream_reader"
_MODULES = ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf.PoseInFrame_pb2")


def require(distribution: str = "ual-client") -> None:
    """Checks that the packages are installed that a new recording needs; `distribution` is what has the extra.

    Raises:
        NotSupportedError: One is not; names the extra to install.

    """
    with extras.needs("a recording", "record", distribution):
        for module in _MODULES:
            import_module(module)


def require_reading(what: str = "a recording", extra: str = "record") -> None:
    """Checks that the package is installed that reads recordings; `extra` is what to install for `what`.

    Raises:
        NotSupportedError: It is not; names the extra.

    """
    with extras.needs(what, extra):
        import_module(_READING)
