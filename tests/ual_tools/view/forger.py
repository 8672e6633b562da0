"""A browser that lies: it speaks viser's protocol over a plain WebSocket, and sends whatever it is told to."""

from __future__ import annotations

import ssl
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any

import msgspec
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from tests.conftest import LIMIT_S
from tests.waiting import until

_HEAD = 16
_ALIGNED = 8
CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 5.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class Forger:
    """Messages of the server, by the ids of the elements of its panel."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self.elements: dict[str, dict[str, Any]] = {}
        self.enabled_clicks: list[Any] = []
        self.nodes: dict[str, dict[str, Any]] = {}
        """Nodes of the scene, by name."""
        self._updates: list[str] = []
        """The texts that came, in their order."""
        self.send(**CAMERA)  # only then the server takes it for a page

    def send(self, **message: object) -> None:
        self._connection.send(msgspec.msgpack.encode(message))

    def read_until(self, label: str) -> str:
        """Reads until an element of this label is there, and returns its id."""
        return until(lambda: self._find(label), label, seen=self._labels, between=self._read)

    def read_until_text(self, text: str) -> None:
        """Reads until an element has a text with these words."""
        until(lambda: self._has(text), text, seen=lambda: self.elements, between=self._read)

    def now(self) -> int:
        """The point before everything that is read from now on."""
        return len(self._updates)

    def read_until_new(self, text: str, since: int) -> None:
        """Reads until an element was given a text with these words, after a point (`now`)."""

        def has_come() -> bool:
            return any(text in each for each in self._updates[since:])

        until(has_come, text, seen=lambda: self._updates[since:], between=self._read)

    def read_until_paths(
        self, name: str, are_these: Callable[[list[tuple[float, ...]]], bool] = bool
    ) -> list[tuple[float, ...]]:
        """Reads until lines of this name are drawn whose points fulfil a condition, and returns these."""
        until(lambda: are_these(self._rows(name)), name, seen=lambda: [*self.nodes], between=self._read)
        return self._rows(name)

    def _rows(self, name: str) -> list[tuple[float, ...]]:
        node = self.nodes.get(name, {})
        return list(struct.iter_unpack("<3f", node["points"])) if node.get("visible") else []

    def _find(self, label: str) -> str:
        return next((key for key, each in self.elements.items() if each.get("label") == label), "")

    def _has(self, text: str) -> bool:
        return any(text in str(value) for each in self.elements.values() for value in each.values())

    def _labels(self) -> list[object]:
        return [each.get("label") for each in self.elements.values()]

    def _read(self) -> None:
        self.read(LIMIT_S)

    def read(self, timeout_s: float) -> None:
        """Reads one bundle of messages."""
        data = self._connection.recv(timeout_s)
        assert isinstance(data, bytes)
        size = int.from_bytes(data[8:_HEAD], "little")
        bundle = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[_HEAD : _HEAD + size]))
        buffers, offset = [], _HEAD + size
        for length in bundle["binaryBufferLengths"]:
            offset += -offset % _ALIGNED
            buffers.append(data[offset : offset + length])
            offset += length
        for message in bundle["messages"]:
            self._take(_filled(message, buffers))

    def _take(self, message: dict[str, Any]) -> None:
        if message["type"] == "ScenePointerEnableMessage":
            self.enabled_clicks += message["modifiers"]
        elif "name" in message and "props" in message:
            self.nodes[message["name"]] = dict(message["props"])
        elif message["type"] == "SceneNodeUpdateMessage":
            self.nodes[message["name"]].update(message["updates"])
        elif message["type"] == "SetSceneNodeVisibilityMessage" and message["name"] in self.nodes:
            self.nodes[message["name"]]["visible"] = message["visible"]
        elif message["type"] == "GuiUpdateMessage" and message["uuid"] in self.elements:
            self.elements[message["uuid"]].update(message["updates"])
            self._updates += map(str, message["updates"].values())
        elif message["type"].startswith("Gui") and "props" in message:
            self.elements[message["uuid"]] = {**message["props"], "type": message["type"]}


def _filled(value: Any, buffers: list[bytes]) -> Any:
    """A message with its arrays, which come behind all messages of a bundle."""
    if isinstance(value, list):
        return [_filled(each, buffers) for each in value]
    if not isinstance(value, dict):
        return value
    if "__binary_index" in value:
        return buffers[value["__binary_index"]]
    return {key: _filled(each, buffers) for key, each in value.items()}


@contextmanager
def forger(url: str, headers: Mapping[str, str] | None = None, tls: ssl.SSLContext | None = None) -> Iterator[Forger]:
    """A connection to the page at an address."""
    import viser

    address = url.replace("http", "ws", 1)
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    opened = connect(
        address, subprotocols=[protocol], ssl=tls, additional_headers=headers, max_size=None, open_timeout=LIMIT_S
    )
    with closing(opened) as connection:
        yield Forger(connection)
