"""The values of parameters, and how they are written."""

from __future__ import annotations

import math
import struct

import hypothesis
import pytest
from hypothesis import strategies

from ual.parameters.values import Parameter, ParameterType, is_same, real32, real32_text
from ual.v1 import parameters_pb2 as pb
from ual.wire import parameters as convert

REAL32 = strategies.floats(width=32, allow_nan=False, allow_infinity=False)


@hypothesis.given(REAL32)
def test_the_text_of_a_number_is_that_number_again(value: float) -> None:
    assert real32(float(real32_text(value))) == value


@pytest.mark.parametrize(("value", "text"), [(0.1, "0.1"), (5.0, "5"), (1.0 / 3.0, "0.333333"), (math.inf, "inf")])
def test_the_text_is_as_short_as_it_can_be(value: float, text: str) -> None:
    assert real32_text(real32(value)).startswith(text)


def test_a_value_by_hand_is_the_same_as_the_number_of_32_bits_that_is_next_to_it() -> None:
    parameter = Parameter("X", struct.unpack("<f", struct.pack("<f", 0.1))[0], ParameterType.REAL32)
    assert parameter.value != 0.1
    assert is_same(parameter, 0.1)
    assert not is_same(parameter, 0.1001)
    assert not is_same(Parameter("I", 3, ParameterType.INT32), 3.1)
    assert not is_same(parameter, 1e300)


@pytest.mark.parametrize("kind", ParameterType)
def test_the_limits_of_each_type_survive_the_wire(kind: ParameterType) -> None:
    for value in kind.limits:
        sent = Parameter("X", value, kind, is_relied_on=True)
        read = convert.parameter_from_proto(
            pb.Parameter.FromString(convert.parameter_to_proto(sent).SerializeToString())
        )
        assert read == sent
        assert isinstance(read.value, int) == kind.is_whole


def test_a_type_of_a_newer_daemon_is_read_as_a_number() -> None:
    assert convert.parameter_from_proto(pb.Parameter(name="X", value=0.5)) == Parameter("X", 0.5, ParameterType.REAL32)
