"""Signed messages (MAVLink 2): the key, the timestamps of our signatures, and the check of received ones."""

from __future__ import annotations

import hashlib
import os
import stat
import time
from collections import OrderedDict
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import TypeAlias

from ual_daemon.backends.mavlink.settings import SECTION
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame
from ual_daemon.settings import ConfigError

KEY = f"{SECTION}.signing_key_file"
KEY_MISSING = f"signs its messages and may not listen to ours: set {KEY}"
KEY_BYTES = 32
_HASH_BYTES = 6
_TIMESTAMP_BYTES = 6
_LARGEST_TIMESTAMP_UNITS = 256**_TIMESTAMP_BYTES - 1
EPOCH_S = 1_420_070_400.0
"""2015-01-01 UTC, from which timestamps count in units of 10 us."""
_UNITS_PER_S = 100_000
OLDEST_TIMESTAMP_S = 60.0
"""A new sender's clock may be at most this much behind ours."""
MOST_SENDERS = 64
"""Most senders (a component of a system, on one of its links) that are remembered. A vehicle has a few."""
_LARGEST_FILE_BYTES = 4096
_FORMS = (b"hex", b"raw")


def read_key(path: str) -> bytes:
    """Returns the key in a file, in the form that it says: ``hex:`` and 64 digits, ``raw:`` and 32 bytes, or else a
    passphrase. A passphrase is a line of text, whose SHA-256 is the key (as in QGroundControl, MAVProxy and Mission
    Planner).

    Raises:
        ConfigError: The file cannot be read, holds no key, or could be read by other users.

    """
    try:
        with Path(path).expanduser().open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            if mode & 0o077:
                raise ConfigError(f"others can read or change {path} (mode {mode:o}); run: chmod 600 {path}", KEY)
            content = file.read(_LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}", KEY) from None
    except RuntimeError:
        raise ConfigError(f"cannot read {path}: there is no home directory: set HOME", KEY) from None
    form, _, rest = content.partition(b":")
    _require_exact(form, path)
    if form == b"raw":
        return _of_size(rest, path, f"raw: must be followed by the {KEY_BYTES} bytes of the key and nothing else")
    if form == b"hex":
        return _of_size(_unhexed(rest), path, f"hex: must be followed by {2 * KEY_BYTES} hexadecimal digits")
    return hashlib.sha256(_passphrase(content, path)).digest()


def _require_exact(form: bytes, path: str) -> None:
    """Refuses ``HEX:`` and the like, which would be a passphrase."""
    meant = form.strip().lower()
    if meant in _FORMS and form != meant:
        raise ConfigError(f"{path} begins with {form.decode()!r}: write {meant.decode()}: as its first letters", KEY)


def _of_size(key: bytes, path: str, rule: str) -> bytes:
    if len(key) != KEY_BYTES:
        raise ConfigError(f"{path}: {rule}", KEY)
    return key


def _unhexed(digits: bytes) -> bytes:
    try:
        return bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        return b""


def _passphrase(content: bytes, path: str) -> bytes:
    passphrase = content.rstrip(b"\r\n")
    try:
        text = passphrase.decode()
    except UnicodeDecodeError:
        text = ""
    if not text or not text.isprintable() or len(content) > _LARGEST_FILE_BYTES:
        raise ConfigError(
            f"{path} holds no line of text as passphrase; write raw: before the {KEY_BYTES} bytes of a key, or hex: "
            "before its hexadecimal digits",
            KEY,
        )
    return passphrase


_Sender: TypeAlias = tuple[int, int, int]
"""Link, system, component."""


class SignatureVerdict(Enum):
    """The result of checking a signature; the value is human-readable."""

    GOOD = ""
    UNSIGNED = "not signed"
    WRONG_KEY = "signed with another key"
    OLD = "signed more than a minute ago (its clock is behind)"
    REPEATED = "signed before one that came already"
    CROWDED = "too many senders have this key"


class Signer:
    """Timestamps and checks signatures with one key, by the rules of the specification. `utc` returns UTC in seconds.

    One thread may call `sign` (sending) while another one calls `check` (receiving).

    Unlike that of pymavlink, the check stores a timestamp only once it knows that the signature is right, so that no
    forged frame locks the autopilot out. It also checks messages that are not known.
    """

    def __init__(
        self, key: bytes, utc: Callable[[], float] = time.time, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.key = key
        self._utc = utc
        self._clock = clock
        self._sent = 0
        self._received = 0
        self._newest: OrderedDict[_Sender, tuple[int, float]] = OrderedDict()
        """For each sender its newest timestamp and when that came; the sender heard last is at the end."""
        self._forgotten = -1
        """The newest timestamp of all senders that were forgotten. Nothing up to it is accepted from an unknown sender:
        it could be a repetition."""

    def next_timestamp(self) -> int:
        """Returns the timestamp of the next signature: newer than the last, not older than any valid received one.

        Only the last one that there is may come twice: one with the key may have sent it.
        """
        self._sent = min(max(self._sent + 1, self._received, self._now()), _LARGEST_TIMESTAMP_UNITS)
        return self._sent

    def sign(self, frame: bytes) -> bytes:
        """Returns a frame with its signature: link 0, the next timestamp, and the beginning of their hash."""
        signed = frame + b"\0" + self.next_timestamp().to_bytes(_TIMESTAMP_BYTES, "little")
        return signed + hashlib.sha256(self.key + signed).digest()[:_HASH_BYTES]

    def check(self, frame: MavlinkFrame) -> SignatureVerdict:
        """Checks a frame's signature. A frame is good only once."""
        if not frame.is_signed:
            return SignatureVerdict.UNSIGNED
        signed, signature = frame.data[:-_HASH_BYTES], frame.data[-_HASH_BYTES:]
        if hashlib.sha256(self.key + signed).digest()[:_HASH_BYTES] != signature:
            return SignatureVerdict.WRONG_KEY
        timestamp = int.from_bytes(signed[-_TIMESTAMP_BYTES:], "little")
        sender = (signed[-_TIMESTAMP_BYTES - 1], frame.system_id, frame.component_id)
        newest = self._newest.get(sender)
        if newest is None:
            if timestamp < max(self._sent, self._received, self._now()) - OLDEST_TIMESTAMP_S * _UNITS_PER_S:
                return SignatureVerdict.OLD
            if timestamp <= self._forgotten:
                return SignatureVerdict.REPEATED
            if not self._has_room():
                return SignatureVerdict.CROWDED
        elif timestamp <= newest[0]:
            return SignatureVerdict.REPEATED
        self._newest[sender] = timestamp, self._clock()
        self._newest.move_to_end(sender)
        self._received = max(self._received, timestamp)
        return SignatureVerdict.GOOD

    def _has_room(self) -> bool:
        """Returns whether one more sender can be remembered. Forgets the one heard least lately, if it has fallen
        silent.

        One that is received is never forgotten: others with this key, whose clocks are ahead, could shut it out.
        """
        if len(self._newest) < MOST_SENDERS:
            return True
        timestamp, heard_s = next(iter(self._newest.values()))
        if self._clock() - heard_s < OLDEST_TIMESTAMP_S:
            return False
        self._newest.popitem(last=False)
        self._forgotten = max(self._forgotten, timestamp)
        return True

    def _now(self) -> int:
        return max(0, int((self._utc() - EPOCH_S) * _UNITS_PER_S))
