"""Guard of the page: it lets in this computer's own browsers, and only with the token where there is one. No viser.

A page of another site must neither read this one nor click on it. A browser names the site in `Origin`, and would show
this page within the other one if it were allowed to.
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

COOKIE = "ual_view_token"
HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": (
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self' data: blob:; "
        "frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
"""Of each answer: nothing is loaded from elsewhere, nothing is sent elsewhere, and no other page shows this one."""


@dataclass(frozen=True)
class Guard:
    """Judges requests.

    Args:
        token: What a browser must know; empty for a page on loopback that only shows.
        is_tls: Whether it is served by TLS. Without it, it is for this computer only.

    """

    token: str = ""
    is_tls: bool = False

    def refusal(self, path: str, headers: Mapping[str, str]) -> str:
        """Returns why a request is refused; nothing where it is not. The names of `headers` are in lower case."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self.is_tls and not is_loopback(_hostname(host)):
            return f"Host {host!r}: this page is for this computer only"
        if origin is not None and _netloc(origin) != host.lower():
            return f"Origin {origin!r}: a page of another site"
        if self.token and not (self._is_token(_token_in(path)) or self._is_token(_cookie(headers))):
            return "no token, or a wrong one: open the address that `ual view` printed"
        return ""

    def cookie(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Returns the cookie to set where a request brings the right token in its address."""
        if not (self.token and self._is_token(_token_in(path))):
            return None
        secure = " Secure;" if self.is_tls else ""
        return f"{_cookie_name(headers)}={self.token}; Path=/; HttpOnly;{secure} SameSite=Strict"

    def _is_token(self, candidate: str) -> bool:
        return hmac.compare_digest(candidate.encode(errors="replace"), self.token.encode())


def is_loopback(host: str) -> bool:
    """Returns whether a host is this computer's loopback."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _hostname(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _netloc(origin: str) -> str:
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _token_in(path: str) -> str:
    return parse_qs(path.partition("?")[2]).get("token", [""])[0]


def _cookie_name(headers: Mapping[str, str]) -> str:
    """Returns the name of the cookie: a browser gives the cookies of a host to all of its ports."""
    try:
        port = urlsplit(f"//{headers.get('host', '')}").port
    except ValueError:
        port = None
    return COOKIE if port is None else f"{COOKIE}_{port}"


def _cookie(headers: Mapping[str, str]) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(_cookie_name(headers))
    except CookieError:
        return ""
    return "" if found is None else found.value
