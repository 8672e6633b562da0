"""Payload of a UAV in a recording: the attitudes of its gimbals, and the states of its grippers, winches, servos and
relays.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from ual.errors import NotSupportedError, UalError
from ual.geometry import Pose, Transform, Vector3
from ual.gimbals import GimbalInfo
from ual.gripper import Equipment
from ual.interface import Gimbals, Gripper
from ual.recording.recorder import Entry, Output, Recorder
from ual.recording.telemetry import stamp_of, transform_of
from ual.recording.topics import of_protobuf
from ual.shared.guard import WorkGuard
from ual.types import Frame
from ual.v1 import gripper_pb2 as pb
from ual.wire import gripper as convert

_EQUIPMENT_CHECK_S = 1.0
"""Seconds between two searches for new gimbals, and between repeated questions where something did not answer."""
_STATUS_RATE_HZ = 5.0
"""Recorded attitudes of a gimbal per second."""
_EQUIPMENT_S = 2.0
"""Seconds between two questions for the states: some autopilots are asked over their link."""


class GimbalTopic:
    """Writes where one gimbal looks: the frame that turns with it, x along its view, y left, z up."""

    def __init__(self, frame_id: str) -> None:
        self._transforms = of_protobuf(f"/{frame_id}/tf", FrameTransforms)

    def write(self, output: Output, entry: Entry) -> None:
        """Writes where the frame is in the body."""
        looked: Transform = entry.value
        stamp_ns = round(looked.stamp_s * 1e9)
        pose = Pose(looked.translation, looked.rotation)
        frame = transform_of(stamp_of(stamp_ns), looked.frame_id, looked.child_frame_id, pose)
        data = FrameTransforms(transforms=[frame]).SerializeToString()
        output.write(self._transforms, data, entry.log_ns, stamp_ns)


class EquipmentTopic:
    """Writes the states of grippers, winches, servos and relays."""

    def __init__(self, ns: str) -> None:
        self._topic = of_protobuf(f"/{ns}/equipment", pb.GetEquipmentResponse)

    def write(self, output: Output, entry: Entry) -> None:
        """Writes all of them."""
        found: Equipment = entry.value
        data = convert.equipment_to_proto(found).SerializeToString()
        output.write(self._topic, data, entry.log_ns, entry.log_ns)


class PayloadRecorder:
    """Records what one UAV carries, from `start` to `close`. Threads of its own ask, and end where there is nothing.

    Args:
        ns: Of the UAV.
        gimbals: Its gimbals.
        gripper: What it holds, drops and switches with.
        frames: Returns its frames: where the gimbals are in the body.
        recorder: Writes it.

    """

    def __init__(
        self, ns: str, gimbals: Gimbals, gripper: Gripper, frames: Callable[[], Sequence[Frame]], recorder: Recorder
    ) -> None:
        self._ns = ns
        self._gimbals = gimbals
        self._gripper = gripper
        self._frames = frames
        self._recorder = recorder
        self._equipment_topic = EquipmentTopic(ns)
        self._equipment: Equipment | None = None
        self._watched: set[int] = set()
        self._closing = threading.Event()
        self._guard = WorkGuard("carried")
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []
        """Threads that were started."""
        recorder.at_each_file(self._repeat)

    def start(self) -> None:
        """Begins."""
        self._begin(self._watch_new_gimbals, _EQUIPMENT_CHECK_S)
        self._begin(self._record_equipment, _EQUIPMENT_S)

    def close(self, limit_s: float = 3.0) -> None:
        """Ends, once what is asked has been answered, or after a limit."""
        with self._lock:
            self._closing.set()
        for each in self._threads:
            each.join(limit_s)

    def _begin(self, check: Callable[[], bool], period_s: float) -> None:
        thread = threading.Thread(target=self._run, args=(check, period_s), name=f"carried by {self._ns}", daemon=True)
        with self._lock:  # none begins once it closes
            if not self._closing.is_set():
                thread.start()
                self._threads.append(thread)

    def _run(self, check: Callable[[], bool], period_s: float) -> None:
        """Looks repeatedly, as long as that says that there may be something."""
        is_on = True
        while is_on and not self._closing.wait(period_s):
            try:
                is_on = check()
            except NotSupportedError:  # by this backend: so it stays
                return
            except UalError:  # what cannot be had now is requested again
                continue
            except Exception as error:  # noqa: BLE001  nor does what a device tells end its thread
                self._guard.note(error)

    # --- Gimbals ------------------------------------------------------------------------------------------------------

    def _watch_new_gimbals(self) -> bool:
        """Begins to watch those that are new."""
        for info in self._gimbals.get_all():
            if info.number not in self._watched:
                self._watched.add(info.number)
                self._begin(partial(self._watch, info, GimbalTopic(info.frame_id)), _EQUIPMENT_CHECK_S)
        return True

    def _watch(self, info: GimbalInfo, topic: GimbalTopic) -> bool:
        """Records where a gimbal looks, until it does not answer."""
        position = self._position(info.frame_id)
        if position is None:
            return True
        for status in self._gimbals[info.number].watch(_STATUS_RATE_HZ):
            if status.in_body is not None and status.stamp_s is not None:
                looked = Transform(position, status.in_body, f"{self._ns}/base_link", info.frame_id, status.stamp_s)
                self._recorder.put(topic.write, self._recorder.clock.now_ns(), looked)
            if self._closing.is_set():
                return False
        return True

    def _position(self, frame_id: str) -> Vector3 | None:
        """Returns where a gimbal is in the body; None while that is not reported, as it does not say where it looks."""
        found = {each.frame_id: each.transform for each in self._frames()}
        transform = found.get(frame_id)
        return None if transform is None else transform.translation

    # --- Grippers, winches, servos, relays ----------------------------------------------------------------------------

    def _record_equipment(self) -> bool:
        """Records the states, if they have changed.

        Where there are none it asks again: the daemon may be started again, with others in its configuration.
        """
        found = self._gripper.get_all()
        if found != (self._equipment or Equipment()):
            self._equipment = found
            self._recorder.put(self._equipment_topic.write, self._recorder.clock.now_ns(), found)
        return True

    def _repeat(self) -> None:
        """Has the states recorded again in the next file."""
        self._equipment = None
