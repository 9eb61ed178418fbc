"""Which requests may see the page and talk to its server."""

from __future__ import annotations

import hmac
import ipaddress
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit


def is_loopback(host: str) -> bool:
    """Tell whether an address or name means this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Admission:
    """The rules: where the server listens, and the token that it asks for (empty: none, on loopback)."""

    host: str
    port: int
    token: str

    def refusal(self, *, target: str, host: str | None, origin: str | None, socket: bool) -> str:
        """Return why a request is refused; empty when it is not.

        A page of another site can make this machine's browser ask: it then sends that site's name as Host (a name that was made to mean
        this machine) or as Origin. A socket without an Origin does not come from a page of ours either.

        Args:
            target: path and query.
            host: the header Host.
            origin: the header Origin.
            socket: whether the request opens a WebSocket, which can command.
        """
        name = _hostname(host)
        if not name or not (is_loopback(name) or self.token):
            return "this server is reached as localhost only"
        if (origin is None and socket) or (origin is not None and urlsplit(origin).netloc != host):
            return "requests of other sites are refused"
        given = parse_qs(urlsplit(target).query).get("token", [""])[0]
        if self.token and not hmac.compare_digest(given.encode(), self.token.encode()):
            return "the token is missing or wrong; it stands in the address that the console printed"
        return ""

    @property
    def address(self) -> str:
        """Return the page's address."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/{'?token=' + self.token if self.token else ''}"


def _hostname(host: str | None) -> str:
    try:
        return urlsplit(f"//{host or ''}").hostname or ""
    except ValueError:
        return ""
