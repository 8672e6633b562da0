"""Which role each method needs."""

from __future__ import annotations

from collections.abc import Mapping

from ual.access.roles import Role

_READING = (
    "GetInfo",
    "GetTelemetry",
    "StreamTelemetry",
    "GetTransform",
    "ListFrames",
    "GetGeofence",
    "GetRoute",
    "GetLease",
    "GetTask",
    "WatchTask",
)
_FLYING = (
    "AddFrame",
    "RemoveFrame",
    "TakeOff",
    "Land",
    "GoToWaypoint",
    "GoToWaypointGeo",
    "FollowPath",
    "ReturnToLaunch",
    "SetPose",
    "SetVelocity",
    "StreamSetpoints",
    "SetExternalPose",
    "StreamExternalPoses",
    "RecoverFromManual",
    "Abort",
    "Pause",
    "Resume",
    "AcquireLease",
    "KeepLease",
    "ReleaseLease",
)
_SEEING = ("ListCameras", "GetCameraStatus", "ListPhotos", "ListVideoStreams", "GetImage")
_SEEING_GIMBALS = ("ListGimbals", "GetGimbalStatus", "WatchGimbal")
_COMMANDING = ("Arm", "Disarm", "SetHome")

_READING_MISSIONS = ("PlanMission", "DownloadMission", "GetMissionProgress", "WatchMission")
_FLYING_MISSIONS = ("UploadMission", "ClearMission", "StartMission", "PauseMission", "ResumeMission", "JumpToItem")

_OF_METHOD: Mapping[str, Role] = {
    **{f"ual.v1.UalService/{name}": Role.OBSERVER for name in _READING},
    **{f"ual.v1.UalService/{name}": Role.PILOT for name in _FLYING},
    **{f"ual.v1.UalService/{name}": Role.COMMANDER for name in _COMMANDING},
    "ual.v1.SimulationService/ListParts": Role.OBSERVER,
    "ual.v1.SimulationService/ListFaults": Role.OBSERVER,
    "ual.v1.ParameterService/GetParameter": Role.OBSERVER,
    "ual.v1.ParameterService/ListParameters": Role.OBSERVER,
    **{f"ual.v1.MissionService/{name}": Role.OBSERVER for name in _READING_MISSIONS},
    **{f"ual.v1.MissionService/{name}": Role.PILOT for name in _FLYING_MISSIONS},
    **{f"ual.v1.CameraService/{name}": Role.OBSERVER for name in _SEEING},
    **{f"ual.v1.GimbalService/{name}": Role.OBSERVER for name in _SEEING_GIMBALS},
    "ual.v1.FenceService/GetFence": Role.OBSERVER,
    "ual.v1.GripperService/GetEquipment": Role.OBSERVER,
    "ual.v1.LogService/ListLogs": Role.OBSERVER,
    "ual.v1.CorrectionsService/StreamCorrections": Role.PILOT,
    "ual.v1.CorrectionsService/GetCorrectionsStatus": Role.OBSERVER,
}
_OF_SERVICE: Mapping[str, Role] = {
    "ual.v1.UalService": Role.COMMANDER,  # what is new and was forgotten above
    "ual.v1.SimulationService": Role.COMMANDER,  # whoever changes the world may do everything in it
    "ual.v1.ParameterService": Role.COMMANDER,  # who writes them decides how the UAV flies
    "ual.v1.FenceService": Role.COMMANDER,  # who uploads one decides where it may fly
    "ual.v1.LogService": Role.PILOT,  # a log tells all flights and all settings, and its download takes up the link
    "ual.v1.CorrectionsService": Role.PILOT,  # false ones move the position by which it flies
    "ual.v1.CameraService": Role.PILOT,
    "ual.v1.GripperService": Role.PILOT,
    "ual.v1.GimbalService": Role.PILOT,
    "ual.v1.MissionService": Role.COMMANDER,  # what is new and was forgotten above
    "grpc.health.v1.Health": Role.OBSERVER,
    "grpc.reflection.v1alpha.ServerReflection": Role.OBSERVER,
}


def needed_role(method: str) -> Role:
    """Returns the role that ``/package.Service/Method`` needs; for a service that is not ours (an extension) pilot."""
    name = method.lstrip("/")
    return _OF_METHOD.get(name, _OF_SERVICE.get(name.partition("/")[0], Role.PILOT))
