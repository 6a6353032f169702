"""Requests that the app answers: of its own pages, to the hosts it serves, with the token."""

import hmac
import ipaddress
import re
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import parse_qsl

from websockets.http11 import Request

from warpspace.exceptions import OptionError

TOKEN = re.compile(r"[A-Za-z0-9._~-]{12,200}")
TOKEN_BYTES = 16
COOKIE = "warpspace_token_"
_AUTHORITY = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9._-]+))(?::(\d{1,5}))?")
_ORIGIN = re.compile(r"(https?)://(.+)", re.IGNORECASE)
_DEFAULT_PORTS = {"http": 80, "https": 443}
_ELSEWHERE = ("websocket", "playbackPath")
"""Query parameters that connect viser's page to another server, whose scripts it runs."""


@dataclass(frozen=True)
class Access:
    """Access to the app, as given on the command line."""

    # names under which a proxy serves the app, with a port unless it is the default one
    allow_hosts: tuple[str, ...] = ()
    # required; by default a random one where other machines can reach the app, else none
    token: str | None = None
    no_token: bool = False  # no token is required, whoever can reach the app

    def choose_token(self, *, local: bool) -> str | None:
        if self.token is None:
            return None if local or self.no_token else secrets.token_urlsafe(TOKEN_BYTES)
        if self.no_token:
            raise OptionError("--token and --no-token exclude each other; expected one of them")
        if not TOKEN.fullmatch(self.token):
            raise OptionError("--token: expected 12 to 200 letters, digits and . _ ~ -")
        return self.token


@dataclass(frozen=True)
class HostPort:
    """A host and a port; None is the default port of the scheme."""

    host: str
    port: int | None

    def usual(self, scheme: str) -> "HostPort":
        return HostPort(self.host, None if self.port == _DEFAULT_PORTS[scheme] else self.port)


def read_place(text: str) -> HostPort | None:
    """Parse `host`, `host:port` or `[address]:port`; None for other texts."""
    match = _AUTHORITY.fullmatch(text)
    if match is None:
        return None
    literal, name, port = match.groups()
    try:
        host = plain_address(literal or name)
    except ValueError:
        if literal:
            return None
        host = name.lower()
    return HostPort(host, int(port) if port else None)


def plain_address(text: str) -> str:
    """Return an address in the notation used for comparisons."""
    address = ipaddress.ip_address(text.partition("%")[0])
    mapped = getattr(address, "ipv4_mapped", None)
    return str(mapped or address)


@dataclass(frozen=True)
class Refusal:
    """Reason for a refused request: `kind` is logged once, `text` stands on the page."""

    kind: str
    text: str
    status: HTTPStatus = HTTPStatus.FORBIDDEN


class RequestPolicy:
    """Check of requests for a page or a websocket.

    Any page of the web can send requests to a server on this machine. Its browser names the page in
    `Origin`, and the requested server in `Host`, which is a foreign name where that name was
    made to point here (DNS rebinding). Programs other than browsers send no `Origin`.
    """

    def __init__(
        self,
        names: Iterable[str],
        port: int,
        *,
        everywhere: bool = False,
        allow_hosts: Iterable[str] = (),
        token: str | None = None,
    ) -> None:
        self._allowed = frozenset(map(_allowed, allow_hosts))
        self._hosts = frozenset(names) | {place.host for place in self._allowed}
        self._everywhere, self._token = everywhere, token
        self._cookie = f"{COOKIE}{port}"
        self._pass = hmac.new((token or "").encode(), b"warpspace cookie", "sha256").hexdigest()

    def check(self, request: Request, arrived_at: str) -> Refusal | None:
        """Return the reason for refusing a request to an address; None where it is answered."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        place = read_place(hosts[0]) if len(hosts) == 1 else None
        served = place is not None and (
            place.host in self._hosts or (self._everywhere and place.host == arrived_at)
        )
        if place is None or not served:
            requested = ", ".join(hosts) or "none"
            return Refusal(
                "host",
                f"This app does not serve the host {requested[:200]!r}. If a proxy does,"
                " start the app with --allow-host NAME.",
            )
        if origins and not (len(origins) == 1 and self._is_own(origins[0], place)):
            return Refusal(
                "origin",
                f"Only the app's own page may use it, not one of {origins[0][:200]!r}. If a"
                " proxy serves the app there, start it with --allow-host NAME.",
            )
        if not all(self._is_own(url, place) for url in _query_values(request, *_ELSEWHERE)):
            return Refusal(
                "elsewhere", "The link connects the page to another server; remove that parameter."
            )
        if not (self._has_token(request) or self._has_cookie(request)):
            return Refusal(
                "token",
                "This app requires a token: open the link printed where it was started"
                " (…/?token=…), and allow its cookie.",
            )
        return None

    def cookie(self, request: Request) -> str | None:
        """Return the cookie that replaces the token from now on; a websocket has no other."""
        if self._token is None or not self._has_token(request):
            return None
        return f"{self._cookie}={self._pass}; Path=/; HttpOnly; SameSite=Strict"

    def _has_token(self, request: Request) -> bool:
        token = self._token
        return token is None or any(_is(word, token) for word in _query_values(request, "token"))

    def _has_cookie(self, request: Request) -> bool:
        pairs = (
            pair.strip().partition("=")
            for header in request.headers.get_all("Cookie")
            for pair in header.split(";")
        )
        return any(_is(value, self._pass) for name, _, value in pairs if name.startswith(COOKIE))

    def _is_own(self, url: str, place: HostPort) -> bool:
        match = _ORIGIN.fullmatch(re.sub(r"\Aws", "http", url))
        origin = None if match is None else read_place(match[2].partition("/")[0])
        if match is None or origin is None:
            return False
        scheme = match[1].lower()
        return origin.usual(scheme) in {at.usual(scheme) for at in (place, *self._allowed)}


def _query_values(request: Request, *names: str) -> list[str]:
    query = request.path.partition("?")[2]
    return [value for key, value in parse_qsl(query, keep_blank_values=True) if key in names]


def _is(text: str, secret: str) -> bool:
    return hmac.compare_digest(text.encode("utf-8", "replace"), secret.encode())


def _allowed(text: str) -> HostPort:
    place = read_place(text)
    if place is None:
        raise OptionError(
            f"--allow-host {text!r}: expected a name, with a port where it is not the usual one,"
            " for instance review.example or review.example:8443"
        )
    return place
