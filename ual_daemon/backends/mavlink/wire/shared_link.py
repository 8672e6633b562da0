"""One link with several vehicles behind it: a port, a radio or a router. Each vehicle gets what its system sends."""

from __future__ import annotations

import logging
import os
import select
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from typing_extensions import override

from ual_daemon.backends.base import Clock
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S
from ual_daemon.backends.engine.loop import OnceLog
from ual_daemon.backends.mavlink.links.base import READ_BATCH_BYTES, Address, Chunk, MavlinkLink
from ual_daemon.backends.mavlink.links.connection import LinkConnection
from ual_daemon.backends.mavlink.links.udp import cannot_send
from ual_daemon.backends.mavlink.wire.frames import FrameReader, Piece, piece_of, pieces
from ual_daemon.backends.mavlink.wire.receiver import INCOMPLETE_FRAME_S

_log = logging.getLogger(__name__)

RECEIVE_WAIT_S = 0.05
"""The longest interval between two looks at the link."""
QUEUE_BYTES = 1 << 18
"""Bytes that may wait for the thread of one vehicle; more is dropped, as a system drops data that overflows a
socket.
"""


class SharedLink:
    """Opens the link with the first vehicle, and closes it with the last. `vehicle` may be called from any thread.

    A thread of its own reads the link. What a system sends goes to the vehicle of that system id, and to no other. The
    heartbeats of systems that no vehicle has go to all vehicles: one that does not hear its own says what it hears.
    """

    def __init__(self, make: Callable[[], MavlinkLink], url: str, clock: Clock) -> None:
        self._make = make
        self._url = url
        self._clock = clock
        self._lock = threading.Lock()
        self._vehicles: dict[int, VehicleLink] = {}
        self._reading: _LinkReading | None = None

    def vehicle(self, system_id: int) -> VehicleLink:
        """Returns the link to the vehicle with a system id, not open yet."""
        return VehicleLink(self, system_id)

    def attach(self, link: VehicleLink) -> _LinkReading:
        """Begins to read for a vehicle. Returns what reads."""
        with self._lock:
            self._vehicles[link.system_id] = link
            if self._reading is None:
                connection = LinkConnection(self._make(), self._url)
                self._reading = _LinkReading(connection, self._clock, f"mavlink {self._url}")
                self._reading.vehicles = dict(self._vehicles)
                self._reading.open()
            self._reading.vehicles = dict(self._vehicles)
            return self._reading

    def detach(self, link: VehicleLink) -> None:
        """Ends reading for a vehicle; with the last one the link is closed."""
        with self._lock:
            reading = self._reading
            if reading is None or self._vehicles.get(link.system_id) is not link:
                return
            del self._vehicles[link.system_id]
            reading.vehicles = dict(self._vehicles)
            if not self._vehicles:
                self._reading = None
                reading.close()


class _LinkReading:
    """The open link, and the thread that reads it. `vehicles` is replaced, never changed."""

    def __init__(self, connection: LinkConnection, clock: Clock, name: str) -> None:
        self.connection = connection
        self.vehicles: Mapping[int, VehicleLink] = {}
        self._clock = clock
        self._reader = FrameReader()
        self._connections_count = 0
        self._looked_s = clock.now_s()
        self._failures = OnceLog("reading a shared link failed; this is a defect of UAL, please report it")
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread and closes the link."""
        self._closing.set()
        self.connection.wake()
        self._thread.join()
        self.connection.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._poll()
            except Exception as error:  # noqa: BLE001 - the callers must see a lost link that comes back
                self._failures.log(error)
                self.connection.restart(self._clock.now_s())
                self._closing.wait(RECEIVE_WAIT_S)

    def _poll(self) -> None:
        """Waits for data once, and hands them over. After a pause of this thread nobody knows how old they are."""
        connection = self.connection
        connection.tick(self._clock.now_s())
        waiting_s = self._clock.now_s()
        chunks = connection.receive(RECEIVE_WAIT_S, waiting_s)
        now_s = self._clock.now_s()
        if now_s - self._looked_s > BLIND_SILENCE_S:
            connection.discard(now_s)
            chunks = []
        self._looked_s = now_s
        self._tell_state()
        self._reader.refill(now_s)
        for data, address in chunks:
            self._hand_over(data, address, now_s)
        for _, frames in self._reader.give_up(now_s - INCOMPLETE_FRAME_S):
            self._give(map(piece_of, frames), connection.peer, now_s)

    def _tell_state(self) -> None:
        """Tells all vehicles what is true of the link, as each of them would see it with a link of its own."""
        count, trouble = self.connection.connections_count, self.connection.trouble
        if count != self._connections_count:
            self._connections_count = count
            self._reader.forget()
        for each in self.vehicles.values():
            each.connections_count = count
            each.link_trouble = trouble

    def _hand_over(self, data: bytes, address: Address | None, now_s: float) -> None:
        garbage_count = self._reader.garbage_count
        found = [piece_of(each) for each in self._reader.feed(data)] if self.connection.is_stream else pieces(data)
        self._give(found, address, now_s)
        if not found and (not self.connection.is_stream or self._reader.garbage_count > garbage_count):
            for each in self.vehicles.values():  # pieces of frames, or none: each vehicle's reader judges them
                each.put((data, address))

    def _give(self, found: Iterable[Piece], address: Address | None, now_s: float) -> None:
        for piece in found:
            self.connection.on_received(now_s)
            vehicle = self.vehicles.get(piece.system_id)
            if vehicle is not None:
                vehicle.put((piece.data, address))
            elif not piece.message_id:  # a heartbeat
                for each in self.vehicles.values():
                    each.put((piece.data, address))


class _Ends(NamedTuple):
    """A pipe: it holds one byte while chunks wait."""

    read: int
    write: int


class VehicleLink(MavlinkLink):
    """The part of a shared link that leads to one vehicle."""

    is_stream = False  # whole frames come, whatever the link is

    def __init__(self, shared: SharedLink, system_id: int) -> None:
        self.system_id = system_id
        self.link_trouble = ""
        """Trouble of the shared link."""
        self._trouble = ""
        self._shared = shared
        self._reading: _LinkReading | None = None
        self._peer: Address | None = None
        self._lock = threading.Lock()
        self._waiting: deque[Chunk] = deque()
        self._waiting_bytes = 0
        self._ends: _Ends | None = None

    @override
    def open(self) -> None:
        ends = os.pipe()
        for each in ends:
            os.set_blocking(each, False)
        self._ends = _Ends(*ends)
        self._reading = self._shared.attach(self)

    @override
    def close(self) -> None:
        self._reading = None
        self._shared.detach(self)
        with self._lock:
            ends, self._ends = self._ends, None
            self._waiting.clear()
            self._waiting_bytes = 0
            for each in ends or ():
                os.close(each)

    @override
    def descriptors(self) -> Mapping[int, int]:
        ends = self._ends
        return {} if ends is None else {ends.read: select.POLLIN}

    def put(self, chunk: Chunk) -> None:
        """Takes what has come for this vehicle. By the thread that reads the link."""
        with self._lock:
            if self._ends is None or self._waiting_bytes + len(chunk[0]) > QUEUE_BYTES:
                return
            if not self._waiting:
                os.write(self._ends.write, b"\0")
            self._waiting.append(chunk)
            self._waiting_bytes += len(chunk[0])

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        found: list[Chunk] = []
        taken = 0
        with self._lock:
            while self._waiting and taken < READ_BATCH_BYTES:
                found.append(self._waiting.popleft())
                taken += len(found[-1][0])
            self._waiting_bytes -= taken
            if found and not self._waiting and self._ends is not None:
                os.read(self._ends.read, 1)
        return found

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        reading, peer = self._reading, self.peer
        if reading is None or peer is None:
            return False
        try:
            has_left = reading.connection.send_to(data, peer, is_perishable=is_perishable)
        except OSError as error:
            trouble = cannot_send(peer, error)
            if trouble != self._trouble:
                self._trouble = trouble
                _log.warning("%s", trouble)
            return False
        self._trouble = ""
        return has_left

    @property
    @override
    def has_room(self) -> bool:
        reading = self._reading
        return reading is not None and reading.connection.has_room

    @property
    @override
    def trouble(self) -> str:
        return self.link_trouble or self._trouble

    @property
    @override
    def peer(self) -> Address | None:
        """Address from which this vehicle was received; else the address to which the link leads."""
        reading = self._reading
        if reading is None:
            return None
        return self._peer if self._peer is not None and not reading.connection.is_stream else reading.connection.peer

    @override
    def answer_to(self, address: Address | None) -> None:
        self._peer = address
