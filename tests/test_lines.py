"""Handwritten lines of the product, as `tools/lines.py` counts them."""

from __future__ import annotations

from collections import Counter

import pytest

from tools import lines


@pytest.mark.parametrize(
    ("path", "is_product"),
    [
        ("ual_daemon/ual.py", True),
        ("clients/python/ual_tools/main.py", True),
        ("clients/ros2/ual_msgs/srv/Land.srv", True),
        ("clients/ros2/ual_ros2/test/flying.py", False),
        ("clients/ros2/ual_ros2/examples/two_uavs.py", False),
        ("clients/python/ual/v1/ual_pb2.py", False),
        ("clients/python/README.md", False),
        ("benchmarks/guard/__main__.py", False),
    ],
)
def test_the_product_is_what_is_installed_and_written_by_hand(path: str, is_product: bool) -> None:
    assert lines.is_product(path) is is_product


def test_what_a_tool_has_written_does_not_count() -> None:
    by_hand = ("ual_daemon/a.py", b'"""A."""\n\nX = 1\n')
    by_tool = ("ual_daemon/b.py", b'"""B. ``make clients`` writes this file: do not edit it."""\n')
    assert lines.count([by_hand, by_tool]) == Counter({"ual_daemon": 3})


def test_each_generated_module_of_the_clients_is_known_as_one() -> None:
    generated = {path for path, content in lines.files_here() if lines.is_generated(content)}
    derived = {path for path, _ in lines.files_here() if path.rpartition("/")[2].startswith("_derived")}
    assert derived <= generated
