from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
import yaml

from ual import discovery
from ual_daemon.program import configuration, configuration_yaml
from ual_daemon.program.configuration import Configuration, ConfigurationError, FlagSource, ValuesSource
from ual_daemon.settings import ConfigError

BACKENDS = ("light", "mavlink")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path("uav.yaml")


def load(file: Path, text: str | bytes = "") -> Configuration:
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return configuration.resolve([configuration_yaml.read_file(file)], BACKENDS)


def error_of(file: Path, text: str | bytes) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load(file, text)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_nothing_passed_is_a_light_uav_on_loopback() -> None:
    found = configuration.resolve([], BACKENDS)
    assert (found.daemon.backend, found.daemon.ns) == ("light", "uav_1")
    assert found.listen == ("127.0.0.1:50051",)
    assert not found.daemon.allow_arming


@pytest.mark.parametrize(("ns", "port"), [("uav_2", 50052), ("uav_12", 50062), ("hawk", 50051), ("uav2", 50051)])
def test_the_default_port_follows_from_the_namespace(ns: str, port: int) -> None:
    assert configuration.resolve([ValuesSource({"ns": ns})], BACKENDS).listen == (f"{discovery.LOOPBACK}:{port}",)


def test_a_file_has_everything(file: Path) -> None:
    found = load(
        file,
        """
        backend: mavlink
        ns: uav_3
        url: udp:127.0.0.1:14540
        listen: ["127.0.0.1:1234", "unix:/tmp/uav_3.sock"]
        home_pose: [1, 2.5, 0]
        limits: {climb_speed_m_s: 1e0}
        frames:
          - {frame_id: field, translation: [1, 2, 3]}
        light: {speed_factor: 5}
        """,
    )
    assert found.daemon.url == "udp:127.0.0.1:14540"
    assert found.listen == ("127.0.0.1:1234", "unix:/tmp/uav_3.sock")
    assert found.vehicle.home_pose == (1.0, 2.5, 0.0)
    assert found.vehicle.limits.climb_speed_m_s == 1.0
    assert found.vehicle.frames[0].frame_id == "field"
    assert found.backends == {"light": {"speed_factor": 5}}


def test_an_empty_file_is_no_settings(file: Path) -> None:
    assert load(file, "") == load(file, "# nothing\n") == configuration.resolve([], BACKENDS)


def test_later_sources_win_key_by_key() -> None:
    below = ValuesSource({"ns": "uav_1", "limits": {"climb_speed_m_s": 1.0, "descent_speed_m_s": 1.0}})
    above = ValuesSource({"limits": {"climb_speed_m_s": 2.0}})
    found = configuration.resolve([below, above], BACKENDS)
    assert found.daemon.ns == "uav_1"
    assert (found.vehicle.limits.climb_speed_m_s, found.vehicle.limits.descent_speed_m_s) == (2.0, 1.0)


def test_printed_it_has_defaults_as_comments(file: Path) -> None:
    """A file that had them would keep them when a release changes them."""
    found = load(file, "ns: uav_7\nceiling_m: 120\ntolerance: {dwell_s: 1, speed_m_s: 0.5}\nlight: {a: 1}\n")
    text = configuration_yaml.dump(found.as_values(), found.defaults())
    assert yaml.safe_load(text) == {
        "backend": "light",
        "ns": "uav_7",
        "tolerance": {"dwell_s": 1.0},
        "light": {"a": 1},
    }
    commented = yaml.safe_load(re.sub(r"^(\s*)# ", r"\1", text, flags=re.MULTILINE))
    assert commented == yaml.safe_load(configuration_yaml.dump(found.as_values(), {}))


def test_printed_it_is_the_same_configuration_again(file: Path) -> None:
    found = load(
        file,
        "ns: uav_7\nhome_pose: [1, 2, 3]\nlimits: {climb_speed_m_s: 2}\n"
        "frames: [{frame_id: field}]\nlight: {a: [1, x]}\n",
    )
    again = load(file, configuration_yaml.dump(found.as_values(), found.defaults()))
    assert again.listen == found.listen == ("127.0.0.1:50057",)
    assert again.vehicle == found.vehicle
    assert again.backends == found.backends
    assert again.as_values() == found.as_values()
    assert math.isinf(again.vehicle.limits.descent_speed_m_s)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "ns: uav_1\nlimits:\n  climb_speed_m_s: -1\n",
            "uav.yaml:3: limits.climb_speed_m_s: expected a number above 0",
        ),
        ("ns: uav 1\n", "uav.yaml:1: ns: expected a name: letters"),
        ("\n\nnns: uav_1\n", "uav.yaml:3: nns: there is no setting and no backend with this name"),
        ("limits:\n  # no\n  speed: 1\n", "uav.yaml:3: limits.speed: there is no such setting"),
        (
            "frames:\n  - frame_id: a\n  - frame_id: 7\n",
            "uav.yaml:3: frames[1].frame_id: expected text, got a whole number",
        ),
        ("frames:\n  - parent_frame_id: a\n", "uav.yaml:2: frames[0]: Object missing required field `frame_id`"),
        ("home_pose: [1, 2]\n", "uav.yaml:1: home_pose: expected a list of length 3, got 2"),
        ("home_pose: [1, 2, .nan]\n", "uav.yaml:1: home_pose[2]:"),
        ("allow_arming: yes\n", "uav.yaml:1: allow_arming: expected true or false, got text"),
        ("light: fast\n", "uav.yaml:1: light: expected the settings of the backend, got 'fast'"),
        ("ns: a\nlight: {}\nns: b\n", "uav.yaml:3: ns: given twice, first in line 1"),
        ("limits:\n  climb_speed_m_s: 1\n  climb_speed_m_s: 2\n", "uav.yaml:3: limits.climb_speed_m_s: given twice"),
        ("1: a\n", "uav.yaml:1: a key must be text"),
        ("ns: [a\nurl: b\n", "uav.yaml:2: while parsing a flow sequence"),
        ("ns: a\n\turl: b\n", "uav.yaml:2: while scanning for the next token"),
        ("- a\n", "uav.yaml:1: expected settings as 'key: value' lines"),
        ("just words\n", "uav.yaml:1: expected settings as 'key: value' lines"),
        ("ns: *nobody\n", "uav.yaml:1: found undefined alias 'nobody'"),
        ("frames: &a [*a]\n", "uav.yaml:1: frames[0]: the value contains itself"),
        ("ns: !!python/object:os.system x\n", "uav.yaml:1: could not determine a constructor"),
        ("ns: a\nurl: " + "[" * 50_000, "uav.yaml:2: values are nested too deeply"),
        ("ns: a\nurl: !!int x\n", "uav.yaml:2: 'x' is not a valid int"),
        ("fleet: 8_0\n", "uav.yaml:1: fleet: expected a whole number, got text"),
        ("fleet: !!int 8_0\n", "uav.yaml:1: '8_0' is not a valid int"),
        ("fleet: !!int 1:20\n", "uav.yaml:1: '1:20' is not a valid int"),
        ("reach_m: !!float 1_0\n", "uav.yaml:1: '1_0' is not a valid float"),
        ("fleet: !!int [1]\n", "uav.yaml:1: "),
        ("ns: a\nurl: !!timestamp x\n", "uav.yaml:2: 'x' is not a valid timestamp"),
        ("ns: a\nurl: " + "9" * 5000, "uav.yaml:2: '9999"),
        ("ns: a\n---\nns: b\n", "uav.yaml:2: expected a single document"),
        (b"ns: uav_1\nurl: caf\xe9\n", "uav.yaml:2: byte 0xe9 is not UTF-8 text"),
        ("ns: a\nurl: \x07\n", "uav.yaml:2: character 0x0007 is not allowed"),
    ],
)
def test_what_is_wrong_is_one_message_with_file_row_and_key(file: Path, text: str | bytes, expected: str) -> None:
    assert error_of(file, text).startswith(expected)


def test_a_file_that_cannot_be_read_says_why(file: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"uav\.yaml: cannot be read: No such file"):
        configuration_yaml.read_file(file)
    with pytest.raises(ConfigurationError, match=r"cannot be read: Is a directory"):
        configuration_yaml.read_file(tmp_path)


def test_a_byte_order_mark_is_no_part_of_the_text(file: Path) -> None:
    assert load(file, b"\xef\xbb\xbfns: uav_4\n").daemon.ns == "uav_4"


def test_numbers_and_words_are_read_as_yaml_1_2_does(file: Path) -> None:
    values = load(file, "light: {a: 1e3, b: 12:30, c: on, d: 0x10, e: 2026-01-01, f: ~, g: .inf, h: 010}\n").backends
    assert values == {
        "light": {"a": 1000.0, "b": "12:30", "c": "on", "d": 16, "e": "2026-01-01", "f": None, "g": math.inf, "h": 10.0}
    }


def test_an_error_is_reported_where_the_winning_value_was_passed(file: Path) -> None:
    file.write_text("ns: uav_1\nurl: a\n")
    flags = FlagSource({"ns": "b c"}, {"ns": "--ns"})
    with pytest.raises(ConfigurationError, match=r"^--ns: expected"):
        configuration.resolve([configuration_yaml.read_file(file), flags], BACKENDS)


def test_an_error_found_later_is_reported_with_its_position_too(file: Path) -> None:
    file.write_text("ns: uav_1\nlight:\n  wind:\n    - 1\n    - x\n")
    source = configuration_yaml.read_file(file)

    def located(key: str) -> str:
        return str(configuration.located(ConfigError("no", key), [source]))

    assert located("light.wind[1]") == "uav.yaml:5: light.wind[1]: no"
    assert located("light.wind[7]") == "uav.yaml:3: light.wind[7]: no"
    assert located("light.other") == "uav.yaml:2: light.other: no"
    assert located("backend") == "backend: no"
    assert located("") == "no"


def test_an_assignment_sets_any_key() -> None:
    key, value = configuration_yaml.assignment("limits.climb_speed_m_s=2", "--set")
    assert configuration.nested(key, value) == {"limits": {"climb_speed_m_s": 2}}
    assert configuration_yaml.assignment("home_pose=[1, 2, 3]", "--set") == ("home_pose", [1, 2, 3])
    assert configuration_yaml.assignment("url=", "--set") == ("url", None)
    assert configuration_yaml.assignment("url=a=b", "--set") == ("url", "a=b")


@pytest.mark.parametrize("text", ["ns", "=1", "a..b=1", "a b=1", "a=[1", "a={b: 1, b: 2}", "a=!!int x"])
def test_a_bad_assignment_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"^--set") as caught:
        configuration_yaml.assignment(text, "--set")
    assert "\n" not in str(caught.value)


def test_the_example_of_the_manual_is_a_configuration(file: Path) -> None:
    manual = (Path(__file__).parents[3] / "docs" / "reference" / "configuration.md").read_text()
    example = manual.partition("```yaml\n")[2].partition("```")[0]
    found = load(file, example)
    assert found.listen == ("127.0.0.1:50052", "unix:/run/ual/uav_2.sock")
    assert found.vehicle.limits.horizontal_speed_m_s == 3.0
