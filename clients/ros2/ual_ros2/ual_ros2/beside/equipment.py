"""What a UAV carries, with its bounds and positions. It needs no ROS."""

from __future__ import annotations

from collections.abc import Iterator

import ual
from ual.gripper import Equipment, WinchStatus
from ual_ros2 import payload, values
from ual_ros2.beside.fields import Fields
from ual_ros2.messages import Message


async def list_all(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListEquipment."""
    return {"devices": list(devices(await uav.gripper.get_all()))}


def devices(found: Equipment) -> Iterator[Fields]:
    """Yields a Device for each."""
    further = {
        **{("winch", each.name): _of_winch(each.status) for each in found.winches},
        **{
            ("servo", each.name): {
                "positions": [name for name, _ in each.positions],
                "pulses": [pwm_us for _, pwm_us in each.positions],
                "min_pulse": each.min_pwm_us,
                "max_pulse": each.max_pwm_us,
            }
            for each in found.servos
        },
        **{("relay", each.name): {"positions": [each.on_name, each.off_name]} for each in found.relays},
    }
    for each in payload.devices(found):
        yield {**each, **further.get((str(each["kind"]), str(each["name"])), {})}


def _of_winch(status: WinchStatus | None) -> Fields:
    return {} if status is None else {"winch": [winch_fields(status)]}


def winch_fields(status: WinchStatus) -> Fields:
    """Returns a WinchStatus."""
    return {
        "length": values.known(status.length_m),
        "speed": values.known(status.speed_m_s),
        "tension": values.known(status.tension_n),
        "voltage": values.known(status.voltage_v),
        "current": values.known(status.current_a),
        "temperature": values.known(status.temperature_c),
        "is_healthy": status.is_healthy,
        "is_fully_retracted": status.is_fully_retracted,
        "is_moving": status.is_moving,
        "is_clutch_engaged": status.is_clutch_engaged,
    }
