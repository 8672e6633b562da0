"""Exceptions of ROS from the rules: names of UAL for ROS 1, messages of ROS' own, and older names.

A new message, field or method needs no line here.
"""

from __future__ import annotations

from dataclasses import dataclass

from tools.contract.ros_rules import Called, FieldPart, Flag, Flat, RosField

INSTEAD = {
    **dict.fromkeys(
        ("Vector3", "Quaternion", "PoseStamped", "PointStamped", "TwistStamped", "Transform"), "geometry_msgs"
    ),
    **dict.fromkeys(("Header", "Pose", "Twist", "Odometry", "Battery", "Health"), "topics"),
    **dict.fromkeys(("Gripper", "Winch", "Servo", "ServoPosition", "Relay"), "Device"),
    "MissionPlace": "GeoPoint",
    "ActiveFault": "Fault",
    "AngleRange": "two numbers",
    "CameraIntrinsics": "sensor_msgs/CameraInfo",
    "Circle": "Geofence",
    "ImageInfo": "GetImage",
    "Route": "nav_msgs/Path",
    "TaskError": "Task",
}
"""Messages of which ROS has another one, or none. Those that are flat in another one are not named here."""
BY_HAND = (
    "Device.msg",
    "Equipment.msg",
    "Refusal.msg",
    "State.msg",
    "Viewpoint.msg",
    "OrderTask.srv",
    "DownloadLog.action",
)
"""Interfaces of which the contract has nothing of this form."""
ASKED_FOR = RosField("std_msgs/Header", "header", comment="when it was asked for; frame_id is not used")
SAID = RosField("std_msgs/Header", "header", comment="when the daemon said so; frame_id is not used")
_FILE = "the text of a .plan, of .waypoints (QGC WPL 110), or of KML, GPX or GeoJSON; ..."
_LEFT_OUT = RosField("string[]", "left_out", comment="what else is in the file and was not used, human-readable")
_PLACES = (
    RosField(
        "float64",
        "altitude",
        comment="of a file with places only: where they have no altitude, m above home; 0: that is refused",
    ),
    RosField(
        "uint8",
        "altitude_reference",
        comment="of the same: 1 (above home) or 2 (above mean sea level); 0: as the file says",
    ),
)


@dataclass(frozen=True)
class Extra:
    """Fields that only ROS has, before and after the others."""

    before: tuple[RosField, ...] = ()
    after: tuple[RosField, ...] = ()


EXTRA = {
    "CorrectionsStatus": Extra(
        (ASKED_FOR,),
        (
            RosField(
                "uint64", "received_count", comment="messages that the node has received on the topic `corrections`"
            ),
            RosField(
                "uint64",
                "not_taken_count",
                comment="those of them that the daemon has not taken: it was not there, or refused them",
            ),
            RosField(
                "string", "refusal", comment="why the last ones were not taken, reason and words; empty while they are"
            ),
        ),
    ),
    "Fault": Extra((RosField("string", "fault_id", comment="of one that is under way"),)),
    "Geofence": Extra(
        (
            RosField(
                "std_msgs/Header",
                "header",
                comment="the frame of all others, `map`; the stamp is when the daemon said so",
            ),
            RosField(
                "string",
                "unknown",
                comment="why it is not known where it may fly, human-readable; empty: the rest holds",
            ),
        )
    ),
    "GetInfoResponse": Extra((SAID,)),
    "Telemetry": Extra(
        (
            RosField(
                "std_msgs/Header", "header", comment="the stamp of the data; the frame is the body's, <ns>/base_link"
            ),
        )
    ),
    "GimbalStatus": Extra(
        (
            RosField("std_msgs/Header", "header", comment="when it looked so; frame_id is <ns>/base_link"),
            RosField("uint32", "gimbal", comment="its number"),
        )
    ),
    "Lease": Extra((SAID, RosField("bool", "is_held", comment="else every pilot may fly, and the rest is empty"))),
    "MissionProgress": Extra((ASKED_FOR,)),
    "Photo": Extra((RosField("uint32", "camera", comment="the camera's number"),)),
    "PlanMissionRequest": Extra((RosField("string", "file", comment=_FILE),), _PLACES),
    "PlanMissionResponse": Extra(after=(_LEFT_OUT,)),
    "UploadMissionRequest": Extra((RosField("string", "file", comment=_FILE),), _PLACES),
    "UploadMissionResponse": Extra(after=(_LEFT_OUT,)),
    "UploadFenceRequest": Extra(
        (
            RosField(
                "string",
                "file",
                comment="the text of a .plan of QGroundControl, or of a file of Mission Planner (QGC WPL 110); ...",
            ),
        )
    ),
}
FIELDS: dict[str, FieldPart | Called | Flat | Flag | None] = {
    # --- Names
    "CameraStatus.recording_s": Called("recording_time"),
    "CameraStorage.state": Called("storage"),
    "CameraStorage.total_mib": Called("storage_total"),
    "CameraStorage.available_mib": Called("storage_available"),
    "SetCameraZoomRequest.percent": Called("zoom"),
    "CameraTriggerItem.action": Called("camera_action"),
    "HoldItem.seconds": Called("hold"),
    "GpsInfo.fix": Called("gps_fix"),
    "GetInfoResponse.namespace": Called("ns"),
    "SetServoRequest.pwm_us": Called("pwm_us", "uint16"),
    # --- Types
    "TakeOffRequest.height_m": Called(type="float32"),
    "ReturnToLaunchRequest.height_m": Called(type="float32"),
    "PlaceOnGroundRequest.position": Called(type="geometry_msgs/Point"),
    "ListFaultsResponse.faults": Called(type="Fault[]"),
    "Geofence.corners": FieldPart(
        (RosField("geometry_msgs/Point[]", "corners", "[vector(each) for each in {corners}]"),),
        (("corners", "tuple(map(values.vector, {m}.corners))"),),
    ),
    "MissionProgress.stage": FieldPart.of(
        "string",
        "stage",
        "{stage}.name",
        "stage",
        "ual.missions.plan.MissionStage[{m}.stage]",
        "NONE, NOT_STARTED, ACTIVE, PAUSED, COMPLETE or UNKNOWN; by the autopilot's own words",
    ),
    # --- Messages whose fields stand in the one around them
    "CameraStatus.storage": Flat(),
    "GimbalStatus.angles": Flat(),
    "GetInfoResponse.limits": Flat(),
    "Telemetry.position_geo": Flat(),
    "Telemetry.gps": Flat(),
    "SetGimbalAnglesRequest.angles": Flat(),
    "SetExternalPoseRequest.external_pose": Flat(),
    "DownloadMissionResponse.mission": Flat(),
    "UploadMissionResponse.mission": Flat(),
    "PlanMissionResponse.plan": Flat(),
    # --- What may be lacking where neither NaN nor 0 can say it
    "ExternalPose.position_std_dev_m": Flag("has_position_std_dev"),
    "ExternalPose.orientation_std_dev_rad": Flag("has_orientation_std_dev"),
    "WaypointItem.yaw_rad": Flag("has_yaw"),
    "GeoWaypoint.yaw_rad": Flag("has_yaw"),
    "GoToWaypointGeoRequest.yaw_rad": Flag("has_yaw"),
    "GetImageRequest.photo": Flag("is_photo"),
    "SetCameraFocusRequest.percent": FieldPart(
        (
            RosField("bool", "is_automatic", "{percent} is None", "the camera focuses by itself, once; else to:"),
            RosField("float64", "focus", "0.0 if {percent} is None else {percent} / 100.0", "0 (near) to 1 (far)"),
        ),
        (("percent", "None if {m}.is_automatic else 100.0 * {m}.focus"),),
    ),
    "TakeOffItem.place": FieldPart(
        (
            RosField("bool", "has_place", "{latitude_deg} is not None", "it flies to the place after its climb"),
            RosField("GeoPoint", "place", "geo_point_fields(({latitude_deg}, {longitude_deg}))"),
        ),
        (
            ("latitude_deg", "{m}.place.latitude if {m}.has_place else None"),
            ("longitude_deg", "{m}.place.longitude if {m}.has_place else None"),
        ),
    ),
    "Frame.transform": FieldPart(
        (
            RosField("bool", "is_known", "{transform} is not None", "whether it is known (yet) where it is"),
            RosField(
                "geometry_msgs/Transform",
                "transform",
                "transform({transform})",
                "from the frame to its parent, where that is known",
            ),
        ),
        (("transform", "link_of({m})"),),
    ),
    "Geofence.circle": FieldPart(
        (
            RosField("bool", "has_circle", "{circle} is not None"),
            RosField(
                "geometry_msgs/Point",
                "center",
                "{{}} if {circle} is None else vector({circle}.center)",
                "its z says nothing",
            ),
            RosField("float64", "radius", "0.0 if {circle} is None else {circle}.radius_m", "m"),
        ),
        (("circle", "ual.types.Circle(values.vector({m}.center), {m}.radius) if {m}.has_circle else None"),),
    ),
    "Geofence.min_z_m": FieldPart.of(
        "float64",
        "min_z",
        "-math.inf if {min_z_m} is None else {min_z_m}",
        "min_z_m",
        "finite({m}.min_z)",
        "m; the highest of all lower edges; -infinity: there is none",
    ),
    "Geofence.max_z_m": FieldPart.of(
        "float64",
        "max_z",
        "math.inf if {max_z_m} is None else {max_z_m}",
        "max_z_m",
        "finite({m}.max_z)",
        "m; the lowest of all upper edges; infinity: there is none",
    ),
    "Task.waypoint_index": FieldPart.of(
        "int32",
        "waypoint_index",
        "-1 if {waypoint_index} is None else {waypoint_index}",
        "waypoint_index",
        "None if {m}.waypoint_index < 0 else {m}.waypoint_index",
        "of the pose, or the mission's item, that it flies to, from 0; -1 where it cannot be told",
    ),
    # --- Where Python has another form
    "GetInfoResponse.capabilities": FieldPart.of(
        "string[]",
        "capabilities",
        "sorted(each.name for each in {capabilities})",
        "capabilities",
        "frozenset(ual.types.Capability[each] for each in {m}.capabilities)",
        "such as TAKE_OFF and POSITION: what is not here is refused with NOT_SUPPORTED",
    ),
    "Parameter.value": FieldPart.of("float64", "value", "float({value})", "value", "parameter_value({m})"),
    "SetParameterRequest.value": FieldPart.of("float64", "value", "float({value})", "value", "{m}.value"),
    "Task.id": FieldPart.of("string", "task_id", "{id}", "id", "{m}.task_id"),
    "Task.error": FieldPart(
        (
            RosField(
                "string",
                "reason",
                '"" if {error} is None else {error}.reason',
                "why it was aborted or failed: the name of the error in docs/reference/errors.md; else empty",
            ),
            RosField(
                "string", "message", '"" if {error} is None else {error}.message', "the error's words, human-readable"
            ),
            RosField(
                "diagnostic_msgs/KeyValue[]",
                "metadata",
                "[] if {error} is None else key_values({error}.metadata)",
                "of the error",
            ),
        ),
        (("error", "error_of({m}) if {m}.reason else None"),),
    ),
    "RallyPoint.latitude_deg": FieldPart(
        (RosField("GeoPoint", "place", "geo_point_fields(({latitude_deg}, {longitude_deg}))"),),
        (("latitude_deg", "{m}.place.latitude"), ("longitude_deg", "{m}.place.longitude")),
    ),
    "RallyPoint.longitude_deg": None,
    "RallyPoint.is_amsl": FieldPart.of(
        "bool",
        "is_amsl",
        "{reference} is ual.AltitudeReference.AMSL",
        "reference",
        "ual.AltitudeReference.AMSL if {m}.is_amsl else ual.AltitudeReference.HOME",
        "above mean sea level",
    ),
    "Geofence.header": None,
    # --- Messages of ROS, and of others
    "Camera.intrinsics": FieldPart.of(
        "sensor_msgs/CameraInfo",
        "camera_info",
        "pictures.camera_info({self})",
        "intrinsics",
        "intrinsics({m}.camera_info)",
        "without zoom; matrices of zeros where that is not known",
    ),
    "Photo.stamp": FieldPart(
        (RosField("Viewpoint", "viewpoint", "pictures.viewpoint({self})", "from where it was taken"),),
        (("**", "read_viewpoint({m}.viewpoint)"),),
    ),
    "Photo.body": None,
    "Photo.camera": None,
    "Photo.position_geo": None,
    "GimbalStatus.stamp": FieldPart((), (("stamp_s", "values.stamp_s({m}.header.stamp) or None"),)),
    "SetGimbalAnglesRequest.reference": FieldPart.of(
        "string",
        "reference",
        "{reference}.name",
        "reference",
        'named(ual.gimbals.GimbalReference, {m}.reference, "reference", ual.gimbals.GimbalReference.HORIZON)',
        "BODY, HORIZON or EARTH: from what they count; empty is taken as HORIZON",
    ),
    "GetRouteResponse.route": FieldPart(
        (
            RosField(
                "bool", "is_flown", comment="else nothing is flown whose way is known, as in a landing or by velocities"
            ),
            RosField("nav_msgs/Path", "route", comment="in map"),
            RosField("string", "task_id", comment="empty: a reference leads there"),
            RosField("bool", "is_goal_moving", comment="and so does the way to it"),
        )
    ),
    "GetImageResponse.info": FieldPart(
        (
            RosField("sensor_msgs/CompressedImage", "compressed", comment="of COLOUR and SEGMENTATION"),
            RosField("sensor_msgs/Image", "distances", comment="of DEPTH and RANGE, as REP 118 has them"),
            RosField(
                "sensor_msgs/CameraInfo",
                "camera_info",
                comment="as it is zoomed in this picture; matrices of zeros where that is not known",
            ),
            RosField("Viewpoint", "viewpoint", comment="from where it was taken"),
        )
    ),
    "ExternalPose.pose": FieldPart.of(
        "geometry_msgs/PoseStamped",
        "pose",
        "pose_stamped({pose})",
        "pose",
        "values.pose_stamped({m}.pose, stamp_s=values.stamp_s({m}.pose.header.stamp))",
        "with its whole orientation; the stamp is when it was measured, zeros: just now",
    ),
    "FollowPathRequest.geo_waypoints": FieldPart(
        (
            RosField(
                "GeoWaypoint[]",
                "geo_waypoints",
                "[geo_waypoint_fields(each) for each in {waypoints} if isinstance(each, ual.GeoWaypoint)]",
                "instead of a path",
            ),
        )
    ),
    "FollowPathRequest.point_of_interest": FieldPart.of(
        "geometry_msgs/PointStamped",
        "point_of_interest",
        "point_stamped({point_of_interest})",
        "point_of_interest",
        "paths.point_of_interest({m})",
        "only with POINT_OF_INTEREST",
    ),
    "FollowPathRequest.waypoints": FieldPart(
        (
            RosField(
                "nav_msgs/Path",
                "path",
                "path({waypoints})",
                comment="a pose without a frame_id is in that of the path; without both in <ns>/odom",
            ),
        ),
        (("waypoints", "paths.waypoints({m})"),),
    ),
    "GetImageResponse.data": None,
    "GetEquipmentResponse.grippers": FieldPart((RosField("Device[]", "devices"),)),
    "GetEquipmentResponse.winches": None,
    "GetEquipmentResponse.servos": None,
    "GetEquipmentResponse.relays": None,
    # --- What ROS has by other ways
    **dict.fromkeys(("AbortRequest.task_id", "PauseRequest.task_id", "ResumeRequest.task_id")),
    **dict.fromkeys(("SetPoseResponse.plan", "SetVelocityResponse.plan", "RecoverFromManualResponse.plan")),
    "SetExternalPoseResponse.dropped": None,
}
ORDER = {
    "Camera": ("number", "name", "firmware_version", "abilities", "image_kinds"),
    "Photo": ("number", "is_stored"),
    "FollowPathRequest": (
        "path",
        "geo_waypoints",
        "corner_radius",
        "max_speed",
        "leg_speeds",
        "heading",
        "point_of_interest",
        "holds",
    ),
    "TakeOffRequest": ("height", "force"),
    "Frame": ("frame_id", "parent_frame_id", "is_known"),
    "Geofence": (),
    "GetInfoResponse": (
        "ns",
        "backend",
        "autopilot",
        "autopilot_version",
        "url",
        "ual_version",
        "is_simulation",
        "is_arming_allowed",
        "has_safety_pilot",
    ),
    "Parameter": ("name", "value"),
    "RecoverFromManualRequest": ("force",),
    "SetGimbalRatesRequest": (),
    "TakeOffItem": ("has_place", "place"),
    "Task": (
        "task_id",
        "kind",
        "status",
        "progress",
        "distance_left",
        "elapsed",
        "waypoint_index",
        "is_paused",
        "description",
    ),
}
"""The fields that come first; the others follow as the contract has them."""
NO_FRAMES = ("RemoveFrame", "SetExternalPose")
"""Methods whose frames only the daemon has: tf is not asked for them."""
MESSAGES = {"GetInfoResponse": "Info", "FencePoint": "GeoPoint", "Telemetry": "GeoPosition"}
"""Messages that have another name in ROS, or of which it has none by the rules."""
ONLY = {"Telemetry": ("position_geo", "gps")}
"""The fields that a message of ROS has; the others are on other topics."""
NAMES = {"GetEquipment": "list_equipment", "StartMission": "fly_mission", "RecoverFromManual": "take_control"}
"""Services with another name than that of the method."""
TYPES = {
    "GetEquipment": "ListEquipment",
    "StartMission": "FlyMission",
    "RecoverFromManual": "TakeControl",
    "ListParts": "ListSimulationParts",
    "PilotMoveSticks": "MoveSticks",
    "Step": "StepTime",
    **dict.fromkeys(("StopPhotos", "StartVideo", "StopVideo"), "OrderCamera"),
    **dict.fromkeys(
        ("MoveGimbalToNeutral", "RetractGimbal", "TakeGimbalControl", "ReleaseGimbalControl"), "OrderGimbal"
    ),
    **dict.fromkeys(("Grip", "Release"), "MoveGripper"),
}
OWN = (
    "EnableFence",
    "GetCorrectionsStatus",
    "GetEquipment",
    "GetGimbalStatus",
    "GetImage",
    "GetRoute",
    "GetTask",
    "ListFaults",
    "ListPhotos",
    "OrderWinch",
    "PlanMission",
    "RecoverFromManual",
    "SetPose",
    "SetVelocity",
    "StartMission",
    "TakePhoto",
    "UploadFence",
    "UploadMission",
)
"""Methods that the node calls by hand, as it does more than pass on what it is given."""
NO_MEMBER = ("EnableFence", "GetTask")
"""Methods that two members of `ual.Uav` call, or a member of a task."""
HEADS = {
    "ual.v1.GetInfoResponse": "Who a UAV is, what it can do, and its limits.",
    "ual.v1.CameraService.GetImage": (
        "Fetches one picture. A program that looks all the time subscribes to the camera's topics. "
        "Errors: RESOURCE_EXHAUSTED (too many wait for pictures of this camera)."
    ),
    "ual.v1.Telemetry": "Where the UAV is on Earth, with each altitude that is known, and what its receiver has.",
}
"""Comments of what the contract has in another form."""
NO_SERVICE = (
    "GetInfo",
    "GetTelemetry",
    "StreamTelemetry",
    "GetTransform",
    "GetGeofence",
    "FollowPath",
    "StreamSetpoints",
    "StreamExternalPoses",
    "AcquireLease",
    "KeepLease",
    "ReleaseLease",
    "GetLease",
    "WatchTask",
    "StreamCorrections",
    "WatchGimbal",
    "WatchMission",
    "DownloadLog",
)
"""Methods of which ROS has a topic, an action or a parameter."""
NO_TASKS = ("GetTask", "WatchTask")
"""Methods that tell of a task, and begin none."""
ONLY_ACTIONS = ("FollowPath",)
ONLY_ACTION = ("non_blocking", "dry_run", "force", "max_speed", "has_yaw", "yaw")
"""Fields of a task that only its action has: the service has those of UAL for ROS 1."""
BLOCKING = RosField("bool", "blocking", comment="answer when it has ended, instead of when it has begun")
NOT_OF_ACTION = ("non_blocking",)
FEEDBACK = (
    RosField("uint8", "state", comment="as in ual_msgs/State"),
    RosField("string", "reason", comment="what the state follows from, human-readable"),
    RosField("float64", "distance_left", comment="m; NaN where it cannot be told"),
    RosField("float64", "progress", comment="0 to 1; NaN where it cannot be told"),
    RosField("bool", "is_paused", comment="stopped on its way by `pause`"),
)
"""Feedback of an action while a task runs."""
FEEDBACK_OF = {
    "FollowPath": (
        RosField("int32", "waypoint_index", comment="of the pose that it flies to, from 0; -1 where it cannot be told"),
    ),
}
FEEDBACK_AFTER = {
    "StartMission": (
        RosField("MissionProgress", "mission", comment="the item that it flies to, and the one that it reached last"),
    ),
}
ITS_TASK = RosField("string", "task_id", comment="for get_task, cancel_task, pause_task and resume_task")
WAS_TASK = RosField("string", "task_id", comment="of the task that it was; empty: none began")
PLAN = RosField("Plan", "plan", comment="only with dry_run")
TASK_ID = RosField("string", "task_id", comment="of the task that it began; empty: none began")
