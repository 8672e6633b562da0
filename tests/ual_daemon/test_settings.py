from __future__ import annotations

import math
from types import MappingProxyType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.settings import ConfigError, LimitSettings, PayloadSettings, VehicleSettings, convert


def vehicle(values: dict[str, Any]) -> VehicleSettings:
    return convert(values, VehicleSettings)


def refusal(values: dict[str, Any], section: str = "") -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        convert(values, VehicleSettings, section)
    error = caught.value
    assert str(error) == (f"{error.key}: {error.message}" if error.key else error.message)
    assert "\n" not in str(error)
    return error


def test_nothing_passed_is_the_defaults() -> None:
    found = vehicle({})
    assert found == VehicleSettings()
    assert found.home_pose == (0.0, 0.0, 0.0)
    assert found.limits == LimitSettings()
    assert math.isinf(found.limits.climb_speed_m_s)


def test_passed_values_are_taken_with_their_types() -> None:
    found = vehicle(
        {
            "home_pose": [1, 2.5, -3],
            "map_origin_geo": (37, -6, 10),
            "limits": MappingProxyType({"climb_speed_m_s": 2}),
            "frames": [{"frame_id": "site/hall", "yaw_rad": 1}],
            "tolerance": {"dwell_s": 0},
        }
    )
    assert found.home_pose == (1.0, 2.5, -3.0)
    assert found.map_origin_geo == (37.0, -6.0, 10.0)
    assert found.limits.climb_speed_m_s == 2.0
    assert (found.frames[0].frame_id, found.frames[0].parent_frame_id, found.frames[0].yaw_rad) == (
        "site/hall",
        "map",
        1,
    )
    assert found.tolerance.dwell_s == 0.0


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"home": [0, 0, 0]}, "home"),
        ({"limits": {"speed": 1}}, "limits.speed"),
        ({"frames": [{"frame_id": "a"}, {"frame_id": "b", "parent": "a"}]}, "frames[1].parent"),
    ],
)
def test_an_unknown_setting_is_refused_by_its_full_name(values: dict[str, Any], key: str) -> None:
    error = refusal(values)
    assert (error.key, error.message.partition(";")[0]) == (key, "there is no such setting")


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"home_pose": [1, 2]}, "home_pose"),
        ({"home_pose": [1, 2, "3"]}, "home_pose[2]"),
        ({"home_pose": [1, 2, 1.1e7]}, "home_pose[2]"),
        ({"home_pose": {"x": 1}}, "home_pose"),
        ({"home_pose_parent_frame": "a b"}, "home_pose_parent_frame"),
        ({"home_pose_parent_frame": "map\n"}, "home_pose_parent_frame"),
        ({"home_pose_parent_frame": ""}, "home_pose_parent_frame"),
        ({"pose_frame_id": "/map"}, "pose_frame_id"),
        ({"map_origin_geo": [91, 0, 0]}, "map_origin_geo[0]"),
        ({"map_origin_geo": [0, -181, 0]}, "map_origin_geo[1]"),
        ({"limits": {"climb_speed_m_s": 0}}, "limits.climb_speed_m_s"),
        ({"limits": {"climb_speed_m_s": -1}}, "limits.climb_speed_m_s"),
        ({"limits": {"climb_speed_m_s": True}}, "limits.climb_speed_m_s"),
        ({"limits": {"climb_speed_m_s": None}}, "limits.climb_speed_m_s"),
        ({"limits": None}, "limits"),
        ({"tolerance": {"dwell_s": -0.1}}, "tolerance.dwell_s"),
        ({"frames": {"frame_id": "a"}}, "frames"),
        ({"frames": [{}]}, "frames[0]"),
        ({"frames": [{"frame_id": 7}]}, "frames[0].frame_id"),
    ],
)
def test_a_wrong_value_is_refused_by_the_name_of_its_setting(values: dict[str, Any], key: str) -> None:
    assert refusal(values).key == key


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda value: {"limits": {"climb_speed_m_s": value}}, "limits.climb_speed_m_s"),
        (lambda value: {"home_pose": [0, value, 0]}, "home_pose[1]"),
        (lambda value: {"frames": [{"frame_id": "a", "yaw_rad": value}]}, "frames[0].yaw_rad"),
        (lambda value: {"map_origin_geo": [value, 0, 0]}, "map_origin_geo[0]"),
    ],
)
def test_a_number_that_is_not_finite_is_refused(make: Any, key: str, value: float) -> None:
    assert refusal(make(value)).key == key


@pytest.mark.parametrize("degrees", [90, -7.0])
@pytest.mark.parametrize("name", ["roll_rad", "pitch_rad", "yaw_rad"])
def test_an_angle_in_degrees_is_refused(name: str, degrees: float) -> None:
    refused = refusal({"frames": [{"frame_id": "a", name: degrees}]})
    assert (refused.key, refused.message) == (
        f"frames[0].{name}",
        "is more than a full turn: give radians, not degrees",
    )
    with pytest.raises(ConfigError, match="start_yaw_rad: is more than a full turn"):
        convert({"start_yaw_rad": degrees}, LightSettings, "light")
    convert({"frames": [{"frame_id": "a", name: math.tau}]}, VehicleSettings)


def test_a_section_is_part_of_the_key() -> None:
    assert refusal({"limits": {"speed": 1}}, "uav").key == "uav.limits.speed"
    assert refusal({"frames": [{"frame_id": "a", "yaw_rad": math.nan}]}, "uav").key == "uav.frames[0].yaw_rad"
    assert refusal({"tolerance": 1}, "uav").key == "uav.tolerance"


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-10, 10) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
NAMES = st.sampled_from([*VehicleSettings.__struct_fields__, "other"])


@given(st.dictionaries(NAMES, JSON, max_size=4))
def test_whatever_is_passed_there_are_settings_or_one_error(values: dict[str, Any]) -> None:
    found: VehicleSettings | ConfigError
    try:
        found = convert(values, VehicleSettings, "uav")
    except ConfigError as error:
        found = error
    if isinstance(found, ConfigError):
        assert found.key.startswith("uav.")
        assert "\n" not in found.message


@pytest.mark.parametrize(
    ("values", "key", "message"),
    [
        ({"tracker": "pursiut"}, "tracker", "'pursiut' is not one of: reference, pursuit"),
        (
            {"pose_frame_id": "/map"},
            "pose_frame_id",
            "expected a name: letters, digits and _, beginning with a letter or _, parts joined by /",
        ),
        (
            {"limits": {"climb_sped_m_s": 2.0}},
            "limits.climb_sped_m_s",
            "there is no such setting; did you mean limits.climb_speed_m_s or limits.descent_speed_m_s?",
        ),
        (
            {"geofence": {"polygn": []}},
            "geofence.polygn",
            "there is no such setting; did you mean geofence.polygon or geofence.polygon_geo?",
        ),
        (
            {"frames": [{"place": "pad"}]},
            "frames[0].place",
            "there is no such setting; frames has frame_id, parent_frame_id, translation, roll_rad, pitch_rad, yaw_rad",
        ),
        ({"frames": [{"name": "pad"}]}, "frames[0].name", "there is no such setting; did you mean frames.frame_id?"),
        (
            {"geofence": {"corners": []}},
            "geofence.corners",
            "there is no such setting; geofence has frame_id, polygon, polygon_geo, min_height_m, max_height_m",
        ),
        ({"quartz": 1}, "quartz", "there is no such setting"),
    ],
)
def test_what_is_wrong_is_reported_in_words(values: dict[str, Any], key: str, message: str) -> None:
    error = refusal(values)
    assert (error.key, error.message) == (key, message)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"reach_m": 0}, "expected a number above 0"),
        ({"reach_m": "far"}, "expected a number, got text"),
        ({"map_origin_geo": [91, 0, 0]}, "expected a number of at most 90"),
        ({"home_pose": [1, 2]}, "expected a list of length 3, got 2"),
        ({"geofence": 3}, "expected a section, got a whole number"),
        ({"frames": {"frame_id": "hall"}}, "expected a list, got a section"),
        ({"clearance_m": -0.5}, "expected a number of at least 0"),
        ({"tolerance": {"heading_rad": 5}}, "is more than half a turn: give radians, not degrees"),
        ({"limits": {"yaw_rate_rad_s": 90}}, "is more than two turns a second: give radians a second, not degrees"),
        ({"limits": {"reach_m": 3}}, "there is no such setting; did you mean reach_m?"),
    ],
)
def test_what_is_wrong_is_reported_without_the_words_of_programmers(values: dict[str, Any], why: str) -> None:
    assert refusal(values).message == why


def test_what_was_meant_is_named_with_its_section() -> None:
    with pytest.raises(ConfigError, match=r"did you mean light\.climb_speed_m_s\?$"):
        convert({"climb_sped_m_s": 1}, LimitSettings, "light")


SERVO = {"name": "door", "channel": 9, "min_pwm_us": 1000, "max_pwm_us": 2000, "positions": {"open": 1100}}


def test_what_may_be_moved_is_named() -> None:
    payload = {
        "grippers": [{"name": "claw"}, {"name": "hand", "instance": 2}],
        "winches": [{"name": "hook", "longest_m": 20}],
        "servos": [SERVO],
        "relays": [{"name": "lamp", "number": 1, "on_name": "lit"}],
    }
    found = vehicle({"payload": payload}).payload
    assert [(each.name, each.instance) for each in found.grippers] == [("claw", 1), ("hand", 2)]
    assert (found.winches[0].longest_m, found.winches[0].fastest_m_s) == (20.0, 1.0)
    assert found.servos[0].positions == {"open": 1100}
    assert (found.relays[0].on_name, found.relays[0].off_name) == ("lit", "off")
    assert vehicle({}).payload == PayloadSettings()


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        ({"grippers": [{"name": "claw"}, {"name": "claw", "instance": 2}]}, "grippers: two of them have claw"),
        ({"grippers": [{"name": "claw"}, {"name": "hand"}]}, "grippers: two of them have instance 1"),
        ({"winches": [{"name": "a"}, {"name": "b"}]}, "winches: two of them have instance 1"),
        ({"servos": [SERVO, {**SERVO, "name": "b"}]}, "servos: two of them have channel 9"),
        ({"relays": [{"name": "a", "number": 1}, {"name": "b", "number": 1}]}, "relays: two of them have number 1"),
        ({"servos": [{**SERVO, "positions": {"open": 999}}]}, "open: 999 is not from 1000 to 2000, the bounds of door"),
        ({"servos": [{**SERVO, "min_pwm_us": 2000}]}, "2000 is not below max_pwm_us, 2000"),
        ({"servos": [{**SERVO, "channel": 0}]}, "expected a whole number of at least 1"),
        ({"servos": [{**SERVO, "max_pwm_us": 2501}]}, "expected a whole number of at most 2500"),
        ({"relays": [{"name": "a", "number": 1, "off_name": "on"}]}, "both states of a are called on"),
        ({"grippers": [{"name": "the claw"}]}, "expected a name: letters, digits and _"),
        ({"motors": []}, "there is no such setting"),
    ],
)
def test_a_payload_that_cannot_be_meant_is_refused(payload: dict[str, Any], message: str) -> None:
    error = refusal({"payload": payload})
    assert message in error.message
    assert error.key.startswith("payload")
