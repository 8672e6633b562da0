"""Calls that no sane caller makes: wild values, damaged bytes, random bytes, wrong methods, wild metadata.

`python -m benchmarks.fuzz --calls 100000` makes more of them than the test does. They are the same for the same seed.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import grpc
from google.protobuf import message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor, MethodDescriptor
from google.protobuf.message import Message

from ual.v1 import ual_pb2 as pb

_SERVICE = "/ual.v1.UalService/"
METHODS: dict[str, MethodDescriptor] = {
    name: method
    for name, method in pb.DESCRIPTOR.services_by_name["UalService"].methods_by_name.items()
    if name != "AcquireLease"  # its holder would keep out the check of the flight
}
_RARE = ("Land", "RecoverFromManual", "SetHome")
_RARE_SHARE = 0.02
"""These end a flight, or move what it is measured by; so they come now and then only."""
_FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 3.0, 5.0, 90.0, 1e-300, 1e9, -1e9, 1e308, math.nan, math.inf, -math.inf)
_INTEGERS = (0, 1, 2, 3, 255, (1 << 31) - 1)
_TEXTS = ("", "map", "uav_1/odom", "uav_1/base_link", "nowhere", "uav_1/f0", "uav_1/f1", "x" * 5000, "\0", "ä/\u202e")
_NUMBERS = (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT)
_WAYPOINTS = (0, 1, 1, 2, 3, 300)
_LIMITS_S = (0.001, 0.05, 0.3, 2.0)
_FLOOR_M, _CEILING_M = -1.0, 125.0
"""Heights in metres to which no command may lead, with noise and overshoot."""


class FuzzedCall(NamedTuple):
    """One call."""

    method: str
    request: bytes
    metadata: tuple[tuple[str, str | bytes], ...]
    limit_s: float
    is_stream: bool


def calls(seed: int) -> Iterator[FuzzedCall]:
    """Yields calls without an end."""
    noise = random.Random(seed)
    kinds: tuple[Callable[[random.Random, str], bytes], ...] = (_wild, _wild, _wild, _damaged, _random)
    while True:
        name = _name(noise)
        request = noise.choice(kinds)(noise, name)
        is_stream = name in METHODS and METHODS[name].server_streaming
        full = _SERVICE + name if name in METHODS else noise.choice((_SERVICE + name, name, "/" + name))
        yield FuzzedCall(full, request, _metadata(noise), noise.choice(_LIMITS_S), is_stream)


def make(channel: grpc.Channel, call: FuzzedCall) -> str:
    """Makes a call. Returns the name of the status that it ended with."""
    try:
        if call.is_stream:
            stream = channel.unary_stream(call.method, _same, _same)
            answers = stream(call.request, timeout=call.limit_s, metadata=call.metadata)
            next(answers, None)
            answers.cancel()
        else:
            unary = channel.unary_unary(call.method, _same, _same)
            unary(call.request, timeout=call.limit_s, metadata=call.metadata)
    except grpc.RpcError as error:
        code: grpc.StatusCode = error.code()
        return code.name
    return "OK"


def storm(address: str, count: int, seed: int) -> Counter[str]:
    """Makes so many calls, one after the other, on a channel of its own. Returns how many ended with each status."""
    found: Counter[str] = Counter()
    with grpc.insecure_channel(address, options=[("grpc.use_local_subchannel_pool", 1)]) as channel:
        for _, call in zip(range(count), calls(seed), strict=False):
            found[make(channel, call)] += 1
    return found


def defects_of(telemetry: pb.Telemetry) -> list[str]:
    """Returns what cannot be in the telemetry of a UAV, whatever was called."""
    place, speed = telemetry.odometry.pose.position, telemetry.velocity.linear
    numbers = (place.x, place.y, place.z, speed.x, speed.y, speed.z)
    found = []
    if telemetry.state in (pb.STATE_UNSPECIFIED, pb.STATE_UNINITIALIZED):
        found.append(f"its state is {pb.State.Name(telemetry.state)}: {telemetry.state_reason}")
    if not all(map(math.isfinite, numbers)):
        found.append(f"it is at {numbers}")
    elif not _FLOOR_M <= place.z <= _CEILING_M:
        found.append(f"its height is {place.z:.2f} m")
    return found


def _name(noise: random.Random) -> str:
    if noise.random() < 0.03:
        return noise.choice(("NoSuchMethod", "", "GetInfo/more", "x" * 3000, "/" * 20))
    name = noise.choice(tuple(METHODS))
    return "GetTelemetry" if name in _RARE and noise.random() > _RARE_SHARE else name


def _wild(noise: random.Random, name: str) -> bytes:
    """A valid message with any values."""
    method = METHODS.get(name, METHODS["GoToWaypoint"])
    return _message(noise, method.input_type, 0).SerializeToString()


def _damaged(noise: random.Random, name: str) -> bytes:
    """A valid message with some bytes changed, left out, or added."""
    data = bytearray(_wild(noise, name))
    for _ in range(noise.randrange(1, 6)):
        at = noise.randrange(len(data) + 1)
        data[at : at + noise.randrange(3)] = noise.randbytes(noise.randrange(3))
    return bytes(data)


def _random(noise: random.Random, _: str) -> bytes:
    return noise.randbytes(noise.choice((0, 1, 10, 300, 20_000)))


def _message(noise: random.Random, kind: Descriptor, depth: int) -> Message:
    message = message_factory.GetMessageClass(kind)()
    for field in kind.fields:
        if noise.random() < 0.2:
            continue
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            continue
        value: Any = getattr(message, field.name)
        if field.is_repeated:
            value.extend(_value(noise, field, depth) for _ in range(noise.choice(_WAYPOINTS)))
        elif field.message_type is not None:
            value.CopyFrom(_value(noise, field, depth))
        else:
            setattr(message, field.name, _value(noise, field, depth))
    return message


def _value(noise: random.Random, field: FieldDescriptor, depth: int) -> Any:
    if field.message_type is not None:
        return _message(noise, field.message_type, depth + 1)
    if field.cpp_type in _NUMBERS:
        return noise.choice((noise.choice(_FLOATS), noise.uniform(-10.0, 10.0)))
    if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        return noise.choice(_TEXTS)
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        return noise.random() < 0.7  # non_blocking, dry_run: most callers go on
    if field.enum_type is not None:
        return noise.choice((0, 1, 2, 3, 99))
    return noise.choice(_INTEGERS)


def _metadata(noise: random.Random) -> tuple[tuple[str, str | bytes], ...]:
    return noise.choice(
        (
            (),
            (),
            (),
            (("ual-ns", "uav_1"),),
            (("ual-ns", "another"),),
            (("ual-ns", "x" * 3000), ("ual-ns", "")),
            (("x-wild-bin", noise.randbytes(50)),),
            tuple((f"x-{number}", "y" * 100) for number in range(30)),
        )
    )


def _same(data: bytes) -> bytes:
    return data
