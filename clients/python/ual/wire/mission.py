"""Between the messages of ``mission.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, MissionStage, StoredMission
from ual.v1 import mission_pb2 as pb
from ual.wire import convert, mission_items
from ual.wire.enums import member_of, number_of

_LINK_LOSS_ACTION: Mapping[int, LinkLossAction] = {each.value: each for each in LinkLossAction}

_MISSION_STAGE: Mapping[int, MissionStage] = {each.value: each for each in MissionStage}


def link_loss_action_to_proto(value: LinkLossAction, field: str) -> pb.LinkLossAction.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.LinkLossAction.ValueType(number_of(value, LinkLossAction, field))


def link_loss_action_from_proto(number: int, field: str) -> LinkLossAction:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _LINK_LOSS_ACTION, field)


def mission_plan_to_proto(value: MissionPlan) -> pb.MissionPlan:
    """Makes a message."""
    return pb.MissionPlan(
        length_m=value.length_m,
        duration=convert.duration_to_proto(value.duration_s),
        lowest_m=value.lowest_m,
        highest_m=value.highest_m,
        executed_count=value.executed_count,
    )


def mission_plan_from_proto(message: pb.MissionPlan) -> MissionPlan:
    """Reads a message."""
    return MissionPlan(
        message.length_m,
        convert.duration_from_proto(message.duration),
        message.lowest_m,
        message.highest_m,
        message.executed_count,
    )


def stored_mission_to_proto(value: StoredMission) -> pb.StoredMission:
    """Makes a message."""
    return pb.StoredMission(
        items=map(mission_items.item_to_proto, value.items),
        digest=value.digest,
    )


def stored_mission_from_proto(message: pb.StoredMission) -> StoredMission:
    """Reads a message."""
    return StoredMission(
        tuple(map(mission_items.item_from_proto, message.items)),
        message.digest,
    )


def mission_progress_to_proto(value: MissionProgress) -> pb.MissionProgress:
    """Makes a message."""
    return pb.MissionProgress(
        stage=pb.MissionStage.ValueType(value.stage.value),
        item=value.item,
        reached=value.reached,
        task_id=value.task_id,
    )


def mission_progress_from_proto(message: pb.MissionProgress) -> MissionProgress:
    """Reads a message."""
    return MissionProgress(
        _MISSION_STAGE.get(message.stage, MissionStage.UNKNOWN),
        message.item if message.HasField("item") else None,
        message.reached if message.HasField("reached") else None,
        message.task_id,
    )
