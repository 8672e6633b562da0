"""The calls of `ual.interface.Parachute`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, nothing, of
from ual.v1 import parachute_pb2 as pb


def ordered() -> Call[str]:
    return of("GetParachuteOrder", pb.GetParachuteOrderRequest(), lambda response: response.ordered)


def enable() -> Call[None]:
    return of("EnableParachute", pb.EnableParachuteRequest(), nothing)


def disable() -> Call[None]:
    return of("DisableParachute", pb.DisableParachuteRequest(), nothing)


def release() -> Call[None]:
    return of("ReleaseParachute", pb.ReleaseParachuteRequest(), nothing)
