"""The commands of ``ual``, as its help lists them. ``make pages`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual_tools.help import ListedCommand, Section

COMMANDS: Mapping[str, ListedCommand] = {
    "list": ListedCommand("ual_tools.status", Section.LOOKING, "List the UAVs, the worst first."),
    "info": ListedCommand(
        "ual_tools.status", Section.LOOKING, "Print the UAV's name, its autopilot, and what it can do."
    ),
    "state": ListedCommand("ual_tools.status", Section.LOOKING, "Print the state of the UAV."),
    "wait": ListedCommand(
        "ual_tools.status", Section.LOOKING, "Wait for a state, or for one of several, and print which."
    ),
    "watch": ListedCommand("ual_tools.status", Section.LOOKING, "Show the UAV's telemetry until q or Ctrl-C."),
    "lease": ListedCommand("ual_tools.lease", Section.LOOKING, "Print the holder of the lease of the UAV."),
    "arm": ListedCommand("ual_tools.flight", Section.FLYING, "Arm the motors (where the daemon permits it)."),
    "disarm": ListedCommand("ual_tools.flight", Section.FLYING, "Disarm the motors (where the daemon permits it)."),
    "takeoff": ListedCommand(
        "ual_tools.flight", Section.FLYING, "Take off to HEIGHT metres above the ground it stands on."
    ),
    "land": ListedCommand("ual_tools.flight", Section.FLYING, "Land where it is."),
    "goto": ListedCommand("ual_tools.flight", Section.FLYING, "Fly straight to X Y Z (metres)."),
    "goto-geo": ListedCommand("ual_tools.flight", Section.FLYING, "Fly straight to LAT LON (degrees) at ALT (metres)."),
    "velocity": ListedCommand("ual_tools.flight", Section.FLYING, "Fly with VX VY VZ (m/s) for a while, then stop."),
    "pose": ListedCommand(
        "ual_tools.flight", Section.FLYING, "Send X Y Z (metres) as the reference, without a trajectory."
    ),
    "recover": ListedCommand(
        "ual_tools.flight", Section.TASKS, "Take control back from the safety pilot and hold the pose."
    ),
    "home": ListedCommand("ual_tools.flight", Section.FRAMES, "Make the present position the origin of <ns>/odom."),
    "abort": ListedCommand(
        "ual_tools.flight", Section.TASKS, "Cancel the running task; the UAV stops and holds its position."
    ),
    "teleop": ListedCommand(
        "ual_tools.teleop.command", Section.FLYING, "Fly by hand: by keyboard, joystick or gamepad."
    ),
    "rtl": ListedCommand(
        "ual_tools.task", Section.FLYING, "Return home and land: climb, fly straight over home, descend."
    ),
    "pause": ListedCommand("ual_tools.task", Section.TASKS, "Stop the running task on its way and hold."),
    "resume": ListedCommand("ual_tools.task", Section.TASKS, "Go on with the paused task, along the rest of its way."),
    "path": ListedCommand(
        "ual_tools.path", Section.FLYING, "Fly through waypoints, X,Y,Z or X,Y,Z,YAW, or those of a file."
    ),
    "frames": ListedCommand("ual_tools.frames", Section.FRAMES, "List the frames, add one, or remove one."),
    "geofence": ListedCommand(
        "ual_tools.where", Section.FRAMES, "Print where the UAV may fly: inside all of these at once."
    ),
    "route": ListedCommand("ual_tools.where", Section.TASKS, "Print the way that the UAV flies, as points."),
    "waypoints": ListedCommand("ual_tools.waypoints", Section.FRAMES, "Save poses to a file and fly through them."),
    "mission": ListedCommand(
        "ual_tools.missions", Section.FLYING, "Bring missions to the autopilot, which flies them by itself."
    ),
    "camera": ListedCommand("ual_tools.cameras", Section.CARRIED, "Take pictures and videos."),
    "fence": ListedCommand("ual_tools.fence", Section.AUTOPILOT, "Read, upload and enable the fence of the autopilot."),
    "gimbal": ListedCommand("ual_tools.gimbals", Section.CARRIED, "Point gimbals, and see where they look."),
    "gripper": ListedCommand("ual_tools.gripper", Section.CARRIED, "Move grippers, winches, servos and relays."),
    "logs": ListedCommand(
        "ual_tools.logs", Section.AUTOPILOT, "List and download the logs that the autopilot has written."
    ),
    "param": ListedCommand(
        "ual_tools.parameters", Section.AUTOPILOT, "Read, write and compare the parameters of the autopilot."
    ),
    "parachute": ListedCommand("ual_tools.services", Section.CARRIED, "The parachute that it carries."),
    "rtcm": ListedCommand(
        "ual_tools.rtcm.command", Section.AUTOPILOT, "Send corrections (RTCM 3) to the UAV until Ctrl-C."
    ),
    "sim": ListedCommand("ual_tools.simulation", Section.SIMULATION, "Control the world around a simulated UAV."),
    "token": ListedCommand("ual_tools.tokens", Section.ACCESS, "Make, list and revoke the tokens of callers."),
    "certificates": ListedCommand("ual_tools.certificates", Section.ACCESS, "Make the TLS certificates of a team."),
    "router": ListedCommand("ual_tools.network.router", Section.TEAMS, "Run a router of the network until Ctrl-C."),
    "gateway": ListedCommand(
        "ual_tools.network.gateway", Section.TEAMS, "Keep a gateway's list of UAVs as the network says."
    ),
    "audit": ListedCommand("ual_tools.audit", Section.ACCESS, "Check the audit of a daemon."),
    "check": ListedCommand("ual_tools.check", Section.TOOLS, "Check that the UAV does what all UAVs must do."),
    "extpose": ListedCommand(
        "ual_tools.extpose", Section.AUTOPILOT, "Give the autopilot poses from outside, out of a file."
    ),
    "record": ListedCommand("ual_tools.record", Section.LOOKING, "Record the telemetry of the UAV until Ctrl-C."),
    "plot": ListedCommand("ual_tools.record", Section.LOOKING, "Draw a recorded flight on one page."),
    "view": ListedCommand(
        "ual_tools.view.command", Section.LOOKING, "Show the UAVs in a page of the browser until Ctrl-C."
    ),
    "launch": ListedCommand(
        "ual_tools.launch.command", Section.TEAMS, "Run a team: daemons, and programs next to them."
    ),
    "ros2": ListedCommand("ual_tools.ros2.command", Section.TEAMS, "Run UAVs as nodes of ROS 2 until Ctrl-C."),
    "completion": ListedCommand(
        "ual_tools.completion", Section.TOOLS, "Print the script that completes commands in a shell."
    ),
}
