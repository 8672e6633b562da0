"""Stamps that are none are refused at the door, in every request that has one, and end no thread behind it."""

from __future__ import annotations

import importlib
import json
import pkgutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import grpc
import pytest
from click.testing import CliRunner
from google.protobuf import message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor, MethodDescriptor
from google.protobuf.message import Message

import ual.v1
from tests.conftest import StartDaemon
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors
from ual_daemon.program.recording.audit import changes
from ual_daemon.server.door import paths_to_times, require_times
from ual_tools.main import cli

HOSTILE = ((1 << 63) - 1, 0), (-(1 << 63), 0), (253_402_300_800, 0), (-62_135_596_801, 0), (0, -1), (0, 1_000_000_000)
"""Seconds and nanoseconds that no time between the years 1 and 9999 has."""


def methods() -> Iterator[MethodDescriptor]:
    for module in pkgutil.iter_modules(ual.v1.__path__, "ual.v1."):
        if module.name.endswith("_pb2"):
            for service in importlib.import_module(module.name).DESCRIPTOR.services_by_name.values():
                yield from service.methods


def stamps_of(kind: Descriptor, above: tuple[FieldDescriptor, ...] = ()) -> Iterator[tuple[FieldDescriptor, ...]]:
    """The ways to each time in a message."""
    for field in kind.fields:
        below = field.message_type
        if below is None or below in (each.message_type for each in above):
            continue
        path = (*above, field)
        if below.full_name in ("google.protobuf.Timestamp", "google.protobuf.Duration"):
            yield path
        else:
            yield from stamps_of(below, path)


STAMPED = [(method, path) for method in methods() for path in stamps_of(method.input_type)]
METHODS = {f"/{method.containing_service.full_name}/{method.name}": method for method, _ in STAMPED}


def request_of(method: MethodDescriptor, path: tuple[FieldDescriptor, ...], seconds: int, nanos: int) -> Message:
    """A request in which one time is such a value."""
    request = message_factory.GetMessageClass(method.input_type)()
    part: Any = request
    for field in path:
        part = getattr(part, field.name) if not field.is_repeated else getattr(part, field.name).add()
    part.seconds, part.nanos = seconds, nanos
    return request


def refusal(channel: Any, method: MethodDescriptor, request: Message) -> tuple[grpc.StatusCode, str, str]:
    """Returns the end of a call with a request: the status, the reason, and the field of the refusal."""
    path = f"/{method.containing_service.full_name}/{method.name}"
    ways: dict[tuple[bool, bool], Callable[[], object]] = {
        (False, False): lambda: channel.unary_unary(path)(request.SerializeToString()),
        (True, False): lambda: channel.stream_unary(path)(iter([request.SerializeToString()])),
        (False, True): lambda: list(channel.unary_stream(path)(request.SerializeToString())),
        (True, True): lambda: list(channel.stream_stream(path)(iter([request.SerializeToString()]))),
    }
    with pytest.raises(grpc.RpcError) as caught:
        ways[method.client_streaming, method.server_streaming]()
    error: Any = caught.value
    info = rpc_errors.error_info(error.trailing_metadata() or ())
    return error.code(), "" if info is None else info.reason, "" if info is None else info.metadata["field"]


def test_the_contract_has_requests_with_stamps() -> None:
    assert {"SetPose", "SetVelocity", "StreamSetpoints", "GoToWaypoint", "FollowPath", "SetExternalPose"} <= {
        method.name for method, _ in STAMPED
    }


def test_hostile_stamps_are_refused_and_the_audit_goes_on(start_daemon: StartDaemon, tmp_path: Path) -> None:
    file = tmp_path / "audit.jsonl"
    daemon = start_daemon("--auto-arm", "--audit", str(file), "--record", str(tmp_path))
    channel: Any = daemon.channel()
    sent = 0
    for method, path in STAMPED:
        for seconds, nanos in HOSTILE:
            found = refusal(channel, method, request_of(method, path, seconds, nanos))
            name = ".".join(f"{each.name}[0]" if each.is_repeated else each.name for each in path)
            assert found == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_ARGUMENT", name), method.full_name
            sent += changes(f"/{method.containing_service.full_name}/{method.name}")
    with pytest.raises(grpc.RpcError):
        channel.unary_unary("/ual.v1.UalService/Abort")(pb.AbortRequest().SerializeToString())
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    result = CliRunner().invoke(cli, ["audit", "verify", str(file), "--head", daemon.wait_for("audit_ends")["head"]])
    assert result.exit_code == 0, result.output
    entries = [json.loads(line) for line in file.read_text().splitlines()]
    assert entries[-1]["method"] == "/ual.v1.UalService/Abort"
    assert len([each for each in entries if each.get("method") in METHODS and each["event"] == "ended"]) == sent
    assert not [event for event in daemon.events if event["level"] == "error"]


def test_times_that_are_some_are_accepted() -> None:
    for method, path in STAMPED:
        for seconds, nanos in ((0, 0), (253_402_300_799, 999_999_999), (-62_135_596_800, 0)):
            if path[-1].message_type.name == "Timestamp":
                require_times(request_of(method, path, seconds, nanos), paths_to_times(method.input_type))
