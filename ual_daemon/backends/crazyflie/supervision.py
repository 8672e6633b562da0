"""The state of a link: opening, connecting, connected, lost, and round again for ever."""

from __future__ import annotations

import logging
import struct
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from enum import Enum

from ual_daemon import logs
from ual_daemon.backends.crazyflie.connecting import CrazyflieFirmware, Steps, UnfitError
from ual_daemon.backends.crazyflie.links import CrtpLink
from ual_daemon.backends.crazyflie.requests import CrtpRequest, CrtpRequests

_log = logging.getLogger(__name__)

FIRST_VALUES_S = 1.0
"""Seconds that the first values may take once they were requested."""
RETRY_S = 1.0
"""A link that cannot be opened, and a firmware that cannot be flown, are tried again after this time."""


class CrazyflieLinkState(Enum):
    """The state of the link; the value is human-readable."""

    OPENING = "opening the link"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    LOST = "lost"


class CrazyflieSupervision:
    """Supervises one link. Belongs to the thread that receives.

    `make_steps` begins to connect; it gets what is called to tell, in words, what is being done, and the firmware
    before the link was lost. `on_connected` gets the firmware, and whether it is another one than before.
    """

    def __init__(
        self,
        link: CrtpLink,
        requests: CrtpRequests,
        make_steps: Callable[[Callable[[str], None], CrazyflieFirmware | None], Steps],
        on_connected: Callable[[CrazyflieFirmware, bool], None],
    ) -> None:
        self.state = CrazyflieLinkState.OPENING
        self.text = CrazyflieLinkState.OPENING.value
        """Human-readable activity of the supervision."""
        self._link = link
        self._requests = requests
        self._make_steps = make_steps
        self._on_connected = on_connected
        self._firmware: CrazyflieFirmware | None = None
        self._steps: Steps | None = None
        self._answers: list[bytes | None] = []
        self._opening: Future[None] | None = None
        self._due_s = 0.0

    def tell(self, text: str) -> None:
        """Notes what is being done."""
        self.text = text

    def step(self, now_s: float, *, is_flowing: bool) -> None:
        """Does what is due. `is_flowing` is whether values of the pose come."""
        if self.state is CrazyflieLinkState.OPENING:
            self._open(now_s)
            return
        if self.state is CrazyflieLinkState.CONNECTED and not is_flowing and now_s >= self._due_s:
            self._change(CrazyflieLinkState.LOST, "its values do not come any more")
            self._begin()
        elif self.state is CrazyflieLinkState.LOST and is_flowing:  # it was only out of reach
            self._connected(self._firmware or CrazyflieFirmware(), now_s)
        elif self._steps is None and self.state is not CrazyflieLinkState.CONNECTED and now_s >= self._due_s:
            self._begin()
        elif self._steps is not None and None not in self._answers:
            self._advance(now_s)

    def reopen(self, why: str, now_s: float) -> None:
        """Closes the link, and opens it again after a while."""
        self._requests.clear()
        self._steps = None
        if self._opening is None:
            self._link.close()
        self._change(CrazyflieLinkState.OPENING, why)
        self._due_s = now_s + RETRY_S

    def close(self) -> None:
        """Closes the link for good; one that is being opened, as soon as it is open."""
        opening, self._opening = self._opening, None
        if opening is None:
            self._link.close()
        else:
            opening.add_done_callback(lambda _: self._link.close())

    # --- Opening ------------------------------------------------------------------------------------------------------

    def _open(self, now_s: float) -> None:
        """Opens the link on a thread of its own, as a scan or a device takes seconds."""
        opening = self._opening
        if opening is None and now_s >= self._due_s:
            self._opening = Future()
            threading.Thread(target=_open, args=(self._link, self._opening), name="crazyflie open", daemon=True).start()
        elif opening is not None and opening.done():
            self._opening = None
            error = opening.exception()
            if error is None:
                self._change(CrazyflieLinkState.CONNECTING, "")
                self._begin()
            else:
                self._change(CrazyflieLinkState.OPENING, str(error) or repr(error))
                self._due_s = now_s + RETRY_S

    # --- Connecting ---------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._requests.clear()
        self._steps, self._answers = self._make_steps(self.tell, self._firmware), []
        self._ask(next(self._steps))

    def _ask(self, requests: Sequence[CrtpRequest]) -> None:
        answers: list[bytes | None] = [None] * len(requests)
        self._answers = answers
        for index, request in enumerate(requests):
            self._requests.add(request, lambda data, index=index: answers.__setitem__(index, data))  # type: ignore[misc]

    def _advance(self, now_s: float) -> None:
        assert self._steps is not None
        if self.state is CrazyflieLinkState.LOST:  # it answers: from now on values alone do not show that all is well
            self._change(CrazyflieLinkState.CONNECTING, "")
        try:
            self._ask(self._steps.send([each for each in self._answers if each is not None]))
        except StopIteration as finished:
            self._connected(finished.value, now_s)
        except (UnfitError, ValueError, LookupError, struct.error) as error:
            self._steps = None
            self._requests.clear()
            self._change(CrazyflieLinkState.CONNECTING, str(error))
            self._due_s = now_s + RETRY_S

    def _connected(self, firmware: CrazyflieFirmware, now_s: float) -> None:
        self._requests.clear()
        is_new, self._firmware, self._steps = firmware is not self._firmware, firmware, None
        self._due_s = now_s + FIRST_VALUES_S  # the first values need a moment
        self._change(CrazyflieLinkState.CONNECTED, "")
        self._on_connected(firmware, is_new)

    def _change(self, state: CrazyflieLinkState, why: str) -> None:
        text = f"{state.value}: {why}" if why else state.value
        if (state, text) != (self.state, self.text):
            level = (
                logging.INFO
                if state in (CrazyflieLinkState.CONNECTING, CrazyflieLinkState.CONNECTED) and not why
                else logging.WARNING
            )
            logs.event(_log, level, "crazyflie_link", state=state.value, why=why or None)
        self.state, self.text = state, text


def _open(link: CrtpLink, opening: Future[None]) -> None:
    try:
        link.open()
    except Exception as error:  # noqa: BLE001  whoever waits for it says so, and tries again
        opening.set_exception(error)
    else:
        opening.set_result(None)
