"""The files of the autopilot: what is asked for, again, or not any more, over good and bad links, and how each ends."""

from __future__ import annotations

import errno
import os
import random
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.protocols.served import HERE, Served, error_of
from ual.errors import (
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalTimeoutError,
)
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.ftp import IDLE_FILE_S, MOST_WAITING_READS, DirectoryEntry, Steps
from ual_daemon.backends.mavlink.protocols.ftp_packet import BLOCK_BYTES, FtpNakError, FtpPacket, Nak, Opcode, decode
from ual_daemon.backends.mavlink.protocols.ftp_steps import (
    GENTLE_DOWNLOAD_BYTES_S,
    MOST_BLOCKS,
    PROGRESS_TIMEOUT_S,
    TRIES_COUNT,
    WINDOW_BLOCKS,
)
from ual_daemon.backends.mavlink.wire.frames import MessageSource

FUZZ_COUNT = int(os.environ.get("UAL_TEST_FUZZ", "10000"))
LOG = "/fs/microsd/log/2026-11-25/13_22_11.ulg"


def content(size: int, seed: int = 5) -> bytes:
    return random.Random(seed).randbytes(size)


def opcodes(served: Served) -> list[int]:
    return [each.opcode for each in served.store.requests]


@pytest.fixture(params=["px4", "ardupilot"])
def served(request: pytest.FixtureRequest) -> Served:
    return Served(is_px4=request.param == "px4")


def test_a_packet_is_read_as_it_was_written() -> None:
    packet = FtpPacket(65535, 7, Opcode.ACK, 3, Opcode.READ_FILE, True, 2**32 - 1, b"abc")
    assert decode(packet.encode()) == packet
    assert len(packet.encode()) == 251
    assert decode(packet._replace(size=240).encode()) is None


def test_a_directory_is_listed_over_several_answers(served: Served) -> None:
    names = [f"a_long_name_of_a_file_{number:03}.ulg" for number in range(40)]
    served.store.files = {f"/log/{name}": bytes(len(name)) for name in names} | {"/log/sub/x.ulg": b"x"}
    found = served.done(served.ftp.list_directory("/log"))
    assert sorted(found) == sorted([*(DirectoryEntry(name, len(name)) for name in names), DirectoryEntry("sub", None)])


def test_a_directory_that_is_not_there_is_refused_in_words(served: Served) -> None:
    with pytest.raises(FtpNakError, match="/nowhere: the autopilot answers: there is no such file"):
        served.done(served.ftp.list_directory("/nowhere"))


@pytest.mark.parametrize("size", [0, 1, BLOCK_BYTES, 2 * BLOCK_BYTES, 100_000, 300 * BLOCK_BYTES])
def test_a_file_is_read_whole(served: Served, size: int) -> None:
    served.store.files = {"/file": content(size)}
    assert served.done(served.ftp.read_all("/file", 1_000_000)) == content(size)
    served.run(0.1)
    assert not served.store.is_open


def test_a_file_whose_size_is_not_reported_is_read_to_its_end(served: Served) -> None:
    for size in (10, 20 * BLOCK_BYTES, 20 * BLOCK_BYTES + 5, 500 * BLOCK_BYTES, 600 * BLOCK_BYTES):
        served.store.files = {"@PARAM/param.pck": content(size)}
        assert served.done(served.ftp.read_all("@PARAM/param.pck", 1_000_000)) == content(size)
        served.run(4.0)


@pytest.mark.parametrize("size", [BLOCK_BYTES + 1, 1000])
def test_a_path_that_is_too_long_is_refused_before_anything_is_sent(served: Served, size: int) -> None:
    listed, read = served.ftp.list_directory("d" * size), served.ftp.read("f" * size, 0, 10)
    with pytest.raises(NotSupportedError, match=f"a path of {size} bytes"):
        served.done(listed)
    with pytest.raises(NotSupportedError, match=f"a path of {size} bytes"):
        served.done(read)
    assert not served.store.requests


def test_a_file_that_is_too_long_is_refused(served: Served) -> None:
    served.store.files = {"/file": bytes(100_000)}
    with pytest.raises(ResourceExhaustedError, match="over 50000 bytes"):
        served.done(served.ftp.read_all("/file", 50_000))


@pytest.mark.parametrize(
    ("loss", "doubled", "late"), [(0.2, 0.0, 0.0), (0.2, 0.2, 0.3), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
)
def test_over_a_bad_link_a_file_is_whole_all_the_same(
    request: pytest.FixtureRequest, loss: float, doubled: float, late: float
) -> None:
    for is_px4 in (True, False):
        served = Served(is_px4=is_px4, loss=loss, doubled=doubled, late=late)
        served.store.files = {LOG: content(150_000)}
        parts = [served.done(served.ftp.read(LOG, offset, 50_000)) for offset in range(0, 150_000, 50_000)]
        assert b"".join(parts) == content(150_000), request.node.name


def test_armed_it_is_read_gently_and_never_by_bursts(served: Served) -> None:
    served.is_armed = True
    served.store.files = {LOG: content(200_000)}
    began_s = served.now_s
    assert served.done(served.ftp.read(LOG, 0, 200_000)) == content(200_000)
    took_s = served.now_s - began_s
    assert Opcode.BURST_READ_FILE not in opcodes(served)
    assert 200_000 / took_s < GENTLE_DOWNLOAD_BYTES_S * 1.05
    assert 200_000 / took_s > 10_000.0
    most = max(sum(began_s <= at_s < began_s + 0.1 for at_s, _ in served.received) for began_s, _ in served.received)
    assert most * BLOCK_BYTES < GENTLE_DOWNLOAD_BYTES_S * 0.2


def test_arming_ends_a_burst_that_is_in_progress() -> None:
    served = Served()
    served.store.per_step = 1
    served.store.files = {LOG: content(2_000_000)}
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 200_000))
    served.run(0.3)
    served.is_armed = True
    served.run(0.1)
    before = len(served.received)
    served.run(0.2)
    assert (len(served.received) - before) * BLOCK_BYTES / 0.2 < GENTLE_DOWNLOAD_BYTES_S * 1.1
    assert served.finished(future) == content(2_000_000)[:200_000]
    assert opcodes(served).count(Opcode.BURST_READ_FILE) == 2  # the second one is what ends the first


def test_no_more_blocks_are_requested_at_once_than_an_autopilot_queues() -> None:
    served = Served(is_px4=False)
    served.is_armed = True
    served.store.files = {LOG: content(50_000)}
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 50_000))
    while not future.done():
        before = len(served.store.requests)
        served.step()
        assert len(served.store.requests) - before <= WINDOW_BLOCKS


def test_the_file_stays_open_for_the_next_part_and_is_closed_after_that(served: Served) -> None:
    served.store.files = {LOG: content(100_000)}
    for offset in range(0, 100_000, 10_000):
        assert served.done(served.ftp.read(LOG, offset, 10_000)) == content(100_000)[offset : offset + 10_000]
    assert opcodes(served).count(Opcode.OPEN_FILE_RO) == 1
    served.run(IDLE_FILE_S + 0.5)
    assert not served.store.is_open
    assert opcodes(served).count(Opcode.TERMINATE_SESSION) == 1


def test_a_burst_goes_on_between_two_parts(served: Served) -> None:
    served.store.files = {LOG: content(300_000)}
    began_s = served.now_s
    for offset in range(0, 300_000, 30_000):
        assert served.done(served.ftp.read(LOG, offset, 30_000)) == content(300_000)[offset : offset + 30_000]
        served.run(0.05)
    assert served.now_s - began_s < 4.5  # 2.5 s at the rate of the server, and 0.5 s of pauses


def test_another_file_is_opened_after_the_first_is_closed(served: Served) -> None:
    served.store.files = {"/a": content(1000, 1), "/b": content(1000, 2)}
    for name, seed in (("/a", 1), ("/b", 2), ("/a", 1)):
        assert served.done(served.ftp.read(name, 0, 1000)) == content(1000, seed)


def test_late_answers_of_another_file_are_not_taken_for_it() -> None:
    served = Served(late=1.0, seed=3)
    served.store.files = {"/a": content(20_000, 1), "/b": content(20_000, 2)}
    for count in range(6):
        name, seed = (("/a", 1), ("/b", 2))[count % 2]
        assert served.done(served.ftp.read(name, 0, 20_000)) == content(20_000, seed)


def test_what_another_program_has_left_open_is_waited_for(served: Served) -> None:
    served.store.files = {"/a": b"abc", "/theirs": b"def"}
    left_open = FtpPacket(7, 3, Opcode.OPEN_FILE_RO, 7, data=b"/theirs").encode()
    handle = served.store.handlers()[mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL]
    handle(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, left_open), served._sender, served.now_s)
    served.step()
    began_s = served.now_s
    assert served.done(served.ftp.read("/a", 0, 3)) == b"abc"
    assert served.now_s - began_s > 2.0


def test_a_file_that_the_autopilot_closes_is_opened_again() -> None:
    served = Served()
    served.store.files = {LOG: content(100_000)}
    assert served.done(served.ftp.read(LOG, 0, 10_000)) == content(100_000)[:10_000]
    served.store._path = None
    assert served.done(served.ftp.read(LOG, 40_000, 60_000)) == content(100_000)[40_000:]


def test_a_file_that_ends_before_its_size_gives_what_is_there(served: Served) -> None:
    served.store.files = {LOG: content(50_000)}
    served.done(served.ftp.read(LOG, 0, 1000))
    served.store.files[LOG] = content(50_000)[:20_000]
    served.store._size = 20_000
    served.run(5.0)
    assert served.done(served.ftp.read(LOG, 0, 50_000)) == content(50_000)[:20_000]


def test_silence_ends_what_is_requested(served: Served) -> None:
    served.store.has_ftp = False
    with pytest.raises(UalTimeoutError, match=f"not answered in {TRIES_COUNT} tries"):
        served.done(served.ftp.list_directory("/log"), 30.0)
    served.is_up = False
    with pytest.raises(LinkLostError, match="nothing comes from the autopilot"):
        served.done(served.ftp.list_directory("/log"), 30.0)


def test_silence_in_a_file_ends_its_reading(served: Served) -> None:
    served.store.files = {LOG: content(100_000)}
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 100_000))
    served.run(0.1)
    served.store.has_ftp = False
    served.spoil = lambda _: None
    served.run(PROGRESS_TIMEOUT_S + 1.0)
    assert isinstance(error_of(future), UalTimeoutError)


def test_the_errno_of_a_refusal_is_reported_in_words() -> None:
    packet = FtpPacket(0, 0, Opcode.NAK, 2, Opcode.OPEN_FILE_RO, data=bytes((Nak.FAIL_ERRNO, errno.EIO)))
    assert "EIO" in FtpNakError("/a", packet).message
    unknown = FtpPacket(0, 0, Opcode.NAK, 1, Opcode.OPEN_FILE_RO, data=b"\x63")
    assert "error 99" in FtpNakError("/a", unknown).message
    assert isinstance(FtpNakError("/a", unknown), RejectedByAutopilotError)


def test_a_boot_ends_what_is_in_progress_and_forgets_the_file(served: Served) -> None:
    served.store.files = {LOG: content(100_000)}
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 100_000))
    served.run(0.05)
    served.ftp.drop("the autopilot has booted")
    assert isinstance(error_of(future), LinkLostError)
    served.store._path = None
    assert served.done(served.ftp.read(LOG, 0, 10)) == content(100_000)[:10]
    served.ftp.attach(MessageSource(2, 1), Px4())


def test_what_is_abandoned_lets_the_next_one_begin(served: Served) -> None:
    served.store.files = {LOG: content(1_000_000), "/b": b"b"}
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 1_000_000))
    served.run(0.05)
    future.cancel()
    assert served.done(served.ftp.read("/b", 0, 1)) == b"b"


def test_a_defect_of_one_exchange_ends_that_one_only(served: Served) -> None:
    def defective() -> Steps[int]:
        yield from served.ftp.list_directory("/log")
        raise ZeroDivisionError

    served.store.files = {"/log/a.ulg": b"a"}
    with pytest.raises(ZeroDivisionError):
        served.done(defective())
    assert served.done(served.ftp.list_directory("/log")) == [DirectoryEntry("a.ulg", 1)]


def test_too_many_do_not_wait(served: Served) -> None:
    waiting: list[Future[Any]] = [Future() for _ in range(MOST_WAITING_READS + 1)]
    for each in waiting:
        served.ftp.run(each, served.ftp.list_directory("/log"))
    assert isinstance(error_of(waiting[-1]), ResourceExhaustedError)
    assert not waiting[0].done()


def test_names_that_no_file_should_have_are_left_out() -> None:
    served = Served()
    names = ["good.ulg", "bad\x01.ulg", "tab\tname\t7", ".."]
    served.store.files = {f"/log/{name}": b"x" for name in names}
    assert served.done(served.ftp.list_directory("/log")) == [DirectoryEntry("good.ulg", 1)]


def test_a_directory_without_an_end_is_refused() -> None:
    served = Served()
    answer = FtpPacket(0, 0, Opcode.ACK, BLOCK_BYTES, Opcode.LIST_DIRECTORY, data=b"F\0" * 119)

    def again(message: Any) -> Any:
        sequence = decode(bytes(message.payload))
        assert sequence is not None
        payload = answer._replace(sequence=sequence.sequence).encode()
        return mavlink.MAVLink_file_transfer_protocol_message(0, *HERE, payload)

    served.spoil = again
    with pytest.raises(NotSupportedError, match="has no end"):
        served.done(served.ftp.list_directory("/log"))


@pytest.mark.parametrize("seed", range(2))
def test_whatever_is_answered_each_exchange_ends_and_nothing_grows(seed: int) -> None:
    noise = random.Random(seed)
    served = Served(is_px4=bool(seed % 2), loss=0.1, doubled=0.1, late=0.1, seed=seed)
    served.store.files = {LOG: content(60_000), "/b": content(5_000)}

    def spoilt(message: Any) -> Any:
        kind = noise.random()
        if kind < 0.6:
            return message
        payload = bytearray(bytes(message.payload))
        for _ in range(noise.choice((1, 2, 50)) if kind < 0.9 else 251):
            payload[noise.randrange(251)] = noise.randrange(256)
        return mavlink.MAVLink_file_transfer_protocol_message(0, *HERE, bytes(payload))

    served.spoil = spoilt
    ended_count = 0
    while len(served.received) < FUZZ_COUNT // 2:
        made: list[Future[Any]] = [Future() for _ in range(3)]
        for future, steps in zip(
            made,
            (served.ftp.list_directory("/"), served.ftp.read(LOG, 0, 60_000), served.ftp.read_all("/b", 9000)),
            strict=True,
        ):
            served.ftp.run(future, steps)
        for _ in range(60_000):
            if all(each.done() for each in made):
                break
            served.step()
            served.is_armed = noise.random() < 0.3
            file = served.ftp._file
            assert file is None or len(file.blocks) <= MOST_BLOCKS + 1
        assert all(each.done() for each in made)
        ended_count += len(made)
    assert ended_count


# --- The end of the daemon --------------------------------------------------------------------------------------------


BURST_S = 2.0
"""Longer than a burst of ArduPilot, which does one thing after the other."""


def end(served: Served) -> None:
    """Ends the daemon."""
    for each in (served.ftp, served.logs):
        each.release()
        each.drop("the daemon ends")
    served.run(BURST_S)


@pytest.mark.parametrize("is_read", [False, True])
def test_a_daemon_that_ends_closes_its_file(served: Served, is_read: bool) -> None:
    served.store.files = {LOG: content(1_000_000)}
    if is_read:
        served.done(served.ftp.read(LOG, 0, 10_000))
    else:
        served.ftp.run(Future(), served.ftp.read(LOG, 0, 1_000_000))
        served.run(0.1)
    assert served.store.is_open
    end(served)
    assert not served.store.is_open
    assert opcodes(served).count(Opcode.TERMINATE_SESSION) == 1


@pytest.mark.parametrize("is_given_up", [False, True])
def test_a_file_whose_opening_is_not_answered_is_closed(served: Served, is_given_up: bool) -> None:
    served.store.files = {LOG: content(1000)}
    served.spoil = lambda _: None
    future: Future[bytes] = Future()
    served.ftp.run(future, served.ftp.read(LOG, 0, 1000))
    served.run(0.1)
    assert served.store.is_open
    if is_given_up:
        future.cancel()
        served.run(IDLE_FILE_S + 0.5)
    else:
        end(served)
    assert not served.store.is_open


def test_a_daemon_that_ends_without_a_file_closes_none(served: Served) -> None:
    served.store.files = {LOG: content(1000)}
    served.done(served.ftp.read_all(LOG, 10_000))
    served.done(served.ftp.list_directory(LOG.rpartition("/")[0]))
    before = opcodes(served)
    end(served)
    assert opcodes(served) == before
