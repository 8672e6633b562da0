"""A link of its own to the simulator: where the vehicle really is, and a ground station that sends beside us."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from urllib.parse import urlsplit

from pymavlink.dialects.v20 import all as mavlink

from tests.campaign.positions import Origin, distance_m
from tests.campaign.record import Located, Place, Record
from tests.simulators.codec import AutopilotCodec
from ual_daemon.backends.mavlink.wire.frames import FrameReader
from ual_daemon.backends.mavlink.wire.messages import Message

STATION_ID = 253
_TRUTHS = frozenset({mavlink.MAVLINK_MSG_ID_SIM_STATE, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION})
_NOTED = _TRUTHS | {mavlink.MAVLINK_MSG_ID_HOME_POSITION}
_UNWANTED = (
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
    mavlink.MAVLINK_MSG_ID_ODOMETRY,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
)
"""PX4 sends these unasked on each link, and then the truth too rarely."""
_RATE_HZ = 20.0
_ASK_S = 5.0
_HOMES_HZ = 5.0
_HOME_MOVED_M = 0.05
_POSITION_ONLY = 0b110111111000


class TruthLink:
    """Fills `record.truth`. `url` is a second link of the simulator: ``udpin://`` (PX4) or ``tcp://`` (ArduPilot)."""

    def __init__(self, url: str, record: Record, origin: Origin) -> None:
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        self._address = (parts.hostname, parts.port)
        self._is_udp = parts.scheme == "udpin"
        self.record = record
        self._origin = origin
        self._codec = AutopilotCodec(mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec.join(STATION_ID)
        self._lock = threading.Lock()
        self._link: socket.socket | None = None
        self._peer: tuple[str, int] | None = None
        self._system_id = 0
        self._is_closing = False
        self.place: Place | None = None
        self._thread = threading.Thread(target=self._run, name="truth")
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()

    def send_target(self, place: Place) -> None:
        """Sends it somewhere, as a ground station's "fly to here" does. Its local frame began at the origin."""
        north, east, down = place[1], place[0], -place[2]
        frame = mavlink.MAV_FRAME_LOCAL_NED
        zeros = (0.0,) * 8
        self._tell(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self._system_id, 1, frame, _POSITION_ONLY, north, east, down, *zeros
            )
        )

    def set_home(self, place: Place) -> None:
        """Moves the autopilot's home, as a ground station does."""
        latitude_deg, longitude_deg, altitude_m = self._origin.geo(place)
        command, frame = mavlink.MAV_CMD_DO_SET_HOME, mavlink.MAV_FRAME_GLOBAL
        on_wire = (round(latitude_deg * 1e7), round(longitude_deg * 1e7), altitude_m)
        self._tell(mavlink.MAVLink_command_int_message(self._system_id, 1, frame, command, 0, 0, *(0.0,) * 4, *on_wire))

    def set_origin(self, place: Place) -> None:
        """Moves the origin of the autopilot's local frame: the vehicle stays where it is."""
        latitude_deg, longitude_deg, altitude_m = self._origin.geo(place)
        on_wire = (round(latitude_deg * 1e7), round(longitude_deg * 1e7), round(altitude_m * 1e3))
        self._tell(mavlink.MAVLink_set_gps_global_origin_message(self._system_id, *on_wire))

    def _run(self) -> None:
        while not self._is_closing:
            try:
                with self._open() as link:
                    self._link = link
                    self._listen(link)
            except OSError:
                time.sleep(0.2)

    def _open(self) -> socket.socket:
        if not self._is_udp:
            return socket.create_connection(self._address, timeout=1.0)
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.bind(self._address)
        return link

    def _listen(self, link: socket.socket) -> None:
        """Until the link closes."""
        link.settimeout(0.5)
        reader, asked_s = FrameReader(), 0.0
        while not self._is_closing:
            if time.monotonic() - asked_s > _ASK_S:
                asked_s = time.monotonic()
                self._ask()
            try:
                data, self._peer = link.recvfrom(65536)
            except TimeoutError:
                continue
            if not data:
                raise ConnectionResetError
            for frame in reader.feed(data):
                if frame.message_id in _NOTED:
                    with contextlib.suppress(mavlink.MAVError):
                        self._note(self._codec.decode(frame))
                if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 and not self._system_id:
                    self._system_id = frame.system_id
                    self._ask()

    def _note(self, message: Message) -> None:
        now_s = time.monotonic()
        if isinstance(message, mavlink.MAVLink_home_position_message):
            note_home(self.record.homes, self._origin, message, now_s)
            return
        if isinstance(message, mavlink.MAVLink_sim_state_message):
            geo = (message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
            velocity = (message.ve, message.vn, -message.vd)
        else:
            geo = (message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
            velocity = (message.vy / 100.0, message.vx / 100.0, -message.vz / 100.0)
        if not geo[0]:
            return
        self.place = self._origin.current_position(*geo)
        self.record.truth.append(Located(now_s, self.place, velocity))

    def _ask(self) -> None:
        if not self._system_id:
            return
        if self._is_udp:
            for message_id in _UNWANTED:
                self._set_interval(message_id, -1.0)
        wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION if self._is_udp else mavlink.MAVLINK_MSG_ID_SIM_STATE
        self._set_interval(wanted, 1e6 / _RATE_HZ)
        self._set_interval(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1e6 / _HOMES_HZ)

    def _set_interval(self, message_id: int, interval_us: float) -> None:
        params = (float(message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0)
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self._tell(mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *params))

    def _tell(self, message: Message) -> None:
        with self._lock, contextlib.suppress(OSError):
            data = self._codec.encode(message)
            if self._link is None:
                return
            if self._is_udp and self._peer is not None:
                self._link.sendto(data, self._peer)
            elif not self._is_udp:
                self._link.sendall(data)


def note_home(homes: list[Located], origin: Origin, message: Message, now_s: float) -> None:
    """Notes where the autopilot's home is, where it has moved."""
    place = origin.current_position(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3)
    if not homes or distance_m(homes[-1].place, place) > _HOME_MOVED_M:
        homes.append(Located(now_s, place))
