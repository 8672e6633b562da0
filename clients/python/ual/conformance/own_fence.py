"""Checks of the fence that the autopilot keeps. Nothing is uploaded: each upload is one that has to be refused."""

from __future__ import annotations

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import GeofenceError, InvalidArgumentError, NotSupportedError, WrongStateError
from ual.fences.values import FencePlan, FenceZone, KeptFence
from ual.types import State

_ELSEWHERE = FencePlan((FenceZone(True, ((-80.0, 0.0),), 100.0),))
"""In the Antarctic."""
_NO_ZONE = FencePlan((FenceZone(True, ((47.0, 8.0), (47.1, 8.0))),))


@check(State.LANDED_DISARMED)
def reads_the_autopilots_fence(flight: Flight) -> None:
    """The fence is read; one that is none, or that does not contain the UAV, is refused and changes nothing."""
    kept = _kept(flight)
    fence = flight.uav.fence
    flight.refuses(InvalidArgumentError, lambda: fence.upload(_NO_ZONE, replace=True), "a polygon of two corners")
    flight.refuses(InvalidArgumentError, lambda: fence.upload(FencePlan(()), replace=True), "a fence without zones")
    if flight.uav.telemetry().position_geo is not None:
        elsewhere = flight.refuses(GeofenceError, lambda: fence.upload(_ELSEWHERE, replace=True), "a fence elsewhere")
        require("100 m" in elsewhere.message, f"the refusal does not name the zone: {elsewhere.message}")
    require(fence.get() == kept, "a refused upload has changed the fence")


@check(State.FLYING_AUTO)
def uploads_no_fence_in_flight(flight: Flight) -> None:
    """In flight no fence is uploaded, removed or switched unless forced."""
    kept = _kept(flight)
    fence = flight.uav.fence
    for act, what in (
        (lambda: fence.upload(_ELSEWHERE, replace=True), "uploading a fence in flight"),
        (fence.clear, "removing the fence in flight"),
        (fence.disable, "disabling the fence in flight"),
    ):
        flight.refuses(WrongStateError, act, what)
    require(fence.get() == kept, "a refused command has changed the fence")


def _kept(flight: Flight) -> KeptFence:
    try:
        return flight.uav.fence.get()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


ON_GROUND = (reads_the_autopilots_fence,)
IN_FLIGHT = (uploads_no_fence_in_flight,)
