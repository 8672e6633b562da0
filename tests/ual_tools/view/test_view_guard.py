"""`ual view`: the permission to open the page."""

from __future__ import annotations

import pytest

from ual_tools.view.guard import Guard, is_loopback


@pytest.mark.parametrize(
    ("headers", "is_allowed"),
    [
        ({"host": "127.0.0.1:8080"}, True),
        ({"host": "localhost:8080", "origin": "http://localhost:8080"}, True),
        ({"host": "[::1]:8080", "origin": "http://[::1]:8080"}, True),
        ({"host": "127.0.0.1:8080", "origin": "http://localhost:8080"}, False),
        ({"host": "127.0.0.1:8080", "origin": "http://127.0.0.1:9090"}, False),
        ({"host": "127.0.0.1:8080", "origin": "https://evil.example"}, False),
        ({"host": "127.0.0.1:8080", "origin": "null"}, False),
        ({"host": "127.0.0.1:8080", "origin": "http://[::1"}, False),
        ({"host": "evil.example:8080", "origin": "http://evil.example:8080"}, False),  # its name now leads here
        ({"host": "evil.example:8080"}, False),
        ({"host": "[::1"}, False),
        ({}, False),
    ],
)
def test_on_loopback_only_the_pages_of_this_computer(headers: dict[str, str], is_allowed: bool) -> None:
    assert (Guard().refusal("/", headers) == "") is is_allowed


@pytest.mark.parametrize(
    ("path", "cookie", "is_allowed"),
    [
        ("/", None, False),
        ("/?token=secret", None, True),
        ("/?token=wrong", None, False),
        ("/?token=", "ual_view_token_443=", False),
        ("/", "ual_view_token_443=secret", True),
        ("/", "other=1; ual_view_token_443=secret", True),
        ("/", "ual_view_token_443=secre", False),
        ("/", "ual_view_token_443=\udce9", False),
        ("/", "[]()=;;;", False),
        ("//[::1", None, False),
    ],
)
def test_beyond_loopback_only_with_the_token(path: str, cookie: str | None, is_allowed: bool) -> None:
    headers = {"host": "uav.example:443"} | ({} if cookie is None else {"cookie": cookie})
    assert (Guard("secret", is_tls=True).refusal(path, headers) == "") is is_allowed
    assert Guard("secret", is_tls=True).refusal(path, headers | {"origin": "https://evil.example"})


def test_the_token_becomes_a_cookie_that_other_sites_and_scripts_do_not_get() -> None:
    by_tls, plain = Guard("secret", is_tls=True), Guard("secret")
    assert by_tls.cookie("/?token=secret", {"host": "a.b"}) == (
        "ual_view_token=secret; Path=/; HttpOnly; Secure; SameSite=Strict"
    )
    assert plain.cookie("/?token=secret", {"host": "127.0.0.1:8080"}) == (
        "ual_view_token_8080=secret; Path=/; HttpOnly; SameSite=Strict"
    )
    assert plain.cookie("/", {"host": "127.0.0.1"}) is None
    assert Guard().cookie("/?token=", {"host": "127.0.0.1"}) is None


def test_a_token_without_tls_is_for_this_computer_only() -> None:
    guard = Guard("secret")
    assert not guard.refusal("/?token=secret", {"host": "127.0.0.1:8080"})
    assert guard.refusal("/?token=secret", {"host": "uav.example:8080"})
    assert guard.refusal("/", {"host": "127.0.0.1:8080"})
    assert guard.refusal("/", {"host": "127.0.0.1:8081", "cookie": "ual_view_token_8080=secret"})


@pytest.mark.parametrize(
    ("host", "answer"), [("127.0.0.1", True), ("127.8.8.8", True), ("::1", True), ("0.0.0.0", False), ("a.b", False)]
)
def test_what_loopback_is(host: str, answer: bool) -> None:
    assert is_loopback(host) is answer
