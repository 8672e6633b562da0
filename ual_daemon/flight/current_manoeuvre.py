"""Present manoeuvre of a UAV."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import NamedTuple

from ual.errors import UalError
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre


@dataclass(slots=True, eq=False)
class CurrentManoeuvre:
    """Manoeuvre that one UAV flies. Only `Flight` changes it, with the lock held; any thread may read it without.

    The lock is never held over a call to the backend, over a callback, or while a future is ended.
    """

    manoeuvre: Manoeuvre | None = None
    lock: threading.Lock = field(default_factory=threading.Lock)


class Ending(NamedTuple):
    """End of a manoeuvre that is not flown any more.

    Attributes:
        error: Why it did not succeed; None if it did.
        goes_on: Whether its task does not end, but goes on with the manoeuvre that is flown now.
    """

    error: UalError | None = None
    goes_on: bool = False


SILENT = Ending()
"""The end of what no caller waits for, or of nothing."""
