"""Errors pass between processes, as pools, Celery and ROS' executors hand them on."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from ual import errors
from ual.errors import UalError
from ual.types import State, TaskInfo, TaskKind, TaskStatus, Telemetry

KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, UalError)]


def pickled(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


def made(kind: type[UalError]) -> UalError:
    if kind is errors.TeamError:
        return errors.TeamError({"uav_1": errors.WrongStateError("it flies", {"state": "FLYING_AUTO"})}, {"uav_2": 1})
    return kind("it flies", {"state": "FLYING_AUTO"})


@pytest.mark.parametrize("passed", [pickled, copy.copy, copy.deepcopy])
@pytest.mark.parametrize("kind", KINDS)
def test_an_error_keeps_all_that_it_says(kind: type[UalError], passed: Callable[[Any], Any]) -> None:
    error = made(kind)
    got = passed(error)
    assert type(got) is kind
    assert (got.message, str(got), got.reason, dict(got.metadata)) == (
        error.message,
        str(error),
        error.reason,
        dict(error.metadata),
    )


def test_an_error_of_a_team_keeps_those_of_its_uavs() -> None:
    got = pickled(made(errors.TeamError))
    assert got.results == {"uav_2": 1}
    assert got.errors["uav_1"].state == "FLYING_AUTO"


def test_notes_stay_with_an_error() -> None:
    error = made(errors.GeofenceError)
    vars(error)["__notes__"] = ["of waypoint 3"]  # what add_note of Python 3.11 does
    assert pickled(error).__notes__ == ["of waypoint 3"]


def test_telemetry_whose_task_has_failed_can_be_pickled() -> None:
    task = TaskInfo("1", TaskKind.LAND, TaskStatus.FAILED, error=errors.LinkLostError("no data"))
    got = pickled(Telemetry(State.LANDING, task=task))
    assert got.task.error.message == "no data"
