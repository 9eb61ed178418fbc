"""Which requests may see the page and talk to its server, and which may command."""

from __future__ import annotations

import hmac
import ipaddress
import socket
import ssl
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit


def is_loopback(host: str) -> bool:
    """Return whether an address or name means this machine alone."""
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)  # an IPv4 peer of a socket that listens on IPv6
    return (mapped or address).is_loopback


@dataclass(frozen=True)
class Admission:
    """The rules: where the server listens, the token that it asks for (empty: none, on loopback), and its TLS (None: plain HTTP)."""

    host: str
    port: int
    token: str
    tls: ssl.SSLContext | None = None

    def refusal(self, *, target: str, host: str | None, origin: str | None, cookie: str | None, opens_socket: bool) -> str:
        """Return why a request is refused; empty when it is not.

        A page of another site can make this machine's browser ask: it then sends that site's name as Host (a name that was made to mean
        this machine) or as Origin. A socket without an Origin does not come from a page of ours either.

        Args:
            target: path and query.
            host: the header Host.
            origin: the header Origin.
            cookie: the header Cookie.
            opens_socket: whether the request opens a WebSocket, which can command.
        """
        name = _hostname(host)
        if not name or not (is_loopback(name) or self.token):
            return "this server is reached as localhost only"
        if (origin is None and opens_socket) or (origin is not None and origin != f"{self._scheme}://{host}"):
            return "requests of other sites are refused"
        if self.token and not (self.brings_token(target) or self._is_token(self._kept(cookie))):
            return "the token is missing or wrong; it stands in the address that the console printed"
        return ""

    def brings_token(self, target: str) -> bool:
        """Return whether an address is the page's with the token in it, as the console printed it: the first load, which gets a cookie."""
        asked = urlsplit(target)
        return bool(self.token) and asked.path == "/" and self._is_token(parse_qs(asked.query).get("token", [""])[0])

    @property
    def cookie(self) -> str:
        """Return the value of ``Set-Cookie`` with which a browser keeps the token where no script and no other site can read it."""
        return f"{self._name}={self.token}; Path=/; HttpOnly; SameSite=Strict{'; Secure' if self.tls else ''}"

    def may_command(self, peer: str) -> bool:
        """Return whether a peer may command, not only watch: without TLS, others on the network could read the token of a remote peer."""
        return self.tls is not None or is_loopback(peer)

    @property
    def address(self) -> str:
        """Return the URL to open in a browser, with the token where one is needed."""
        named = socket.gethostname() if self.host in {"0.0.0.0", "::", ""} else self.host  # noqa: S104 - it is compared, not bound
        host = f"[{named}]" if ":" in named else named
        return f"{self._scheme}://{host}:{self.port}/{'?token=' + self.token if self.token else ''}"

    @property
    def _scheme(self) -> str:
        return "http" if self.tls is None else "https"

    @property
    def _name(self) -> str:
        return f"alula_console_{self.port}"  # browsers send a host's cookies to all its ports

    def _kept(self, cookie: str | None) -> str:
        try:
            morsel = SimpleCookie(cookie or "").get(self._name)
        except CookieError:
            return ""
        return "" if morsel is None else morsel.value

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(errors="replace"), self.token.encode())


def _hostname(host: str | None) -> str:
    try:
        return urlsplit(f"//{host or ''}").hostname or ""
    except ValueError:
        return ""
