"""The process that paints: each order that comes is answered by the bytes of a picture. See `painter`."""

from __future__ import annotations

import signal
import sys
from contextlib import suppress
from multiprocessing.connection import Connection

from ual.cameras import ImageKind
from ual_daemon.backends.light import painting, png
from ual_daemon.backends.light.scene import PaintOrder


def main() -> None:
    """Paints until the daemon ends. The argument is the number of the connection's file."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the daemon's: it may have to land first
    connection = Connection(int(sys.argv[1]))
    with suppress(EOFError, ConnectionError):
        while True:
            order: PaintOrder = connection.recv()
            connection.send_bytes(_painted(order))


def _painted(order: PaintOrder) -> bytes:
    where = order.camera, order.intrinsics, order.scene
    if order.kind is ImageKind.COLOUR:
        return png.encode(painting.paint(*where, order.noise, order.seed))
    if order.kind is ImageKind.SEGMENTATION:
        return png.encode(painting.segments(*where))
    measure = painting.depths if order.kind is ImageKind.DEPTH else painting.ranges
    return measure(*where).astype("<f4").tobytes()


if __name__ == "__main__":
    main()
