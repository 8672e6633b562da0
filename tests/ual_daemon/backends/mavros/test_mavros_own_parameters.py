"""The parameters as a service, through a simulated MAVROS of each ROS: what is read, written, and what fails."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.ual_daemon.backends.mavros.test_mavros_faults import make
from tests.waiting import until
from ual.errors import InvalidArgumentError, NotSupportedError, RejectedByAutopilotError, UalTimeoutError
from ual.parameters.values import ParameterType, real32
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.offers.parameters import AutopilotParameters


@pytest.fixture(params=[("px4", 1), ("px4", 2), ("ardupilot", 1)], ids=lambda each: f"{each[0]}-{each[1]}")
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    found = make(*request.param)
    found.autopilot.parameters |= {"A_WHOLE": 7, "A_ZERO": 0, "A_REAL": real32(0.1), "A_REAL_ZERO": 0.0}
    return found


@pytest.fixture
def uav(backend: LockstepMavros) -> Iterator[UAL]:
    with UAL(backend) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        yield uav


def test_all_are_listed_as_the_autopilot_has_them(uav: UAL, backend: LockstepMavros) -> None:
    backend.node.server["OF_BEFORE"] = 1.0  # with ROS 1 the parameter server outlives MAVROS, and another autopilot
    parameters = backend.autopilot.parameters
    listed = {each.name: each for each in uav.parameters.get_all()}
    assert {name: each.value for name, each in listed.items()} == {
        name: value if isinstance(value, int) else real32(value) for name, value in parameters.items()
    }
    kinds = {name: each.type for name, each in listed.items()}
    assert (kinds["A_ZERO"], kinds["A_REAL_ZERO"]) == (ParameterType.INT32, ParameterType.REAL32)
    assert any(each.is_relied_on for each in listed.values())
    parameters["A_WHOLE"] = 9  # MAVROS has heard nothing of it
    assert {each.name: each.value for each in uav.parameters.get_all()}["A_WHOLE"] == 9


def test_one_is_read_with_its_type(uav: UAL, backend: LockstepMavros) -> None:
    for name in ("A_WHOLE", "A_ZERO", "A_REAL", "A_REAL_ZERO"):
        found, value = uav.parameters.get(name), backend.autopilot.parameters[name]
        assert found.value == value
        assert found.type.is_whole is isinstance(value, int)


def test_one_that_is_not_there_is_refused_with_what_may_be_meant(uav: UAL) -> None:
    uav.parameters.get_all()
    with pytest.raises(InvalidArgumentError, match="no parameter A_WHOLF; did you mean A_WHOLE"):
        uav.parameters.get("A_WHOLF")


def test_what_is_written_is_what_the_autopilot_has(uav: UAL, backend: LockstepMavros) -> None:
    for name, value in (("A_WHOLE", -3), ("A_WHOLE", 0), ("A_REAL", 2.0), ("A_REAL", 0.0), ("A_ZERO", 16_777_217)):
        if name == "A_ZERO" and not backend.node._is_px4:  # a number in 32 bits
            continue
        assert uav.parameters.set(name, value).value == value
        assert backend.autopilot.parameters[name] == value


def test_one_that_the_autopilot_keeps_as_it_is_is_an_error(uav: UAL, backend: LockstepMavros) -> None:
    backend.autopilot.kept_parameters.add("A_WHOLE")
    with pytest.raises(RejectedByAutopilotError, match="the autopilot keeps 7, not 8"):
        uav.parameters.set("A_WHOLE", 8)


def test_a_plugin_that_is_not_there_is_named(uav: UAL, backend: LockstepMavros) -> None:
    backend.node.denied.add("param")
    with pytest.raises(NotSupportedError, match="/mavros/param/pull: its plugin is on MAVROS' deny list"):
        uav.parameters.get_all()


def test_a_mavros_that_dies_meanwhile_is_reported_and_the_next_one_answers(uav: UAL, backend: LockstepMavros) -> None:
    """ROS 1 tells it at once; with ROS 2 the call is never answered."""
    is_ros2 = backend.node.ros == 2
    backend.node.dies_in = "param/set" if is_ros2 else "param/pull"
    with pytest.raises(UalTimeoutError) as told:
        uav.parameters.set("A_WHOLE", 8) if is_ros2 else uav.parameters.get_all()
    assert "/mavros/param/" in told.value.message
    assert ("it is not known whether A_WHOLE is 8 now" in told.value.message) is is_ros2
    assert uav.parameters.get("A_WHOLE").value == 7  # once MAVROS has fetched them again


def test_a_list_that_is_never_answered_holds_up_no_command() -> None:
    """With ROS 2 rosbridge executes the operations of a client one after another, so it has a connection of its own."""
    backend = make("px4", 2)
    backend.bridge.faults.dead_services.add("/mavros/param/pull")
    backend.autopilot.pilot_readies()
    with UAL(backend, allow_arming=True) as uav:
        until(uav.is_ready, "a UAV that is ready", seen=uav.telemetry)
        offer = backend.offer(AutopilotParameters)  # type: ignore[type-abstract]  # it is only looked for
        assert offer is not None
        listing = offer.read_all()
        uav.arm()
        uav.take_off(2.0)
        assert not listing.done()
    with pytest.raises(UalTimeoutError, match="the connection to the bridge is lost"):
        listing.result(LIMIT_S)
