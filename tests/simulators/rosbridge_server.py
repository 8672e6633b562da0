"""The small rosbridge behind a real WebSocket, on a thread of its own, in real time."""

from __future__ import annotations

import select
import socket
import ssl
import threading
import time
from collections import deque
from contextlib import suppress

from typing_extensions import Self
from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol

from tests.simulators.rosbridge import Bridge, Session

_STEP_S = 0.01


class RosbridgeServer:
    """Serves a bridge on a port of 127.0.0.1 (0: a free one). `stop` and `start` are a bridge that goes and returns."""

    def __init__(self, bridge: Bridge, port: int = 0, tls: ssl.SSLContext | None = None) -> None:
        self.bridge = bridge
        self.port = port
        self._tls = tls
        self._clients: list[_Client] = []
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self.lock = threading.RLock()
        """Held while the bridge is stepped."""
        self.is_frozen = False
        """Nothing is read, answered or sent."""
        self.accepted_count = 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def url(self) -> str:
        """The URL of the bridge."""
        return f"rosbridge{'s' if self._tls else ''}://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Begins to listen."""
        listener = socket.create_server(("127.0.0.1", self.port))
        self.port = listener.getsockname()[1]
        self._ending.clear()
        self._thread = threading.Thread(target=self._run, args=(listener,), name="test rosbridge", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends all connections, and listens no more."""
        if self._thread is not None:
            self._ending.set()
            self._thread.join()
            self._thread = None

    def drop(self, index: int) -> None:
        """Ends one connection, by the order in which they were made."""
        with self.lock, suppress(OSError):  # it has ended by itself
            self._clients[index].socket.shutdown(socket.SHUT_RDWR)

    def _run(self, listener: socket.socket) -> None:
        begun_s = time.monotonic() - self.bridge.now_s
        try:
            with listener:
                while not self._ending.is_set():
                    readers = [] if self.is_frozen else [listener, *(client.socket for client in self._clients)]
                    select.select(readers, [], [], _STEP_S)
                    if not self.is_frozen:
                        with self.lock:
                            self._step(listener, time.monotonic() - begun_s)
                    elif not readers:
                        self._ending.wait(_STEP_S)
        finally:  # else its clients would wait for one that has died
            with self.lock:
                for client in self._clients:
                    client.end()
                self._clients.clear()

    def _step(self, listener: socket.socket, now_s: float) -> None:
        if select.select([listener], [], [], 0.0)[0]:
            sock, _ = listener.accept()
            with suppress(OSError):  # it refuses the certificate, or has gone
                self._clients.append(_Client(self._secured(sock), self.bridge.connect()))
            self.accepted_count += 1
        self.bridge.step(now_s)
        for client in list(self._clients):
            if not client.step():
                client.end()
                self._clients.remove(client)
                self.bridge.sessions.remove(client.session)

    def _secured(self, sock: socket.socket) -> socket.socket:
        return sock if self._tls is None else self._tls.wrap_socket(sock, server_side=True)


class _Client:
    def __init__(self, sock: socket.socket, session: Session) -> None:
        sock.setblocking(False)
        self.socket = sock
        self.session = session
        self._protocol = ServerProtocol(max_size=None)
        self._out: deque[bytes] = deque()

    def step(self) -> bool:
        """Receives and sends. Returns False once it has ended."""
        try:
            while self._read():
                pass
            while self.session.out and self._protocol.state is State.OPEN:
                message = self.session.out.popleft()
                if isinstance(message, bytes):
                    self._protocol.send_binary(message)
                else:
                    self._protocol.send_text(message.encode())
            self._flush()
        except OSError:
            return False
        return self._protocol.state is not State.CLOSED

    def end(self) -> None:
        self.session.out.clear()
        self.socket.close()

    def _read(self) -> bool:
        try:
            data = self.socket.recv(65536)
        except (BlockingIOError, ssl.SSLWantReadError):
            return False
        if not data:
            raise ConnectionResetError
        self._protocol.receive_data(data)
        for event in self._protocol.events_received():
            if isinstance(event, Request):
                self._protocol.send_response(self._protocol.accept(event))
            elif isinstance(event, Frame) and event.opcode is Opcode.TEXT:
                self.session.receive(bytes(event.data))
        return True

    def _flush(self) -> None:
        self._out.extend(self._protocol.data_to_send())
        while self._out:
            data = self._out[0]
            try:
                sent = self.socket.send(data)
            except (BlockingIOError, ssl.SSLWantWriteError):
                return
            self._out.popleft()
            if sent < len(data):
                self._out.appendleft(data[sent:])
