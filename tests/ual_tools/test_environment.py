"""The variables that `ual` knows are those that clients and the daemon read."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from ual import _target, credentials, discovery
from ual_daemon.program import environment as of_daemon
from ual_daemon.program.main import _with_variables, main
from ual_tools import environment
from ual_tools.options import shared
from ual_tools.main import cli


def test_all_that_are_read_are_known() -> None:
    options = {str(each.envvar) for each in shared() if each.envvar}
    constants = {**vars(credentials), **vars(discovery), **vars(_target)}
    read = {value for name, value in constants.items() if name.endswith("_VARIABLE")}
    assert options | read == set(environment.OF_CLIENTS)
    assert {f"UAL_{name.upper()}" for name in _with_variables(main)} == set(environment.OF_DAEMON)
    of_daemon.refuse_unknown([*environment.OF_CLIENTS, *environment.OF_DAEMON], _with_variables(main))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("UAL_ADRESS", "UAL_ADRESS: there is no such environment variable. Did you mean UAL_ADDRESS?"),
        ("UAL_NAMESPACE", "UAL_NAMESPACE: there is no such environment variable."),
        ("UAL_BACKNED", "UAL_BACKNED: there is no such environment variable. Did you mean UAL_BACKEND?"),
    ],
)
def test_a_misspelled_one_is_refused_with_what_was_meant(name: str, said: str) -> None:
    result = CliRunner().invoke(cli, ["list"], env={name: "127.0.0.1:1"})
    assert result.exit_code == 2
    assert said in result.output


def test_those_of_the_daemon_and_of_others_are_let_be() -> None:
    environment.refuse_unknown(["UAL_BACKEND", "UAL_TEST_CLIENTS", "DUAL_X", "PATH"])


def test_help_comes_in_any_environment() -> None:
    assert CliRunner().invoke(cli, ["--help"], env={"UAL_ADRESS": "x"}).exit_code == 0


@pytest.mark.parametrize("port", ["80_80", "８０", "1e3", "x"])
def test_a_port_is_written_in_decimal_digits(port: str) -> None:
    result = CliRunner().invoke(cli, ["view", "--port", port])
    assert result.exit_code == 2
    assert "is not a whole number" in result.output
