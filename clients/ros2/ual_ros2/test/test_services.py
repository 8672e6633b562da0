"""Services of a light UAV other than flying: topics that publish while they have subscribers, and the services of its
simulation.
"""

from __future__ import annotations

import array
from collections.abc import Iterator

import pytest
from conftest import ARMED_FAST, Processes
from flying import Client, waited
from geometry_msgs.msg import PointStamped
from reading import error_of
from ros_services import Asking, ServicesOverRos
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger
from ual_msgs import action, msg, srv

import ual
from ual.simulation import AckLate, BatteryLow, Command, SimulationPart

UAL = "/uav_1/ual"
CARRIED = """\
light: {cameras: [{width_px: 64, height_px: 48}]}
payload: {grippers: [{name: claw}], winches: [{name: hook}]}
"""


@pytest.fixture(scope="module")
def uav(processes: Processes, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ual.Uav]:
    file = tmp_path_factory.mktemp("carried") / "daemon.yaml"
    file.write_text(CARRIED)
    processes.daemon(*ARMED_FAST, "--config", str(file))
    processes.node("ns:=uav_1", "slow_rate_hz:=20.0")
    with ual.Uav("uav_1") as uav:
        yield uav


def test_gimbals_are_reported_while_they_are_received(client: Client, uav: ual.Uav) -> None:
    told = client.hear(msg.GimbalStatus, f"{UAL}/gimbals", 10)
    assert client.call(srv.SetGimbalAngles, f"{UAL}/set_gimbal_angles", pitch=0.5, yaw=-0.25).success
    waited(lambda: told and abs(told[-1].pitch - 0.5) < 0.01 and abs(told[-1].yaw + 0.25) < 0.01)
    assert (told[-1].gimbal, told[-1].activity, told[-1].header.frame_id) == (0, "ANGLES", "uav_1/base_link")
    target = PointStamped()
    target.header.frame_id, target.point.x, target.point.z = "map", 10.0, -1.0
    assert client.call(srv.PointGimbal, f"{UAL}/point_gimbal", point=target).success
    waited(lambda: told[-1].activity == "POINT" and told[-1].off_target < 0.05)
    assert told[-1].target.header.frame_id == "map"
    limit = uav.gimbals.get_all()[0].pitch
    assert limit is not None
    refused = client.call(srv.SetGimbalAngles, f"{UAL}/set_gimbal_angles", pitch=limit.most_rad + 0.1)
    with pytest.raises(ual.InvalidArgumentError) as same:
        uav.gimbals[0].set_angles(limit.most_rad + 0.1)
    in_ros = same.value.message.replace("pitch_rad", "pitch")  # the request's own field
    assert (refused.reason, refused.message) == ("INVALID_ARGUMENT", in_ros)


def test_each_picture_that_is_taken_is_reported_once(client: Client, uav: ual.Uav) -> None:
    before = uav.cameras[0].take_photo()
    told = client.hear(msg.Photo, f"{UAL}/photos", 10)

    def comes() -> bool:
        uav.cameras[0].take_photo()
        return bool(told)

    waited(comes)
    last = uav.cameras[0].take_photo()
    waited(lambda: told[-1].number == last.number)
    numbers = [each.number for each in told]
    assert numbers == list(range(numbers[0], last.number + 1))
    assert numbers[0] > before.number
    assert told[-1].viewpoint.body.header.frame_id == "uav_1/odom"


def test_what_it_carries_is_reported(client: Client, uav: ual.Uav) -> None:
    told = client.hear(msg.Equipment, f"{UAL}/equipment", 10)
    uav.gripper.grip("claw")
    waited(lambda: told and told[-1].devices[0].ordered == "grip")
    assert [(each.kind, each.name) for each in told[-1].devices] == [("gripper", "claw"), ("winch", "hook")]
    assert told[-1].header.stamp.sec > 0


def test_corrections_are_counted_and_another_program_that_sends_is_named(client: Client, uav: ual.Uav) -> None:
    told = client.hear(msg.CorrectionsStatus, f"{UAL}/corrections_status", 10)
    message = UInt8MultiArray(data=array.array("B", b"no RTCM"))
    client.publish(UInt8MultiArray, f"{UAL}/corrections", message, 100)
    waited(lambda: told and told[-1].sender == "ual_ros2" and told[-1].received_count == 1)
    with pytest.raises(ual.ResourceExhaustedError, match="ual_ros2"):
        uav.corrections.stream([b"mine"], "another")


@pytest.mark.usefixtures("uav")
def test_no_log_is_written_where_the_node_was_passed_no_directory(client: Client) -> None:
    result = client.fly(action.DownloadLog, f"{UAL}/download_log", log_id="1")[1]
    assert (result.success, result.reason) == (False, "PERMISSION_DENIED")
    assert "log_directory" in result.message


def test_the_simulation_is_available_for_a_uav_that_is_simulated(client: Client, armed: ual.Uav) -> None:
    def call(kind: type, name: str, /, **fields: object) -> object:
        answer = client.call(kind, f"{UAL}/{name}", **fields)
        if not answer.success:
            raise error_of(answer)
        return answer

    def trigger(name: str) -> None:
        assert client.call(Trigger, f"{UAL}/{name}").success

    world = ServicesOverRos(Asking(client, "uav_1", call, trigger), lambda _: pytest.fail("it flies")).simulation
    assert world.parts() == armed.simulation.parts() >= {SimulationPart.PLACE, SimulationPart.FAULTS}
    fault_id = world.begin_fault(AckLate(Command.LAND, 0.5))
    assert world.faults() == {fault_id: AckLate(Command.LAND, 0.5)}
    world.end_fault(fault_id)
    world.begin_fault(BatteryLow(25.0), 0.01)
    world.end_fault()
    assert not armed.simulation.faults()
    world.set_wind(ual.Vector3(0.0, 0.0, 0.0))
    world.set_noise(position_m=0.0, velocity_m_s=0.0)
    world.pilot_take_over()
    world.pilot_move_sticks(forward=0.0)
    world.pilot_give_back()
    world.place_on_ground(ual.Vector3(3.0, 4.0, 0.0), 1.0)
    waited(lambda: (armed.pose().pose.position - ual.Vector3(3.0, 4.0, 0.0)).norm() < 0.3)
    with pytest.raises(ual.InvalidArgumentError):
        world.set_speed_factor(-1.0)
    refused = client.call(srv.BeginFault, f"{UAL}/simulation/begin_fault", fault=msg.Fault(kind="FIRE"))
    assert (refused.reason, "LINK_LOST" in refused.message) == ("INVALID_ARGUMENT", True)
