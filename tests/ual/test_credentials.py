"""Credentials that a client shows a daemon."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import grpc
import pytest
from click.testing import CliRunner

import ual
from tests.conftest import StartDaemon
from tests.ual_daemon.server.access.entrances import beyond_loopback, make_files
from ual import Credentials
from ual.credentials import is_this_computer
from ual.errors import DaemonUnreachableError, InvalidArgumentError, PermissionDeniedError, UnauthenticatedError
from ual.v1 import ual_pb2, ual_pb2_grpc
from ual_tools.access import certificates
from ual_tools.app import UalGroup, command
from ual_tools.main import cli
from ual_tools.session import CommandSession, pass_session


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in (
        "UAL_NS",
        "UAL_ADDRESS",
        "UAL_TOKEN",
        "UAL_TOKEN_FILE",
        "UAL_TLS_CA",
        "UAL_TLS_CERTIFICATE",
        "UAL_TLS_KEY",
    ):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("make", [ual.Uav, ual.aio.Uav])
def test_credentials_of_another_type_are_refused_and_not_shown(make: Callable[..., object]) -> None:
    with pytest.raises(InvalidArgumentError, match=r"of type str; pass ual\.Credentials\(token=") as caught:
        make(address="127.0.0.1:1", credentials="a secret")
    assert "secret" not in str(caught.value)
    with pytest.raises(InvalidArgumentError, match=r"token: it is of type bytes; pass text") as caught:
        Credentials(token=b"a secret")  # type: ignore[arg-type]
    assert "secret" not in str(caught.value)
    with pytest.raises(InvalidArgumentError, match=r"one line of text, as `ual token new` prints it") as caught:
        Credentials(token='{"secret":\n 1}')  # the daemon's file, not the caller's
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("address", "is_here"),
    [
        ("127.0.0.1:50051", True),
        ("[::1]:50051", True),
        ("localhost:50051", True),
        ("unix:/run/ual/uav_1.sock", True),
        ("192.0.2.2:50051", False),
        ("uav-1.local:50051", False),
        ("localhost.example:50051", False),
    ],
)
def test_a_token_leaves_this_computer_only_by_tls(address: str, is_here: bool) -> None:
    shown = Credentials(token="ual_x\n")
    assert shown.metadata(address, has_tls=True) == (("authorization", "Bearer ual_x"),)
    assert is_this_computer(address) is is_here
    if is_here:
        assert shown.metadata(address, has_tls=False)
        return
    with pytest.raises(InvalidArgumentError, match=r"not sent to .* without TLS"):
        shown.metadata(address, has_tls=False)


def test_a_token_is_not_in_its_text() -> None:
    assert "ual_x" not in repr(Credentials(token="ual_x"))


def test_they_are_read_from_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert Credentials.from_environment() == Credentials()
    file = tmp_path / "token"
    file.write_text("ual_file\n")
    monkeypatch.setenv("UAL_TOKEN_FILE", str(file))
    assert Credentials.from_environment() == Credentials("ual_file")
    file.write_bytes("ual_windows\r\n".encode("utf-16"))
    assert Credentials.from_environment() == Credentials("ual_windows")
    file.write_bytes(b"ual\x01")
    with pytest.raises(InvalidArgumentError, match=f"UAL_TOKEN_FILE: {file} is not a text file"):
        Credentials.from_environment()
    monkeypatch.setenv("UAL_TOKEN", "ual_direct")
    monkeypatch.setenv("UAL_TLS_CERTIFICATE", "c.pem")
    monkeypatch.setenv("UAL_TLS_KEY", "k.pem")
    assert Credentials.from_environment() == Credentials("ual_direct", "c.pem", "k.pem")


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"tls_certificate": "c.pem"}, "needed together"),
        ({"token": "zwölf"}, "no token"),
        ({"token": "a\nb"}, "no token"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, str], why: str) -> None:
    with pytest.raises(InvalidArgumentError, match=why):
        Credentials(**given)


def test_a_missing_file_is_named() -> None:
    shown = Credentials(tls_certificate="no.pem", tls_key="no.key")
    with pytest.raises(InvalidArgumentError, match=r"tls_ca: cannot read none\.pem"):
        ual.Uav(address="127.0.0.1:1", tls_ca="none.pem", credentials=shown)


@pytest.mark.parametrize("typed", [(), ("--tls-certificate", "c.pem", "--tls-key", "k.pem")])
def test_the_command_shows_all_that_the_environment_has(
    typed: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A certificate must not make it forget the token, whichever of both was typed."""
    monkeypatch.chdir(tmp_path)
    for name in ("c.pem", "k.pem"):
        (tmp_path / name).touch()
    shown: list[Credentials] = []

    @command("shown")
    @pass_session
    def show(session: CommandSession) -> None:
        shown.append(session.credentials)

    group = UalGroup(commands={"shown": show})
    environment = {"UAL_TOKEN": "ual_x", "UAL_TLS_CERTIFICATE": "c.pem", "UAL_TLS_KEY": "k.pem"}
    result = CliRunner().invoke(group, ["shown", *typed], env=environment)
    assert result.exit_code == 0, result.output
    assert [(each.token, str(each.tls_certificate), str(each.tls_key)) for each in shown] == [
        ("ual_x", "c.pem", "k.pem")
    ]


def test_a_team_on_a_network(start_daemon: StartDaemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    host = beyond_loopback()
    made = make_files(tmp_path, host)
    pair = certificates.files(tmp_path, "uav_1")
    flags = [
        "--tls-certificate",
        str(pair.certificate),
        "--tls-key",
        str(pair.key),
        "--roles",
        str(tmp_path / "roles.yaml"),
    ]
    by_token = start_daemon(*flags, "--tokens", str(tmp_path / "tokens.json"), listen=f"{host}:0")
    by_certificate = start_daemon(*flags, "--tls-client-ca", str(made.authority), listen=f"{host}:0", ns="uav_2")

    with ual.Uav(address=by_token.address, tls_ca=made.authority) as stranger, pytest.raises(UnauthenticatedError):
        stranger.info()
    observer = Credentials(token=made.tokens["observer"])
    with ual.Uav(address=by_token.address, tls_ca=made.authority, credentials=observer) as uav:
        assert uav.info().namespace == "uav_1"
        with pytest.raises(PermissionDeniedError, match="Abort needs the role pilot, and observer is an observer"):
            uav.abort()
    monkeypatch.setenv("UAL_TLS_CA", str(made.authority))
    with ual.Uav(address=by_token.address, credentials=observer) as uav:
        assert uav.info().namespace == "uav_1"
    with ual.Uav(address=by_token.address, tls_ca="") as plain, pytest.raises(DaemonUnreachableError):
        plain.info()
    laptop = certificates.files(tmp_path, "commander")
    shown = Credentials(tls_certificate=laptop.certificate, tls_key=laptop.key)
    with ual.Uav(address=by_certificate.address, tls_ca=made.authority, credentials=shown) as uav:
        uav.set_home()
        with uav.lease():
            held = uav.lease_info()
            assert held is not None
            assert held.identity == "commander"
    with (
        ual.Uav(address=by_certificate.address, tls_ca=made.authority) as stranger,
        pytest.raises(DaemonUnreachableError),
    ):
        stranger.info()


def test_a_daemon_warns_where_callers_could_not_be_known(start_daemon: StartDaemon, tmp_path: Path) -> None:
    host = beyond_loopback()
    made = make_files(tmp_path, host)
    pair = certificates.files(tmp_path, "uav_1")
    tls = ["--tls-certificate", str(pair.certificate), "--tls-key", str(pair.key)]
    start_daemon(*tls, listen=f"{host}:0").wait_for("no_callers")
    with_tokens = start_daemon(
        "--insecure", "--tokens", str(made.directory / "tokens.json"), listen=f"{host}:0", ns="uav_2"
    )
    with_tokens.wait_for("tokens_without_tls")
    with grpc.insecure_channel(with_tokens.address) as channel, pytest.raises(grpc.RpcError) as caught:
        ual_pb2_grpc.UalServiceStub(channel).GetInfo(ual_pb2.GetInfoRequest(), timeout=60.0)
    assert caught.value.code() is grpc.StatusCode.UNAUTHENTICATED
    open_to_all = start_daemon("--insecure", listen=f"{host}:0", ns="uav_3")
    with ual.Uav(address=open_to_all.address) as uav:
        uav.set_home()


def test_the_command_holds_the_lease(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10")
    runner = CliRunner()

    def run(*words: str) -> str:
        result = runner.invoke(cli, ["--address", daemon.address, *words])
        assert result.exit_code == 0, result.output
        return result.output

    assert run("lease") == "nobody holds the lease: every pilot may fly\n"
    run("wait", "landed_armed")
    with ual.Uav(address=daemon.address) as uav, uav.lease("survey"):
        assert run("lease").startswith("survey (local) since ")
        refused = runner.invoke(cli, ["--address", daemon.address, "takeoff", "3"])
        assert refused.exit_code == 1
        assert "LEASE_HELD: takeoff: survey (local) holds the lease" in refused.output
        assert runner.invoke(cli, ["--address", daemon.address, "--lease", "takeoff", "3"]).exit_code == 1
        run("--take", "takeoff", "3")
    run("--lease", "land")
