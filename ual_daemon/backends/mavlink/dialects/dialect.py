"""Dialect of one kind of autopilot over MAVLink, behind one interface; chosen once, by its heartbeat."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from ual.errors import NotSupportedError
from ual.gimbals import GimbalAbility, GimbalReference
from ual_daemon.backends.firmwares.autopilot import NO_PARAMETERS, Autopilot, version_text
from ual_daemon.backends.firmwares.px4_events import Event
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand, arm_or_disarm
from ual_daemon.backends.mavlink.dialects.parameter_codec import ParameterCodec
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import ExternalPose, Freshness, Setpoint, Snapshot


class Dialect(Autopilot):
    """One kind of autopilot, over MAVLink. Stateless: callers pass everything that it needs."""

    names_intended_mode = False
    """Whether it reports the requested mode besides the one that flies: another one is then a failsafe's."""
    freshness = Freshness(link_s=1.0, pose_s=1.2, mode_s=5.0, landed_s=1.5, estimator_s=3.0)
    """Chosen for PX4's slowest rates without a request: heartbeat and estimator status 1 Hz, landed state 5 Hz,
    position 30 Hz. They are long enough for a link that loses and damages 40 %: every requested value comes in time,
    over years of flying. A late heartbeat is requested ten times a second. The link's limit is the shortest: when
    nothing comes at all, the lost link is what to report."""
    estimator_message: int = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    """The message whose `flags` describe the estimator."""
    sparse_messages: frozenset[int] = frozenset()
    """Streamed messages that come far less often than requested while nothing changes."""
    optional_messages: frozenset[int] = frozenset()
    """Streamed messages that may never come: what they are about need not be there."""
    wanted_messages: tuple[int, ...] = ()
    """Messages that are needed once and sent only on request or on a change."""
    changing_messages: frozenset[int] = frozenset()
    """Messages among `wanted_messages` that are requested again now and then, as a lost change of them would matter."""

    takes_plain_velocities = False
    """Whether `encode_setpoint` encodes a velocity without looking at anything else; see `SetpointEncoder.velocity`."""
    tells_baseline = False
    """Whether it may send GPS_RTK, with the distance from the base station."""
    busy_answers: frozenset[tuple[int, int]] = frozenset()
    """Commands and their refusals that mean: it is doing that already, and will say when it is done."""
    replaced_answers: frozenset[tuple[int, int]] = frozenset()
    """Commands and their answers that mean: an order was replaced by a newer one (see `Verdict.REPLACED`)."""
    parameter_codec: ParameterCodec | None = None
    """Codec of parameters' values; None where UAL neither reads nor writes them all."""
    takes_ftp_session = False
    """Whether a file that is opened by MAVFTP has the session that was requested, and not session 0."""
    rates_beside_files = 1.0
    """Factor of the requested stream rates while it sends files in flight, as it then sends the streams less often."""
    has_descriptions = False
    """Whether it may have a file that describes its parameters."""
    packed_parameters = ""
    """The file with all parameters and their values; empty where there is none."""
    mission_change_texts: tuple[str, ...] = ()
    """The beginnings of the texts by which it says that its mission was changed."""
    keeps_items = False
    """Whether UAL transfers its mission, its fence and its rally points by the mission protocol."""

    tells_gimbal_manager = False
    """Whether AUTOPILOT_VERSION says that it manages gimbals. Another one is asked a few times."""
    gimbal_kind_parameter = ""
    """The parameter with the kind of a gimbal that it turns by itself, by its number, ..."""
    gimbal_references: Mapping[float, GimbalReference] = MappingProxyType({})
    """... and for which kinds its attitude is in which axes, whatever its flags say."""
    lacking_gimbal_abilities: frozenset[GimbalAbility] = frozenset()
    """Abilities that it reports of its gimbals, and that they do not have."""

    @abstractmethod
    def streams(self, pose_rate_hz: float) -> list[LongCommand]:
        """Returns the requests for the messages that we need as streams."""

    def parameter_value(self, message: Message) -> float | None:
        """Returns the value in a PARAM_VALUE; None for a type that the autopilot is not known to send."""
        return float(message.param_value) if message.param_type == mavlink.MAV_PARAM_TYPE_REAL32 else None

    def event(self, message: Message, mode: str) -> Event | None:
        """Returns the content of a message of PX4's event interface, in the mode of this name; None where this
        autopilot has no such interface.
        """
        return None

    @abstractmethod
    def encode_setpoint(
        self, setpoint: Setpoint, target: MessageSource, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        """Returns the message of a setpoint; `parameters` are those read so far.

        Raises:
            NotSupportedError: UAL does not fly this autopilot. The same holds for the commands below.

        """

    def encode_external_pose(self, measured: ExternalPose) -> Message:
        """Returns the message of a pose from outside, for an autopilot whose `capabilities` have EXTERNAL_POSE."""
        raise NotSupportedError(f"{self.name} takes no poses from outside")

    @abstractmethod
    def arm(self, snapshot: Snapshot) -> LongCommand:
        """Arms, never by force; from a mode in which it cannot be armed, by way of one in which it can."""

    def disarm(self) -> LongCommand:
        """Disarms, never by force."""
        return arm_or_disarm(is_arming=False)

    @abstractmethod
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> LongCommand:
        """Climbs to a height above where it stands by this snapshot.

        `is_slower`: the climb speed in force is below its own, so it is not to climb all the way by itself.

        Raises:
            HomeUnknownError: The snapshot lacks what the autopilot's height is computed from.
            WrongStateError: The autopilot would climb to another height.

        """

    @abstractmethod
    def land(self) -> LongCommand:
        """Lands where it is."""

    @abstractmethod
    def take_control(self) -> LongCommand:
        """Changes to the mode in which it follows our setpoints."""

    @abstractmethod
    def hold(self) -> LongCommand:
        """Changes to a mode in which it holds its position by itself."""

    def fly_mission(self) -> LongCommand:
        """Changes to the mode in which it flies its mission, and begins with its current item. Never arms."""
        raise NotSupportedError(f"UAL flies no missions of {self.name}")

    def version(self, message: Message) -> str:
        """Returns its version, from AUTOPILOT_VERSION."""
        return version_text(message.flight_sw_version)

    def _arm_leaving(self, snapshot: Snapshot, arm: LongCommand, armable_mode: LongCommand) -> LongCommand:
        """Returns `arm`, after `armable_mode` where the present mode forbids it."""
        mode = snapshot.control.mode_name
        if self.can_be_armed_in(mode):
            return arm
        return replace(armable_mode, what=f"leave {mode}, to be armed", then=arm)
