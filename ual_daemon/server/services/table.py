"""The servicers of all services. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
)
from ual_daemon.server.services.camera import CameraServicer
from ual_daemon.server.services.corrections import CorrectionsServicer
from ual_daemon.server.services.fence import FenceServicer
from ual_daemon.server.services.gimbal import GimbalServicer
from ual_daemon.server.services.gripper import GripperServicer
from ual_daemon.server.services.logs import LogServicer
from ual_daemon.server.services.mission import MissionServicer
from ual_daemon.server.services.parachute import ParachuteServicer
from ual_daemon.server.services.parameters import ParameterServicer

SERVICES: Sequence[tuple[str, Callable[..., None], Callable[[Any], object]]] = (
    ("ual.v1.CameraService", camera_pb2_grpc.add_CameraServiceServicer_to_server, CameraServicer),
    ("ual.v1.CorrectionsService", corrections_pb2_grpc.add_CorrectionsServiceServicer_to_server, CorrectionsServicer),
    ("ual.v1.FenceService", fence_pb2_grpc.add_FenceServiceServicer_to_server, FenceServicer),
    ("ual.v1.GimbalService", gimbal_pb2_grpc.add_GimbalServiceServicer_to_server, GimbalServicer),
    ("ual.v1.GripperService", gripper_pb2_grpc.add_GripperServiceServicer_to_server, GripperServicer),
    ("ual.v1.LogService", logs_pb2_grpc.add_LogServiceServicer_to_server, LogServicer),
    ("ual.v1.MissionService", mission_pb2_grpc.add_MissionServiceServicer_to_server, MissionServicer),
    ("ual.v1.ParachuteService", parachute_pb2_grpc.add_ParachuteServiceServicer_to_server, ParachuteServicer),
    ("ual.v1.ParameterService", parameters_pb2_grpc.add_ParameterServiceServicer_to_server, ParameterServicer),
)
"""The name of each, what registers its servicer, and what makes that for a vehicle."""
