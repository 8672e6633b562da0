"""The stubs of the services. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual.v1 import (
    camera_pb2_grpc,
    corrections_pb2_grpc,
    fence_pb2_grpc,
    gimbal_pb2_grpc,
    gripper_pb2_grpc,
    logs_pb2_grpc,
    mission_pb2_grpc,
    parachute_pb2_grpc,
    parameters_pb2_grpc,
    simulation_pb2_grpc,
    ual_pb2_grpc,
)

STUBS: Mapping[str, Callable[[Any], Any]] = {
    "UalService": ual_pb2_grpc.UalServiceStub,
    "CameraService": camera_pb2_grpc.CameraServiceStub,
    "CorrectionsService": corrections_pb2_grpc.CorrectionsServiceStub,
    "FenceService": fence_pb2_grpc.FenceServiceStub,
    "GimbalService": gimbal_pb2_grpc.GimbalServiceStub,
    "GripperService": gripper_pb2_grpc.GripperServiceStub,
    "LogService": logs_pb2_grpc.LogServiceStub,
    "MissionService": mission_pb2_grpc.MissionServiceStub,
    "ParachuteService": parachute_pb2_grpc.ParachuteServiceStub,
    "ParameterService": parameters_pb2_grpc.ParameterServiceStub,
    "SimulationService": simulation_pb2_grpc.SimulationServiceStub,
}
