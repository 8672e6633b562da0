"""Puts long status texts together."""

from __future__ import annotations

from ual_daemon.backends.mavlink.wire.messages import Message

_PART_CHARACTERS = 50


class StatusText:
    """The newest text of an autopilot. A long one comes in parts with one id, each of which is appended to the last."""

    def __init__(self) -> None:
        self.text = ""
        self._open_part: tuple[int, int] | None = None
        """Id and number of the last part, while another one may follow."""

    def update(self, message: Message) -> None:
        """Takes a STATUSTEXT."""
        part, last = (message.id, message.chunk_seq), self._open_part
        follows = message.id and last is not None and part == (last[0], last[1] + 1)
        self.text = self.text + message.text if follows else message.text
        self._open_part = part if len(message.text) == _PART_CHARACTERS else None
