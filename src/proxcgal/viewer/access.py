"""Access control of a page: token, origin, number of pages, kinds and rate of messages.

viser serves any client and trusts its messages: a message can set any property, ask for a public
tunnel or upload files, 50 MB each. Here every connection shows where it comes from, and a token
where one is set; every message is small, of a kind that the page needs, and comes at a bounded
rate. `page_server` puts these checks before viser.
"""

import hmac
import http
import threading
import urllib.parse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from proxcgal.viewer.client_messages import ClientBounds, parse_message

LOOPBACK = ("127.0.0.1", "::1", "localhost")


class AccessControl:
    """Decides on connections and messages; one for each server."""

    def __init__(
        self, host: str, token: str | None = None, bounds: ClientBounds | None = None
    ) -> None:
        """Args: the address that is listened on; a token that every viewer must show."""
        self.token = token
        self.bounds = bounds or ClientBounds()
        self._loopback_only = host in LOOPBACK
        self._lock = threading.Lock()
        self.viewers = 0  #: pages that are connected now
        self._controls: dict[str, Callable[[object], bool]] = {}
        self.refused = 0  #: connections
        self.dropped = 0  #: messages

    def allow_control(self, control: Any, allowed: Callable[[object], bool]) -> Any:
        """Lets pages set the value of one of viser's controls, which it returns."""
        self._controls[control._impl.uuid] = allowed
        return control

    def refusal(self, request: Request) -> Response | None:
        """The answer to a request that is refused; None where it may go on."""
        if any(len(request.headers.get_all(name)) > 1 for name in ("Host", "Origin", "Upgrade")):
            return self._refuse("a header came twice")
        host = request.headers.get("Host", "")
        # A page of another site, or a name that was made to point here, must not reach us.
        if (name := _host_name(host)) is None:
            return self._refuse("its Host header is none")
        if self._loopback_only and name not in LOOPBACK:
            return self._refuse(
                f"host {host!r} is not served here: open http://127.0.0.1:{_port(host)}"
            )
        origin = request.headers.get("Origin")
        if origin is not None and _origin_host(origin) != host:
            return self._refuse("pages of other origins may not connect")
        if not self._has_token(request):
            return self._refuse("a token is needed: open the address that `proxcgal` printed")
        upgrade = request.headers.get("Upgrade", "").lower() == "websocket"
        if upgrade and self.viewers >= self.bounds.viewers:
            return self._refuse(
                f"{self.bounds.viewers} pages look on already", http.HTTPStatus.SERVICE_UNAVAILABLE
            )
        return None

    def cookie(self, request: Request) -> str | None:
        """Cookie of a page that came with the token, so that its connection shows it too."""
        if self.token is None:
            return None
        return f"{_cookie_name(request)}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    @contextmanager
    def viewer(self) -> Iterator[bool]:
        """Counts a connected page; false where there are too many by now."""
        with self._lock:
            self.viewers += 1
            room = self.viewers <= self.bounds.viewers
        try:
            yield room
        finally:
            with self._lock:
                self.viewers -= 1

    def accepts(self, raw: object) -> bool:
        """Whether a page may send this message."""
        message = parse_message(raw, self.bounds)
        if message is None or message.kind != "GuiUpdateMessage":
            return message is not None
        allowed = self._controls.get(message.fields["uuid"])
        return allowed is not None and allowed(message.fields["updates"]["value"])

    def _has_token(self, request: Request) -> bool:
        if self.token is None:
            return True
        query = urllib.parse.parse_qs(urllib.parse.urlsplit(request.path).query)
        shown = query.get("token", [])[:1]
        try:
            cookies = SimpleCookie(request.headers.get("Cookie", ""))
        except CookieError:
            cookies = SimpleCookie()
        if (kept := cookies.get(_cookie_name(request))) is not None:
            shown.append(kept.value)
        return any(hmac.compare_digest(s.encode(), self.token.encode()) for s in shown)

    def _refuse(self, reason: str, status: http.HTTPStatus = http.HTTPStatus.FORBIDDEN) -> Response:
        self.refused += 1
        body = f"{status.value} {status.phrase}: {reason}\n".encode()
        headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Connection": "close",
                           "Content-Length": str(len(body))})  # fmt: skip
        return Response(status.value, status.phrase, headers, body)


def _host_name(host: str) -> str | None:
    """The name in a Host header; None where it is malformed."""
    try:
        parts = urllib.parse.urlsplit(f"//{host}")
        parts.port  # noqa: B018  raises where it is no number
        return parts.hostname or ""
    except ValueError:
        return None


def _origin_host(origin: str) -> str | None:
    """Host and port of an Origin header; None where it is malformed."""
    try:
        return urllib.parse.urlsplit(origin).netloc
    except ValueError:
        return None


def _port(host: str) -> int:
    """The port in a Host header; 0 where it is none."""
    try:
        return urllib.parse.urlsplit(f"//{host}").port or 80
    except ValueError:
        return 0


def _cookie_name(request: Request) -> str:
    """Cookies know no port: pages on two of them keep two."""
    return f"proxcgal_{_port(request.headers.get('Host', ''))}"
