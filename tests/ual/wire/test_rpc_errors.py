"""Errors over a real gRPC server, so that what the library does to them is in the test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NoReturn

import grpc
import pytest

from ual import discovery, errors
from ual.discovery import Registration
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc as pb_grpc
from ual.wire import rpc_errors

CODES = {
    errors.WrongStateError: grpc.StatusCode.FAILED_PRECONDITION,
    errors.FrameLostError: grpc.StatusCode.FAILED_PRECONDITION,
    errors.InvalidArgumentError: grpc.StatusCode.INVALID_ARGUMENT,
    errors.UnknownFrameError: grpc.StatusCode.INVALID_ARGUMENT,
    errors.GeofenceError: grpc.StatusCode.FAILED_PRECONDITION,
    errors.TaskAbortedError: grpc.StatusCode.ABORTED,
    errors.RejectedByAutopilotError: grpc.StatusCode.FAILED_PRECONDITION,
    errors.LinkLostError: grpc.StatusCode.UNAVAILABLE,
    errors.UalTimeoutError: grpc.StatusCode.DEADLINE_EXCEEDED,
    errors.NotSupportedError: grpc.StatusCode.UNIMPLEMENTED,
    errors.ResourceExhaustedError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    errors.UnauthenticatedError: grpc.StatusCode.UNAUTHENTICATED,
    errors.PermissionDeniedError: grpc.StatusCode.PERMISSION_DENIED,
    errors.UalError: grpc.StatusCode.INTERNAL,
}


class Failing(pb_grpc.UalServiceServicer):
    """Fails GetInfo as it is told; has no other method."""

    def __init__(self) -> None:
        self.fail: Callable[[grpc.ServicerContext], NoReturn]

    def GetInfo(self, _: pb.GetInfoRequest, context: grpc.ServicerContext) -> pb.GetInfoResponse:  # noqa: N802
        self.fail(context)


@pytest.fixture(scope="module")
def failing() -> Iterator[tuple[Failing, pb_grpc.UalServiceStub]]:
    servicer = Failing()  # type: ignore[abstract]
    with ThreadPoolExecutor(2) as pool:
        server = grpc.server(pool)
        pb_grpc.add_UalServiceServicer_to_server(servicer, server)
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
            yield servicer, pb_grpc.UalServiceStub(channel)
        server.stop(None).wait()


def call(stub: pb_grpc.UalServiceStub) -> errors.UalError:
    with pytest.raises(grpc.RpcError) as caught:
        stub.GetInfo(pb.GetInfoRequest(), timeout=30.0)
    return rpc_errors.from_rpc_error(caught.value, address="127.0.0.1:50051", ns="uav_1")


@pytest.mark.parametrize(("kind", "code"), CODES.items())
def test_every_error_arrives_as_it_was_raised(
    failing: tuple[Failing, pb_grpc.UalServiceStub], kind: type[errors.UalError], code: grpc.StatusCode
) -> None:
    servicer, stub = failing
    sent = kind("needs FLYING_AUTO, is LANDED: 5° off", {"state": "LANDED_ARMED", "needed": "FLYING_AUTO"})
    assert rpc_errors.status_code(sent) is code
    servicer.fail = lambda context: context.abort_with_status(rpc_errors.to_grpc_status(sent))
    received = call(stub)
    assert type(received) is kind
    assert (received.message, dict(received.metadata)) == (sent.message, dict(sent.metadata))
    assert received.state == "LANDED_ARMED"


def test_an_error_with_the_name_of_a_file_that_is_no_text_can_be_sent() -> None:
    """A call whose error could not be sent was never answered."""
    sent = rpc_errors.to_status(errors.UalError("no caf\udce9", {"file": "caf\udce9"}))
    assert sent.message == "no caf?"


def test_a_long_error_is_shortened_to_what_a_call_can_carry(
    failing: tuple[Failing, pb_grpc.UalServiceStub],
) -> None:
    servicer, stub = failing
    known = ", ".join(f"uav_1/früme_{i}" for i in range(2000))
    sent = errors.UnknownFrameError(f"frame_id: 'x' is none of {known}", {"known": known, "field": "frame_id"})
    servicer.fail = lambda context: context.abort_with_status(rpc_errors.to_grpc_status(sent))
    received = call(stub)
    assert type(received) is errors.UnknownFrameError
    assert received.message.startswith("frame_id: 'x' is none of uav_1/früme_0")
    assert received.message.endswith("...")
    assert received.metadata["field"] == "frame_id"


def test_a_reason_of_a_newer_daemon_is_a_plain_error(failing: tuple[Failing, pb_grpc.UalServiceStub]) -> None:
    class NewerError(errors.UalError):
        reason = "VOLCANO"

    servicer, stub = failing
    servicer.fail = lambda context: context.abort_with_status(rpc_errors.to_grpc_status(NewerError("ash")))
    assert type(call(stub)) is errors.UalError


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (grpc.StatusCode.DEADLINE_EXCEEDED, errors.UalTimeoutError),
        (grpc.StatusCode.UNAVAILABLE, errors.DaemonUnreachableError),
        (grpc.StatusCode.UNIMPLEMENTED, errors.NotSupportedError),
        (grpc.StatusCode.UNAUTHENTICATED, errors.UnauthenticatedError),
        (grpc.StatusCode.PERMISSION_DENIED, errors.PermissionDeniedError),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, errors.ResourceExhaustedError),
        (grpc.StatusCode.CANCELLED, errors.UalError),
    ],
)
def test_a_bare_code_says_what_it_can(
    failing: tuple[Failing, pb_grpc.UalServiceStub], code: grpc.StatusCode, kind: type[errors.UalError]
) -> None:
    servicer, stub = failing
    servicer.fail = lambda context: context.abort(code, "in the server's words")
    received = call(stub)
    assert type(received) is kind
    assert received.metadata.get("grpc_code", code.name) == code.name
    if code is grpc.StatusCode.RESOURCE_EXHAUSTED:
        assert received.message == "RESOURCE_EXHAUSTED: in the server's words"


def test_a_method_that_the_daemon_lacks_is_not_supported(failing: tuple[Failing, pb_grpc.UalServiceStub]) -> None:
    _, stub = failing
    with pytest.raises(grpc.RpcError) as caught:
        stub.Arm(pb.ArmRequest(), timeout=30.0)
    assert type(rpc_errors.from_rpc_error(caught.value)) is errors.NotSupportedError


def test_a_uav_that_is_not_simulated_says_so(failing: tuple[Failing, pb_grpc.UalServiceStub]) -> None:
    servicer, stub = failing
    words = "Method not found: /ual.v1.SimulationService/PilotArm"
    servicer.fail = lambda context: context.abort(grpc.StatusCode.UNIMPLEMENTED, words)
    assert "flies no simulation of UAL" in call(stub).message


def test_details_that_are_no_status_are_ignored(failing: tuple[Failing, pb_grpc.UalServiceStub]) -> None:
    servicer, stub = failing

    def fail(context: grpc.ServicerContext) -> NoReturn:
        context.set_trailing_metadata(((rpc_errors.DETAILS_KEY, b"\xff\xff"),))
        context.abort(grpc.StatusCode.DATA_LOSS, "broken")

    servicer.fail = fail
    assert call(stub).message == "DATA_LOSS: broken"


def test_nobody_there_says_where_and_what_to_do() -> None:
    with grpc.insecure_channel("127.0.0.1:1") as channel:
        with pytest.raises(grpc.RpcError) as caught:
            pb_grpc.UalServiceStub(channel).GetInfo(pb.GetInfoRequest(), timeout=30.0)
        error = rpc_errors.from_rpc_error(caught.value, address="127.0.0.1:1", ns="uav_7")
    assert type(error) is errors.DaemonUnreachableError
    assert isinstance(error, ConnectionError)
    assert "\n" not in error.message
    for part in ("uav_7", "127.0.0.1:1", "Connection refused", "see whether the daemon", "UAL_ADDRESS"):
        assert part in error.message


@pytest.mark.parametrize(
    ("details", "says"),
    [
        (
            "failed to connect to all addresses; last error: UNAVAILABLE: ipv4:127.0.0.1:1: Socket closed",
            "it may use TLS, which needs --tls-ca",
        ),
        (
            "failed to connect to all addresses; last error: UNKNOWN: Tls handshake failed: WRONG_VERSION_NUMBER",
            "it does not use TLS",
        ),
        (
            "failed to connect to all addresses; last error: UNKNOWN: Tls handshake failed: CERTIFICATE_VERIFY_FAILED",
            "its certificate is not one that --tls-ca trusts",
        ),
        (
            "failed to connect to all addresses; last error: ipv4:1.2.3.4:1: Hostname Verification Check failed.",
            "its certificate is for another host name",
        ),
        (
            "failed to connect to all addresses; last error: UNKNOWN: Failed to create security handshaker.",
            "--tls-ca, --tls-certificate or --tls-key has no certificate",
        ),
        (
            "errors resolving host:1: [field:hostname lookup error:lookup failed for host:1: Domain name not found]",
            "no UAL daemon answers at host:1 (Domain name not found)",
        ),
        (
            "DNS resolution failed for host:1: C-ares status is not ARES_SUCCESS name=host: Domain name not found",
            "no UAL daemon answers at host:1 (Domain name not found)",
        ),
        (
            "Stream removed (Socket closed)",
            "the connection to the UAL daemon at host:1 was lost (Stream removed (Socket closed))",
        ),
        ("", "(no answer): see whether the daemon, or the gateway to it, runs there"),
    ],
)
def test_why_nobody_answers_is_reported_in_plain_words(details: str, says: str) -> None:
    assert says in rpc_errors.unreachable("host:1", "", details).message


def test_where_a_daemon_is_expected_it_is_reported_how_to_start_it() -> None:
    """Behind a gateway that has ended, a daemon more would help nobody."""
    assert "start one with `ual-daemon --ns uav_7`" in rpc_errors.unreachable("127.0.0.1:50057", "uav_7").message
    assert "start one with `ual-daemon`" in rpc_errors.unreachable("127.0.0.1:50051", "").message
    gateway = rpc_errors.unreachable("127.0.0.1:50050", "uav_7").message
    assert "see whether the daemon, or the gateway to it, runs there" in gateway
    assert "start one" not in gateway


def test_a_wrong_name_is_reported_with_the_names_that_run(monkeypatch: pytest.MonkeyPatch) -> None:
    running = [Registration(f"uav_{i}", 1, f"127.0.0.1:{50050 + i}", "light", 0.0) for i in range(1, 9)]
    monkeypatch.setattr(discovery, "list_daemons", lambda: running[:2])
    assert "; uav_1, uav_2 run here: see whether" in rpc_errors.unreachable("127.0.0.1:1", "uva_1").message
    assert "run here" not in rpc_errors.unreachable("127.0.0.1:1", "uav_1").message
    monkeypatch.setattr(discovery, "list_daemons", lambda: running)
    monkeypatch.setattr(discovery, "list_daemons", lambda: running[:1])
    assert "; uav_1 runs here: see whether" in rpc_errors.unreachable("127.0.0.1:1", "uva_1").message
    monkeypatch.setattr(discovery, "list_daemons", lambda: running)
    assert "uav_6 and 2 others run here" in rpc_errors.unreachable("127.0.0.1:1", "uva_1").message
