"""Files about parameters: as PX4's build and ArduPilot's server make them, and damaged in any way."""

from __future__ import annotations

import json
import lzma
import os
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simulators.parameter_files import DESCRIBED, GENERAL, PARAMETERS, described, packed
from ual.parameters import Description, Parameter, ParameterType
from ual_daemon.backends.mavlink.dialects.parameter_files import (
    LARGEST_FILE_BYTES,
    descriptions,
    file_path,
    packed_list,
    parameters_uri,
    unpacked,
)

FUZZ_COUNT = int(os.environ.get("UAL_TEST_FUZZ", "10000"))
NAMES = st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True)
VALUES = st.one_of(st.integers(-(2**31), 2**31 - 1), st.floats(width=32, allow_nan=False))


def test_the_descriptions_of_px4_are_found_by_the_general_file() -> None:
    files, crc = described()
    place = parameters_uri(unpacked(files[GENERAL], crc))
    assert place is not None
    assert file_path(place[0]) == PARAMETERS
    found = descriptions(unpacked(files[PARAMETERS], place[1]))
    assert found.keys() == DESCRIBED.keys()
    assert found["MPC_XY_CRUISE"] == Description(3.0, 20.0, "m/s", "Default horizontal velocity in Missions", False)
    assert found["EKF2_EV_CTRL"].needs_reboot
    assert found["MPC_LAND_SPEED"].maximum is None


@pytest.mark.parametrize(
    ("uri", "path"),
    [
        ("mftp://etc/extras/x.json.xz", "etc/extras/x.json.xz"),
        ("mftp://[;comp=1]/x.json", "/x.json"),
        ("mftp://[;comp=100]/x.json", None),
        ("https://example.com/x.json", None),
        ("http://example.com/x.json", None),
        ("file:///etc/passwd", None),
        ("mftp://", None),
        ("", None),
    ],
)
def test_only_files_of_the_autopilot_itself_are_read(uri: str, path: str | None) -> None:
    assert file_path(uri) == path


def test_a_wrong_checksum_and_a_damaged_or_endless_file_are_errors() -> None:
    files, crc = described()
    data = files[PARAMETERS]
    with pytest.raises(ValueError, match="checksum"):
        unpacked(files[GENERAL], crc + 1)
    for damaged in (data[:-20], data[:40] + b"\0" * 8 + data[48:], data[:6]):
        with pytest.raises(ValueError, match=r"damaged|cut off"):
            unpacked(damaged, 0)
    with pytest.raises(ValueError, match="cut off"):
        unpacked(lzma.compress(bytes(LARGEST_FILE_BYTES + 1)), 0)
    assert unpacked(b"{}", 0) == b"{}"


def test_what_cannot_be_a_description_is_left_out() -> None:
    rows = [
        {"name": "A", "min": "low", "max": True, "units": 5, "shortDesc": ["x"], "rebootRequired": "yes"},
        {"name": "B", "min": float("nan"), "max": 10**400, "shortDesc": "two\nlines"},
        {"name": 7},
        "C",
        {"min": 1},
    ]
    found = descriptions(json.dumps({"parameters": rows}).encode())
    assert found == {"A": Description(), "B": Description(text="two lines")}
    for content in (b"", b"[]", b"{}", b'{"parameters": {}}', b"\xff", b"[" * 100_000):
        with pytest.raises(ValueError):  # noqa: PT011  json has words of its own
            descriptions(content)
    assert parameters_uri(b'{"metadataTypes": [{"type": 1, "uri": 5}, {"type": 4, "uri": "x"}, 7]}') is None


@given(st.dictionaries(NAMES, VALUES, max_size=120))
def test_the_packed_list_is_read_as_ardupilot_packs_it(parameters: dict[str, float]) -> None:
    found = packed_list(packed(parameters))
    kinds = {int: ParameterType.INT32, float: ParameterType.REAL32}
    assert found == [Parameter(name, value, kinds[type(value)]) for name, value in parameters.items()]


def test_a_list_that_is_not_whole_is_an_error() -> None:
    data = packed({f"NAME_{number}": float(number) for number in range(200)})
    for damaged in (
        b"",
        data[:3],
        data[:-1],
        data[:-7],
        b"\0\0" + data[2:],
        data + b"\x09\x00",
        data[:2] + b"\0" + data[3:],
    ):
        with pytest.raises(ValueError, match="the list"):
            packed_list(damaged)


def test_no_bytes_break_the_readers() -> None:
    noise = random.Random(1)
    whole = [packed({"A_B": 1.0, "A_BC": 3}), *described()[0].values(), b'{"parameters": [{"name": "A", "min": 1}]}']
    for _ in range(FUZZ_COUNT):
        data = bytearray(noise.choice(whole))
        for _ in range(noise.choice((1, 3, 20))):
            data[noise.randrange(len(data))] = noise.randrange(256)
        for read in (packed_list, descriptions, parameters_uri, lambda each: unpacked(each, 0)):
            try:
                read(bytes(data))
            except ValueError:
                continue
