from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle

import pytest
from hypothesis import given

from tests.strategies import vectors
from ual.geometry import Pose, Transform, Twist, Vector3, vector3
from ual.shared.quick import quick
from ual.types import Battery, GeoPoint, Odometry, TaskInfo, Telemetry


@given(vectors(1e6))
def test_a_vector_of_three_numbers_is_what_its_constructor_makes(vector: Vector3) -> None:
    made = vector3(vector.x, vector.y, vector.z)
    assert type(made) is Vector3
    assert made == vector
    assert hash(made) == hash(vector)
    assert repr(made) == repr(vector)
    assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == vector
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.x = 1.0  # type: ignore[misc]


def test_a_quick_constructor_is_that_of_the_dataclass() -> None:
    @dataclasses.dataclass(frozen=True, slots=True)
    class Value:
        number: int
        parts: list[int] = dataclasses.field(default_factory=list)
        text: str = "none"

    signature = inspect.signature(Value)
    quick(Value)
    assert inspect.signature(Value) == signature
    first, second = Value(1), Value(2, text="some", parts=[3])
    assert (first.number, first.parts, first.text) == (1, [], "none")
    assert (second.number, second.parts, second.text) == (2, [3], "some")
    assert Value(1).parts is not first.parts
    assert dataclasses.replace(second, number=1, parts=[], text="none") == first
    assert copy.deepcopy(second) == second
    with pytest.raises(TypeError, match="number"):
        Value()  # type: ignore[call-arg]
    with pytest.raises(dataclasses.FrozenInstanceError):
        first.number = 2  # type: ignore[misc]


@pytest.mark.parametrize("kind", [Pose, Twist, Transform, Battery, GeoPoint, Odometry, TaskInfo, Telemetry])
def test_each_value_of_a_sample_is_as_a_plain_dataclass_makes_it(kind: type) -> None:
    names = [each.name for each in dataclasses.fields(kind)]
    given_values = {name: float(number) for number, name in enumerate(names)}
    made = kind(**given_values)
    assert {name: getattr(made, name) for name in names} == given_values
    assert kind(*given_values.values()) == made
    assert list(inspect.signature(kind).parameters) == names
