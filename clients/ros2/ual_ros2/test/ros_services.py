"""Services of a UAV other than flying, by ROS only: the part of `ros_uav.RosUav` that follows from the contract.

By hand stands what ROS has in another form: topics, actions, files, and lists that come in parts.
"""

from __future__ import annotations

import array
import hashlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from derived_members import MEMBERS
from derived_values import (
    ask_get_image,
    ask_list_photos,
    read_gimbal_status,
    read_mission_progress,
    read_winch_status,
)
from flying import Client, each_of, waited
from inexpressible import InexpressibleError
from reading import error_of, intrinsics, number, read_viewpoint
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger
from ual_msgs import action, msg, srv

import ual
import ual.interface
from ual.cameras import Image, ImageFormat, ImageKind, Photo
from ual.corrections import CorrectionsStatus
from ual.fences import FencePlan, KeptFence
from ual.gimbals import GimbalStatus
from ual.gripper import Equipment, GripperInfo, GripperState, RelayInfo, ServoInfo, WinchInfo
from ual.logs import LogChunk
from ual.missions import LinkLossAction, MissionProgress
from ual.simulation import Fault
from ual_ros2.derived.values import fence_zone_fields, rally_point_fields, read_fault
from ual_ros2.ros_time import RosTime
from ual_ros2.services.filling import Filling


class Asking:
    """Calls the services of a node.

    Args:
        client: The program in ROS.
        ns: The name of the UAV.
        call: Calls one, by its type and name.
        trigger: Calls one that has no request.

    """

    def __init__(self, client: Client, ns: str, call: Callable[..., Any], trigger: Callable[[str], None]) -> None:
        self.client = client
        self.topics = f"/{ns}/ual"
        self._filling = Filling(RosTime(client.node.get_clock()))
        self._call = call
        self._trigger = trigger

    def ask(self, kind: Any, name: str, /, **fields: Any) -> Any:
        """Calls a service with fields, and returns its answer."""
        if kind is Trigger:
            return self._trigger(name)
        return self._call(kind, name, **self.filled(kind.Request, fields))

    def filled(self, make: Callable[[], Any], fields: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns fields as a message has them."""
        return self._filling.to_messages(make)(fields)


class Part:
    """A part of `ual.interface.Uav`: each of its members that follows from the contract asks by its service."""

    def __init__(self, asking: Asking, name: str, number: int | None = None) -> None:
        self._asking = asking
        self._name = name
        self._which = {} if number is None else {name: number}

    def __getattr__(self, member: str) -> Callable[..., Any]:
        if (self._name, member) not in MEMBERS:
            raise AttributeError(member)
        found = MEMBERS[self._name, member]
        signature = inspect.signature(getattr(getattr(ual.interface, self._name.capitalize()), member))

        def ask(*positional: Any, **named: Any) -> Any:
            bound = signature.bind(self, *positional, **named)
            bound.apply_defaults()
            arguments = {name: value for name, value in bound.arguments.items() if name != "self"}
            fields = {**self._which, **found.ask(**arguments)}
            return found.read(self._asking.ask(found.kind, found.name, **fields))

        return ask


class Parts(Part):
    """All cameras, or all gimbals."""

    def __init__(self, asking: Asking, name: str, one: type[Part]) -> None:
        super().__init__(asking, name)
        self._one = one

    def __getitem__(self, number: int) -> Part:
        return self._one(self._asking, self._name.removesuffix("s"), number)

    def __iter__(self) -> Iterator[Part]:
        return (self[each.number] for each in self.get_all())


class RosCamera(Part):
    """A camera."""

    def photos(self, first: int = 0) -> list[Photo]:
        """An answer has the first ones only: so the others are asked for."""
        found: list[Photo] = []
        member = MEMBERS["camera", "photos"]
        while more := member.read(
            self._asking.ask(member.kind, member.name, **self._which, **ask_list_photos(first=first))
        ):
            found += more
            first = found[-1].number + 1
        return found

    def image(self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0) -> Image:
        fields = ask_get_image(photo=photo, kind=kind, max_age_s=max_age_s)
        answer = self._asking.ask(srv.GetImage, "get_image", **self._which, **fields)
        is_distances = bool(answer.distances.data)
        return Image(
            bytes(answer.distances.data if is_distances else answer.compressed.data),
            ImageFormat.FLOAT32 if is_distances else ImageFormat[answer.compressed.format.upper()],
            answer.camera_info.width,
            answer.camera_info.height,
            intrinsics=intrinsics(answer.camera_info),
            kind=kind,
            **read_viewpoint(answer.viewpoint),
        )


class RosGimbal(Part):
    """A gimbal."""

    def watch(self, rate_hz: float = 10.0) -> Iterator[GimbalStatus]:
        """The topic has a rate of its own."""
        for told in each_of(self._asking.client.hear(msg.GimbalStatus, f"{self._asking.topics}/gimbals", 10)):
            if told.gimbal == self._which["gimbal"]:
                yield read_gimbal_status(told)


class RosGripper(Part):
    """Grippers, winches, servos and relays."""

    def get_all(self) -> Equipment:
        return equipment_of(self._asking.ask(srv.ListEquipment, "list_equipment").devices)


def equipment_of(devices: Any) -> Equipment:
    """Returns the equipment of a list of devices."""

    def made(kind: str, make: Callable[[Any], Any]) -> tuple[Any, ...]:
        return tuple(make(each) for each in devices if each.kind == kind)

    return Equipment(made("gripper", _gripper), made("winch", _winch), made("servo", _servo), made("relay", _relay))


def _gripper(device: Any) -> GripperInfo:
    state = GripperState[device.state] if device.state else GripperState.UNKNOWN
    return GripperInfo(device.name, state, device.ordered, device.note)


def _winch(device: Any) -> WinchInfo:
    return WinchInfo(device.name, next(map(read_winch_status, device.winch), None), device.ordered, device.note)


def _servo(device: Any) -> ServoInfo:
    positions = tuple(zip(device.positions, map(int, device.pulses), strict=True))
    pwm_us = number(device.value)
    return ServoInfo(
        device.name,
        device.min_pulse,
        device.max_pulse,
        positions,
        None if pwm_us is None else int(pwm_us),
        device.state,
        device.ordered,
        device.note,
    )


def _relay(device: Any) -> RelayInfo:
    on_name, off_name = device.positions
    is_on = device.state == on_name if device.state else None
    return RelayInfo(device.name, on_name, off_name, is_on, device.ordered, device.note)


class RosFence(Part):
    """The fence that the autopilot keeps."""

    def upload(
        self, plan: FencePlan | None = None, *, replace: bool = False, enable: bool = True, force: bool = False
    ) -> KeptFence:
        fields: dict[str, Any] = {"is_configured": plan is None, "replace": replace, "is_only_kept": not enable}
        if plan is not None:
            fields["zones"] = list(map(fence_zone_fields, plan.zones))
            fields["rally_points"] = list(map(rally_point_fields, plan.rally_points))
        return self._kept(srv.UploadFence, "upload_fence", force=force, **fields)

    def enable(self) -> KeptFence:
        return self._kept(srv.EnableFence, "enable_fence", enable=True)

    def disable(self) -> KeptFence:
        return self._kept(srv.EnableFence, "enable_fence", enable=False)

    def _kept(self, kind: Any, name: str, /, **fields: Any) -> KeptFence:
        kept: KeptFence = MEMBERS["fence", "get"].read(self._asking.ask(kind, name, **fields))
        return kept


class RosMission(Part):
    """The mission of the autopilot."""

    def __init__(self, asking: Asking, fly: Callable[[dict[str, Any]], ual.TaskInfo]) -> None:
        super().__init__(asking, "mission")
        self._fly = fly

    def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> ual.TaskInfo:
        if first_item == 0:  # which begins with the first one in ROS, as in the contract
            raise ual.InvalidArgumentError("first_item: items are counted from 1", {"field": "first_item"})
        fields = MEMBERS["mission", "start"].ask(first_item=first_item, on_link_loss=on_link_loss)
        return self._fly(dict(fields))

    def watch(self) -> Iterator[MissionProgress]:
        newest = None
        topic = f"{self._asking.topics}/mission"
        for progress in map(read_mission_progress, each_of(self._asking.client.hear(msg.MissionProgress, topic, 10))):
            if progress != newest:
                newest = progress
                yield progress


class RosLogs(Part):
    """The logs of the autopilot. The node writes them on this computer."""

    def download(self, log_id: str, offset: int = 0) -> Iterator[LogChunk]:
        if offset:
            raise InexpressibleError("offset")
        name = f"{self._asking.topics}/download_log"
        _, result = self._asking.client.fly(action.DownloadLog, name, log_id=log_id)
        if not result.success:
            raise error_of(result)
        data = Path(result.file).read_bytes()
        assert hashlib.sha256(data).hexdigest() == result.sha256
        [log] = [each for each in self.get_all() if each.id == log_id]
        yield LogChunk(log, 0, data, result.sha256)


class RosCorrections(Part):
    """The corrections for the receiver, by the topic and the service of the node."""

    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        """Publishes all of it, and waits until the node, which is the sender, has ended its stream."""
        count = self._ask().received_count
        for each in rtcm:
            message = UInt8MultiArray(data=array.array("B", each))
            self._asking.client.publish(UInt8MultiArray, f"{self._asking.topics}/corrections", message, 100)
            count += 1
        waited(lambda: self._ask().received_count == count and not self._ask().sender)
        status: CorrectionsStatus = self.status()
        return status

    def _ask(self) -> Any:
        return self._asking.ask(srv.GetCorrectionsStatus, "get_corrections_status").status


class RosSimulation(Part):
    """The world around a simulated UAV."""

    def faults(self) -> dict[str, Fault]:
        listed = self._asking.ask(srv.ListFaults, "simulation/list_faults").faults
        return {each.fault_id: read_fault(each) for each in listed}


class ServicesOverRos:
    """The services beside flying of one UAV.

    Args:
        asking: Calls its services.
        fly: Begins to fly the mission that its autopilot has.

    """

    def __init__(self, asking: Asking, fly: Callable[[dict[str, Any]], ual.TaskInfo]) -> None:
        parts = _any(asking)
        self.cameras: ual.interface.Cameras = parts(Parts, "cameras", RosCamera)
        self.corrections: ual.interface.Corrections = parts(RosCorrections, "corrections")
        self.fence: ual.interface.Fence = parts(RosFence, "fence")
        self.gimbals: ual.interface.Gimbals = parts(Parts, "gimbals", RosGimbal)
        self.gripper: ual.interface.Gripper = parts(RosGripper, "gripper")
        self.logs: ual.interface.Logs = parts(RosLogs, "logs")
        self.mission: ual.interface.Mission = parts(RosMission, fly)
        self.simulation: ual.interface.Simulation = parts(RosSimulation, "simulation")
        self._asking = asking

    def __getattr__(self, name: str) -> Part:
        """Returns a service of which all follows from the contract."""
        return Part(self._asking, name)


def _any(asking: Asking) -> Callable[..., Any]:
    """Returns what makes parts, whose members a type checker does not know."""
    return lambda kind, *arguments: kind(asking, *arguments)
