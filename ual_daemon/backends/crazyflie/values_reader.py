"""Takes the packets of logged values: which block, how old, from which boot."""

from __future__ import annotations

from ual_daemon.backends.crazyflie import log_blocks
from ual_daemon.backends.crazyflie.log_blocks import Block
from ual_daemon.backends.crazyflie.telemetry import BoardTime, CrazyflieTelemetry
from ual_daemon.backends.engine.link_watch import LinkWatch

CLOCK_TOLERANCE_S = 1.0
"""A firmware whose blocks are gone has booted if its clock is off by more than this; else another client took them."""


class ValuesReader:
    """Fills `CrazyflieTelemetry`. Belongs to the thread that receives."""

    def __init__(self, telemetry: CrazyflieTelemetry, watch: LinkWatch) -> None:
        """The link lives while the values of the motion come."""
        self._telemetry = telemetry
        self._watch = watch
        self._blocks: dict[int, Block] = {}
        self._motion_ident = -1
        self._times: dict[int, BoardTime] = {}
        self.is_boot_open = False
        """Whether it may have booted since the last values: the next ones show it."""
        self.has_rebooted = False
        """Whether it has booted since the last time; the caller sets it back."""

    def use(self, blocks: tuple[Block, ...]) -> None:
        """Reads these blocks from now on, which were made again: the firmware may have booted.

        The first is that of the motion.
        """
        self._blocks = {block.ident: block for block in blocks}
        self._motion_ident = blocks[0].ident
        self.is_boot_open = self._motion_ident in self._times

    def on_data(self, data: bytes, now_s: float, utc_s: float) -> None:
        """Takes a packet of values."""
        block = self._blocks.get(log_blocks.block_of(data)) if len(data) >= log_blocks.HEADER_BYTES else None
        values = None if block is None else block.decode(data)
        if block is None or values is None:
            return
        stamp_ms = log_blocks.milliseconds(data)
        if self.is_boot_open:
            self._judge_boot(stamp_ms, now_s)
        measured_s = self._times.setdefault(block.ident, BoardTime()).update(stamp_ms, now_s)
        if measured_s is None:
            return
        if block.ident == self._motion_ident:
            self._watch.on_message(now_s)
            self._telemetry.on_motion(values, measured_s, now_s, utc_s)
        else:
            self._telemetry.on_status(values, now_s)

    def _judge_boot(self, stamp_ms: int, now_s: float) -> None:
        self.is_boot_open = False
        if not self._times[self._motion_ident].fits(stamp_ms, now_s, CLOCK_TOLERANCE_S):
            self._times.clear()
            self._telemetry.discard()
            if self._telemetry.begins_anew:
                self._telemetry.boots_count += 1
            else:
                self._telemetry.boots_in_frame_count += 1
            self._watch.on_reboot(now_s)
            self.has_rebooted = True
