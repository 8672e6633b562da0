"""Whatever is called: no crash, no traceback, no state that cannot be, and the UAV still lands."""

from __future__ import annotations

import itertools

import grpc

import ual
from tests.conftest import StartDaemon
from tests.ual_daemon.server.fuzzed_calls import METHODS, calls, defects_of, make, storm
from ual.types import State
from ual.v1 import ual_pb2 as pb
from ual.v1 import ual_pb2_grpc as pb_grpc

COUNT = 600


def test_calls_are_the_same_for_the_same_seed_and_get_to_every_method() -> None:
    some = list(itertools.islice(calls(1), COUNT))
    assert some == list(itertools.islice(calls(1), COUNT))
    assert {call.method.rsplit("/", 1)[-1] for call in itertools.islice(calls(1), 10_000)} >= set(METHODS)


def test_no_call_breaks_the_daemon_or_the_flight(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--auto-arm")
    with ual.Uav(address=daemon.address) as uav, grpc.insecure_channel(daemon.address) as channel:
        uav.wait_for(State.LANDED_ARMED)
        uav.take_off(5.0)
        stub = pb_grpc.UalServiceStub(channel)
        for number, call in enumerate(itertools.islice(calls(2), COUNT)):
            make(channel, call)
            if number % 20 == 0:
                assert defects_of(stub.GetTelemetry(pb.GetTelemetryRequest()).telemetry) == []
        found = storm(daemon.address, 50, 3)
        assert found["UNIMPLEMENTED"] + found["INVALID_ARGUMENT"] + found["INTERNAL"] > 10
        if uav.wait_for(State.FLYING_AUTO, State.LANDED_ARMED, State.LANDED_DISARMED) is State.FLYING_AUTO:
            uav.land()
    assert [event for event in daemon.events if "Traceback" in str(event) or event.get("level") == "error"] == []
