from __future__ import annotations

import pytest

from ual_daemon.program import environment
from ual_daemon.program.configuration import ConfigurationError

OPTIONS = ("backend", "ns", "fleet_url", "config", "set")


def test_what_a_program_reads_is_taken() -> None:
    given = [
        "UAL_BACKEND",
        "UAL_FLEET_URL",
        "UAL_SET",
        "UAL_ADDRESS",
        "UAL_TOKEN_FILE",
        "UAL_TEST_SITL",
        "PATH",
        "DUAL_X",
    ]
    environment.refuse_unknown(given, OPTIONS)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("UAL_BACKNED", "UAL_BACKNED: there is no such environment variable; did you mean UAL_BACKEND?"),
        ("UAL_ADRESS", "UAL_ADRESS: there is no such environment variable; did you mean UAL_ADDRESS?"),
        ("UAL_QUARTZ", "UAL_QUARTZ: there is no such environment variable"),
    ],
)
def test_another_is_refused_with_what_was_meant(name: str, said: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        environment.refuse_unknown(["UAL_NS", name], OPTIONS)
    assert str(refused.value) == said
