"""Reading of options' values."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from ual_tools.main import cli


@pytest.mark.parametrize("port", ["80_80", "８０", "1e3", "x"])
def test_a_port_is_written_in_decimal_digits(port: str) -> None:
    result = CliRunner().invoke(cli, ["view", "--port", port])
    assert result.exit_code == 2
    assert "is not a whole number" in result.output
