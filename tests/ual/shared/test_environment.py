"""A variable that is misspelled is refused wherever variables are read: in both programs, and in both clients."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import ual
from ual import _target, credentials, discovery
from ual.shared import environment
from ual_daemon import UAL
from ual_daemon.program.main import main as daemon
from ual_tools.main import cli
from ual_tools.options import shared
from ual_tools.rtcm import ntrip

MISSPELLED = [
    ("UAL_ADRESS", "UAL_ADRESS: UAL reads no environment variable of this name; did you mean UAL_ADDRESS?"),
    ("UAL_BACKNED", "UAL_BACKNED: UAL reads no environment variable of this name; did you mean UAL_BACKEND?"),
    (
        "UAL_QUARTZ",
        "UAL_QUARTZ: UAL reads no environment variable of this name; unset it, or list it in UAL_OTHER_VARIABLES",
    ),
]


def test_all_that_are_read_are_known() -> None:
    options = {str(each.envvar) for each in shared() if each.envvar}
    constants = {**vars(credentials), **vars(discovery), **vars(_target), **vars(environment), **vars(ntrip)}
    read = {value for name, value in constants.items() if name.endswith("_VARIABLE")}
    assert options | read == set(environment.OF_CLIENTS)


def test_each_option_of_the_daemon_has_a_variable_that_is_known() -> None:
    options = [each for each in daemon.params if isinstance(each, click.Option)]
    names = {each.envvar or f"UAL_{str(each.name).upper()}" for each in options if each.allow_from_autoenv}
    assert names == set(environment.OF_DAEMON)


def test_the_manual_lists_those_of_clients() -> None:
    page = (Path(__file__).parents[3] / "docs" / "reference" / "configuration.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`UAL_[^|]+) \|", page.partition("## Variables of clients")[2], re.MULTILINE)
    assert {name for row in rows for name in re.findall(r"`(\w+)`", row)} == set(environment.OF_CLIENTS)


@pytest.mark.parametrize(("name", "said"), MISSPELLED)
def test_a_misspelled_one_is_reported_with_what_was_meant(name: str, said: str) -> None:
    assert environment.mistake_in({"UAL_NS": "uav_1", name: "x"}) == said


def test_those_of_programs_of_ual_of_tests_and_of_others_are_let_be() -> None:
    known = dict.fromkeys((*environment.OF_CLIENTS, *environment.OF_DAEMON, "UAL_TEST_CLIENTS", "DUAL_X", "PATH"), "")
    assert environment.mistake_in(known) == ""


def test_a_program_next_to_ual_may_have_its_own() -> None:
    given = {
        "UAL_SURVEY_DIR": "/data",
        "UAL_SURVEY_SPEED": "3",
        "UAL_OTHER_VARIABLES": "UAL_SURVEY_DIR, UAL_SURVEY_SPEED",
    }
    assert environment.mistake_in(given) == ""
    assert environment.mistake_in({**given, "UAL_SURVEY_HEIGHT": "3"}).startswith("UAL_SURVEY_HEIGHT: ")


@pytest.mark.parametrize("make", [ual.Uav, ual.aio.Uav])
@pytest.mark.parametrize(("name", "said"), MISSPELLED)
def test_a_client_refuses_it(
    make: Callable[[str], object], name: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, "127.0.0.1:1")
    with pytest.raises(ual.InvalidArgumentError) as refused:
        make("uav_1")
    assert str(refused.value) == said
    assert refused.value.metadata["field"] == "environment"


@pytest.mark.parametrize(("name", "said"), MISSPELLED)
def test_both_programs_refuse_it_as_wrong_usage(name: str, said: str) -> None:
    for program, words in ((cli, ["list"]), (daemon, ["--print-config"])):
        result = CliRunner().invoke(program, words, env={name: "127.0.0.1:1"})
        assert result.exit_code == 2
        assert said in result.output


def test_help_comes_in_any_environment() -> None:
    assert CliRunner().invoke(cli, ["--help"], env={"UAL_ADRESS": "x"}).exit_code == 0


def test_the_class_which_reads_none_warns_of_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It takes its arguments from the program only: so a variable that it does not know cannot change what it does."""
    monkeypatch.setenv("UAL_BACKNED", "mavlink")
    with caplog.at_level(logging.WARNING, "ual_daemon.ual"), UAL("light"):
        pass
    [record] = [each for each in caplog.records if vars(each).get("ual_event") == "unknown_variable"]
    assert vars(record)["ual_fields"] == {
        "why": "UAL_BACKNED: UAL reads no environment variable of this name; did you mean UAL_BACKEND?",
        "effect": "none: the class reads no variables",
    }
