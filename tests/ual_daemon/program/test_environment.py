from __future__ import annotations

import pytest
from click.testing import CliRunner

from ual_daemon.program import environment
from ual_daemon.program.configuration import ConfigurationError
from ual_daemon.program.main import main

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


@pytest.mark.parametrize("words", [("--fleet", "8_0"), ("--fleet", "８"), ("--fleet", "many"), ("--workers", "1_0")])
def test_a_count_is_written_in_decimal_digits(words: tuple[str, str]) -> None:
    for result in (
        CliRunner().invoke(main, words),
        CliRunner().invoke(main, [], env={f"UAL_{words[0].removeprefix('--').upper()}": words[1]}),
    ):
        assert result.exit_code == 2
        assert "is not a whole number" in result.output
