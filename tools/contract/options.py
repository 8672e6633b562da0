"""The options of the contract, which say what a compiler of messages does not know."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message


class Options:
    """Reads options, whose types are in the contract itself."""

    def __init__(self, contract: FileDescriptorSet) -> None:
        self._pool = descriptor_pool.DescriptorPool()
        for file in contract.file:
            self._pool.AddSerializedFile(file.SerializeToString())  # type: ignore[no-untyped-call]

    def read(self, kind: str, name: str, options: Message) -> Any:  # noqa: ANN401 (a message that is made at run time)
        """Returns an option of the contract's own: `name` of the options of a `kind`, such as ``Method``."""
        found = self._pool.FindMessageTypeByName(f"google.protobuf.{kind}Options")  # type: ignore[no-untyped-call]
        make: Any = message_factory.GetMessageClass(found)
        extension = self._pool.FindExtensionByName(f"ual.v1.{name}")  # type: ignore[no-untyped-call]
        return make.FromString(options.SerializeToString()).Extensions[extension]
