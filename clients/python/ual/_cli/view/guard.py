"""Who may open the page: this computer's own browsers, or beyond loopback those with the token, over TLS. No viser.

A page of another site must neither read this one nor click on it: a browser names the site in `Origin`, and would
show this page within the other one if it were allowed to.
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
        token: What a browser must know; empty on loopback, where whoever is there can call the daemons, too.

    """

    token: str = ""

    def refusal(self, path: str, headers: Mapping[str, str]) -> str:
        """Returns why a request is refused; nothing where it is not. The names of `headers` are in lower case."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self.token and not is_loopback(_hostname(host)):
            return f"Host {host!r}: this page is for this computer only"
        if origin is not None and _netloc(origin) != host.lower():
            return f"Origin {origin!r}: a page of another site"
        if self.token and not (self._is_token(_asked(path)) or self._is_token(_cookie(headers.get("cookie", "")))):
            return "no token, or a wrong one: open the address that `ual view` printed"
        return ""

    def cookie(self, path: str) -> str | None:
        """Returns the cookie to set where a request brings the right token in its address."""
        if not (self.token and self._is_token(_asked(path))):
            return None
        return f"{COOKIE}={self.token}; Path=/; HttpOnly; Secure; SameSite=Strict"

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(errors="replace"), self.token.encode())


def is_loopback(host: str) -> bool:
    """Whether a host is this computer's loopback."""
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


def _asked(path: str) -> str:
    return parse_qs(path.partition("?")[2]).get("token", [""])[0]


def _cookie(text: str) -> str:
    try:
        found = SimpleCookie(text).get(COOKIE)
    except CookieError:
        return ""
    return "" if found is None else found.value
