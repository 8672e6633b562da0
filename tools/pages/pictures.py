"""The pictures of docs/concepts, drawn by code so that a change of words is a change of one line."""

from __future__ import annotations

from collections.abc import Callable

from tools.pages.drawing import Drawing


def _states() -> Drawing:
    d = Drawing(760, 400, "The states of a UAV and what leads from one to another")
    d.box(20, 20, 170, 50, "UNINITIALIZED\nno fresh data", "r")
    d.box(20, 150, 170, 50, "LANDED_DISARMED\nmotors off")
    d.box(20, 300, 170, 50, "LANDED_ARMED\non the ground")
    d.box(300, 300, 150, 50, "TAKING_OFF\nonly the pilot aborts", "y")
    d.box(560, 300, 170, 50, "FLYING_AUTO\nUAL flies", "g")
    d.box(300, 150, 150, 50, "LANDING\nonly the pilot aborts", "y")
    d.box(560, 80, 170, 50, "FLYING_MANUAL\nthe pilot flies", "r")
    d.arrow((105, 70), (105, 150), text="data and a position", at=(112, 115), anchor="start")
    d.arrow((75, 200), (75, 300), text="arm", at=(42, 255))
    d.arrow((135, 300), (135, 200), text="disarm", at=(142, 255), anchor="start")
    d.arrow((190, 325), (300, 325), text="take_off", at=(245, 318))
    d.arrow((450, 325), (560, 325), text="height reached", at=(505, 318))
    d.arrow((600, 300), (450, 190), text="land", at=(490, 245))
    d.arrow((300, 175), (190, 175), text="on the ground", at=(245, 168))
    d.arrow((625, 300), (625, 130), text="pilot, failsafe,\nother mode", at=(618, 210), anchor="end")
    d.arrow((685, 130), (685, 300), text="recover", at=(692, 215), anchor="start")
    d.arrow((560, 100), (450, 160), text="land by hand", at=(500, 112))
    d.words(220, 42, "Any state becomes UNINITIALIZED when its data are too old.")
    d.words(220, 60, "The state is estimated anew at each update; nothing is remembered.")
    d.words(20, 385, "The safety pilot can take over at any time, also in TAKING_OFF and LANDING.")
    return d


def _frames() -> Drawing:
    d = Drawing(760, 340, "The frames map, odom and base_link with their axes")

    def axes(x: float, y: float, name: str, right: str, up: str) -> None:
        d.arrow((x, y), (x + 60, y), text=right, at=(x + 66, y + 5), anchor="start")
        d.arrow((x, y), (x, y - 60), text=up, at=(x, y - 66))
        d.shape(f'<circle class="n" cx="{x:g}" cy="{y:g}" r="4"/>')
        d.words(x - 6, y + 20, name, "t")

    axes(60, 280, "map", "x east", "y north")
    axes(260, 180, "uav_1/odom", "x east", "y north")
    axes(470, 280, "uav_2/odom", "x east", "y north")
    d.shape('<g transform="translate(420 110) rotate(-35)"><path class="g" d="M-22 -12L26 0L-22 12z"/></g>')
    d.arrow((420, 110), (474, 72), text="x ahead", at=(480, 70), anchor="start")
    d.arrow((420, 110), (388, 64), text="y left", at=(380, 58))
    d.words(400, 150, "uav_1/base_link", "t")
    d.arrow((70, 272), (252, 186), text="home", at=(150, 220), kind="a d")
    d.arrow((70, 282), (462, 282), text="home", at=(330, 300), kind="a d")
    d.arrow((268, 174), (408, 116), text="pose", at=(320, 138), kind="a d")
    d.shape('<path class="n" d="M660 150A60 60 0 0 0 600 90"/>')
    d.arrow((600, 150), (665, 150))
    d.arrow((600, 150), (600, 82))
    d.words(672, 155, "0: east")
    d.words(570, 76, "π/2: north")
    d.words(590, 180, "heading, counter-clockwise")
    d.words(20, 24, "Seen from above. z is up in all of them: no height is negative.")
    return d


def _task_stream_mission() -> Drawing:
    d = Drawing(760, 300, "Task, stream and mission: who computes the setpoints")
    for number, name in enumerate(("Task", "Stream", "Mission")):
        y = 30 + 90 * number
        d.words(15, y + 32, name, "t")
        d.box(90, y, 140, 54, "your program", "g" if name == "Stream" else "n")
        d.box(350, y, 120, 54, "daemon", "g" if name == "Task" else "n")
        d.box(610, y, 130, 54, "autopilot", "g" if name == "Mission" else "n")
        first = {"Task": "one goal", "Stream": "each setpoint", "Mission": "all items"}[name]
        second = {"Task": "50 setpoints/s", "Stream": "checked, 50/s", "Mission": "all items, once"}[name]
        d.arrow((230, y + 27), (350, y + 27), text=first, at=(290, y + 20))
        d.arrow((470, y + 27), (610, y + 27), text=second, at=(540, y + 20))
    d.words(110, 292, "Green computes the path; where green ends, so does the motion.")
    return d


def _lease_and_roles() -> Drawing:
    d = Drawing(760, 290, "Roles decide who may fly, the lease who does")
    d.box(20, 30, 150, 44, "observer\nreads")
    d.box(20, 100, 150, 44, "pilot A\nholds the lease", "g")
    d.box(20, 170, 150, 44, "pilot B\nno lease", "y")
    d.box(20, 240, 150, 44, "commander\nmay take it")
    d.box(330, 30, 120, 254, "role:\nmay this caller?", "b")
    d.box(520, 30, 100, 254, "lease:\nis it this one?", "b")
    d.box(670, 120, 80, 70, "UAV", "g")
    d.arrow((170, 52), (330, 52), text="telemetry", at=(250, 46))
    d.arrow((170, 122), (330, 122), text="goto", at=(250, 116))
    d.arrow((170, 192), (330, 192), text="goto", at=(250, 186))
    d.arrow((170, 262), (330, 262), text="--take", at=(250, 256))
    d.arrow((450, 122), (520, 122))
    d.arrow((620, 140), (670, 140))
    d.arrow((450, 192), (520, 192))
    d.words(528, 212, "LEASE_HELD", "s")
    d.arrow((450, 262), (520, 262))
    d.words(20, 18, "The safety pilot's transmitter goes past all of this.", "s")
    return d


def _limits_and_fences() -> Drawing:
    d = Drawing(760, 330, "Floor, ceiling, reach and fences, seen from the side")
    d.shape('<path d="M0 290H760V330H0z" fill="#e8e2d5"/>')
    d.shape('<path class="n d" d="M20 60H740"/><path class="n d" d="M20 262H740"/>')
    d.words(26, 52, "ceiling_m: 120 m above the ground of the take-off")
    d.words(26, 256, "floor_m and clearance_m: 0.5 m above that ground")
    d.words(26, 312, "ground of the take-off", "t")
    d.box(180, 90, 400, 150, "", "n")
    d.words(190, 110, "UAL's geofence: goals and paths are refused", "s")
    d.box(220, 130, 320, 90, "", "n")
    d.words(230, 148, "the autopilot's own fence: UAL stays 1 m inside", "s")
    d.shape('<circle cx="380" cy="186" r="8" fill="#3d7a48"/>')
    d.words(394, 191, "UAV", "t")
    d.arrow((372, 186), (250, 186))
    d.words(258, 180, "accepted", "s")
    d.arrow((380, 178), (660, 78), kind="a d")
    d.words(606, 120, "GEOFENCE", "t")
    d.words(560, 312, "reach_m: 10 km from the UAV", "s")
    return d


def _lost_link() -> Drawing:
    d = Drawing(760, 250, "The three links of a flight")
    d.box(20, 60, 150, 60, "program\nany host", "b")
    d.box(310, 60, 150, 60, "daemon\nnear the UAV", "b")
    d.box(590, 60, 150, 60, "autopilot\non the UAV", "g")
    d.box(590, 180, 150, 50, "safety pilot\ntransmitter", "y")
    d.arrow((170, 90), (310, 90), text="gRPC", at=(240, 82))
    d.arrow((460, 90), (590, 90), text="MAVLink, …", at=(525, 82))
    d.arrow((665, 180), (665, 120), text="radio of its own", at=(658, 155), anchor="end")
    d.words(240, 140, "lost: a go-to ends, the UAV holds", "s", "middle")
    d.words(240, 156, "a velocity ends after 0.5 s", "s", "middle")
    d.words(240, 172, "take-off, landing, mission go on", "s", "middle")
    d.words(525, 30, "lost: PX4 acts after 1 s, ArduPilot hovers after 3 s", "s", "middle")
    d.words(525, 46, "UAL says UNINITIALIZED and sends nothing", "s", "middle")
    d.words(20, 215, "The pilot needs neither the daemon nor a program.", "s")
    return d


def _architecture() -> Drawing:
    d = Drawing(760, 430, "The layers of the daemon and its clients")
    d.box(20, 20, 200, 50, "your program\nin the process", "b")
    d.box(280, 20, 210, 50, "your program\nany language, any host", "b")
    d.box(540, 20, 200, 50, "ual, viewer, ROS 2 node\nclients", "b")
    d.box(280, 110, 460, 44, "server: unpack, check the caller, call, pack")
    d.box(20, 190, 720, 44, "vehicle: checks a command, plans it, answers", "g")
    d.box(20, 250, 720, 44, "flight, tracker, frames: one manoeuvre, its setpoints, where everything is", "g")
    d.box(20, 310, 720, 36, "engine: the rules that keep the safety pilot in charge", "y")
    for number, name in enumerate(("light", "mavlink", "mavros", "crazyflie", "airsim", "dji", "yours")):
        d.box(20 + number * 104, 362, 96, 36, name)
    d.arrow((120, 70), (120, 190), text="class", at=(128, 130), anchor="start")
    d.arrow((385, 70), (385, 110), text="gRPC", at=(392, 95), anchor="start")
    d.arrow((640, 70), (640, 110), text="gRPC", at=(648, 95), anchor="start")
    d.arrow((510, 154), (510, 190))
    d.words(20, 420, "Each layer imports only those below it.")
    return d


PICTURES: dict[str, Callable[[], Drawing]] = {
    "states": _states,
    "frames": _frames,
    "task-stream-mission": _task_stream_mission,
    "lease-and-roles": _lease_and_roles,
    "limits-and-fences": _limits_and_fences,
    "lost-link": _lost_link,
    "architecture": _architecture,
}
