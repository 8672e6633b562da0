"""Choice of the transport; and a core that is broken, in whatever way, does not keep the daemon from serving."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
from pathlib import Path

import pytest
from grpc._cython import cygrpc

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon, daemon_environment
from tests.ual_daemon.server.transport.broken_core import Binding
from ual_daemon.server import transport as package
from ual_daemon.server.transport import core, selection, self_test
from ual_daemon.server.transport.selection import Choice


def chosen(choice: Choice) -> str:
    async def run() -> str:
        transport = await selection.choose(choice)
        transport.close()
        return transport.name

    return asyncio.run(run())


@pytest.mark.parametrize(("choice", "name"), [("auto", "core"), ("core", "core"), ("aio", "aio")])
def test_the_core_is_chosen_where_it_works(
    choice: Choice, name: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(self_test, "TEST_TIMEOUT_S", LIMIT_S)
    threads = set(threading.enumerate())
    assert chosen(choice) == name
    assert not caplog.records
    assert set(threading.enumerate()) <= threads


def test_a_caller_that_was_gone_before_its_answer_is_no_error(caplog: pytest.LogCaptureFixture) -> None:
    chosen("aio")
    for level in (logging.INFO, logging.DEBUG):
        caplog.set_level(level)
        binding = logging.getLogger("grpc._cython.cygrpc")
        binding.error(
            "raised in core by servicer method [%s]", "/a.B/C", exc_info=cygrpc.ExecuteBatchError("no status")
        )
    (record,) = caplog.records
    assert (record.levelno, record.exc_info) == (logging.DEBUG, None)
    assert record.getMessage() == "a caller was gone before its answer"


def of_other_arguments() -> None:
    """Stands for what has another signature."""


class DeafServer(cygrpc.Server):  # type: ignore[misc]
    """Hands over no call."""

    def request_call(self, *arguments: object) -> None:
        pass


class CrashingServer(cygrpc.Server):  # type: ignore[misc]
    def request_call(self, *arguments: object) -> None:
        raise RuntimeError("a crash")


class CrashingQueue(cygrpc.CompletionQueue):  # type: ignore[misc]
    def poll(self, *arguments: object) -> object:
        super().poll(*arguments)
        raise RuntimeError("a crash")


class DeafToCancels(cygrpc.ReceiveCloseOnServerOperation):  # type: ignore[misc]
    def cancelled(self) -> bool:
        return False


def send_another_message(_: bytes, flags: int) -> object:
    return cygrpc.SendMessageOperation(b"other", flags)


def send_no_message(_: bytes, flags: int) -> object:
    return cygrpc.SendInitialMetadataOperation((), flags)


def send_another_status(metadata: object, _: int, details: bytes, flags: int) -> object:
    return cygrpc.SendStatusFromServerOperation(metadata, 0, details, flags)


def send_no_metadata(_: object, code: int, details: bytes, flags: int) -> object:
    return cygrpc.SendStatusFromServerOperation((), code, details, flags)


OPERATIONS = (
    "ReceiveCloseOnServerOperation",
    "ReceiveMessageOperation",
    "SendInitialMetadataOperation",
    "SendMessageOperation",
    "SendStatusFromServerOperation",
)
USED = ("CallError", "CompletionQueue", "CompletionType", "Server", *OPERATIONS)


@pytest.mark.parametrize(
    ("binding", "why"),
    [
        *((Binding(name), f"AttributeError: no {name} any more") for name in USED),
        *((Binding(**{name: of_other_arguments}), "TypeError: of_other_arguments() takes 0") for name in OPERATIONS),
        (Binding(Server=of_other_arguments), "TypeError: of_other_arguments() takes 0"),
        (Binding(CompletionQueue=of_other_arguments), "AttributeError: 'NoneType' object has no"),
        (Binding(Server=CrashingServer), "RuntimeError: a crash"),
        (Binding(CompletionQueue=CrashingQueue), "RuntimeError: a crash"),
        (Binding(SendMessageOperation=send_another_message), "SelfTestError: a unary call has another answer"),
        (Binding(SendMessageOperation=send_no_message), "RuntimeError: /ual.SelfTest/Echo: its end cannot be sent"),
        (Binding(SendStatusFromServerOperation=send_another_status), "SelfTestError: an error does not come"),
        (Binding(SendStatusFromServerOperation=send_no_metadata), "SelfTestError: an error lacks its metadata"),
    ],
    ids=str,
)
def test_a_broken_core_is_not_used_and_one_message_says_why(
    binding: Binding, why: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(self_test, "TEST_TIMEOUT_S", LIMIT_S)
    assert why_not(binding, monkeypatch, caplog).startswith(why)


@pytest.mark.parametrize(
    ("binding", "why"),
    [
        (Binding(Server=DeafServer), "SelfTestError: a call ends with DEADLINE_EXCEEDED"),
        (Binding(ReceiveCloseOnServerOperation=DeafToCancels), "SelfTestError: a call that is cancelled goes on"),
    ],
    ids=str,
)
def test_a_core_that_does_not_answer_is_waited_for_in_vain_only_for_a_while(
    binding: Binding, why: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert why_not(binding, monkeypatch, caplog).startswith(why)


def why_not(binding: Binding, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> str:
    """Why the core is not chosen, by the one line in the log."""
    monkeypatch.setattr(core, "cygrpc", binding)
    monkeypatch.setattr(self_test, "ABANDON_S", 0.1)
    assert chosen("auto") == "aio"
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    fields = vars(record)["ual_fields"]
    assert fields["transport"] == "aio"
    why = str(fields["why"])
    assert "\n" not in why
    return why


def test_a_binding_that_is_gone_is_not_used(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("core", "self_test"):
        monkeypatch.delattr(package, name)
        monkeypatch.delitem(sys.modules, f"{package.__name__}.{name}")
    monkeypatch.setitem(sys.modules, "grpc._cython.cygrpc", None)
    assert chosen("auto") == "aio"
    (record,) = caplog.records
    assert vars(record)["ual_fields"]["why"].startswith(("ImportError: ", "ModuleNotFoundError: "))


def test_a_daemon_whose_core_is_broken_flies(runtime_dir: Path) -> None:
    daemon = DaemonProcess(
        ("--listen", "127.0.0.1:0", "--auto-arm", "--set", "light.speed_factor=10"),
        "uav_1",
        daemon_environment(runtime_dir),
        "tests.ual_daemon.server.transport.broken_core",
    )
    try:
        assert daemon.wait_for("listening")["transport"] == "aio"
        warned = daemon.wait_for("transport_fallback")
        assert (warned["level"], warned["why"]) == ("warning", "AttributeError: no SendMessageOperation any more")
        daemon.wait_for("state", new="LANDED_ARMED")
        with ual.Uav(address=daemon.address) as uav:
            uav.take_off(2.0)
            assert uav.telemetry().pose is not None
    finally:
        daemon.close()


def test_a_daemon_says_on_which_transport_it_serves(start_daemon: StartDaemon, transport: Choice) -> None:
    assert start_daemon().wait_for("listening")["transport"] == transport
