"""Reading of the daemon's flags, and of their variables."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from ual_daemon.program.main import main


@pytest.mark.parametrize("words", [("--fleet", "8_0"), ("--fleet", "８"), ("--fleet", "many"), ("--workers", "1_0")])
def test_a_count_is_written_in_decimal_digits(words: tuple[str, str]) -> None:
    for result in (
        CliRunner().invoke(main, words),
        CliRunner().invoke(main, [], env={f"UAL_{words[0].removeprefix('--').upper()}": words[1]}),
    ):
        assert result.exit_code == 2
        assert "is not a whole number" in result.output
