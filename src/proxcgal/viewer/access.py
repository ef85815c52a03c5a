"""Who may open a page, and what it may send: checked before viser sees any of it.

viser serves whoever asks and trusts what it is sent: a message can set any property, ask for a
public tunnel or upload files, 50 MB each. Here every connection shows where it comes from, and a
token where one is set; every message is small, of a kind that the page needs, and comes at a
bounded rate.

The checks hang in the call by which viser starts its server: there is no second port behind them.
"""

from __future__ import annotations

import hmac
import http
import logging
import socket
import threading
import time as clock
import urllib.parse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from unittest import mock

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosedError
from websockets.frames import Close, CloseCode
from websockets.http11 import Request, Response

from proxcgal.core.errors import ConfigError
from proxcgal.viewer.client_messages import Bounds, understood

_QUIET = logging.getLogger("proxcgal.page")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False

LOOPBACK = ("127.0.0.1", "::1", "localhost")
#: Of a replay in a report's making: nobody may look.
NOBODY = 0


class Gate:
    """Decides on connections and messages; one for each server."""

    def __init__(self, host: str, token: str | None = None, bounds: Bounds | None = None) -> None:
        """Args: the address that is listened on; a token that every viewer must show."""
        self.token = token
        self.bounds = bounds or Bounds()
        self._loopback_only = host in LOOPBACK
        self._lock = threading.Lock()
        self._viewers = 0
        self._controls: dict[str, Callable[[object], bool]] = {}
        self.refused = 0  #: connections
        self.dropped = 0  #: messages

    @property
    def viewers(self) -> int:
        """Pages that are connected now."""
        return self._viewers

    def offer(self, control: Any, allowed: Callable[[object], bool]) -> None:
        """Lets pages set the value of one of viser's controls, to what is allowed only."""
        self._controls[control._impl.uuid] = allowed

    def admit(self, request: Request) -> Response | None:
        """None where the request may go on; else what is answered instead."""
        if any(len(request.headers.get_all(name)) > 1 for name in ("Host", "Origin", "Upgrade")):
            return self._refuse("a header came twice")
        host, upgrade = request.headers.get("Host", ""), _upgrades(request)
        # A page of another site, or a name that was made to point here, must not reach us.
        if self._loopback_only and _name(host) not in LOOPBACK:
            return self._refuse(
                f"host {host!r} is not served here: open http://127.0.0.1:{_port(host)}"
            )
        origin = request.headers.get("Origin")
        if origin is not None and urllib.parse.urlsplit(origin).netloc != host:
            return self._refuse("pages of other origins may not connect")
        if not self._knows_token(request):
            return self._refuse("a token is needed: open the address that `proxcgal` printed")
        if upgrade and self._viewers >= self.bounds.viewers:
            return self._refuse(
                f"{self.bounds.viewers} pages look on already", http.HTTPStatus.SERVICE_UNAVAILABLE
            )
        return None

    def cookie(self, request: Request) -> str | None:
        """What a page that came with the token keeps, so that its connection shows it too."""
        if self.token is None:
            return None
        return f"{_cookie_name(request)}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    @contextmanager
    def viewer(self) -> Iterator[bool]:
        """Counts a connected page; false where others came first while it was let in."""
        with self._lock:
            self._viewers += 1
            room = self._viewers <= self.bounds.viewers
        try:
            yield room
        finally:
            with self._lock:
                self._viewers -= 1

    def accepts(self, raw: object) -> bool:
        """Is this a message that a page may send?"""
        message = understood(raw, self.bounds)
        if message is None or message.kind != "GuiUpdateMessage":
            return message is not None
        allowed = self._controls.get(message.fields["uuid"])
        return allowed is not None and allowed(message.fields["updates"]["value"])

    def _knows_token(self, request: Request) -> bool:
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


def serve(
    host: str, port: int, *, label: str, token: str | None = None, bounds: Bounds | None = None
) -> tuple[viser.ViserServer, Gate]:
    """Starts viser's server behind a gate.

    Args:
        host: address to listen on.
        port: 0 for any that is free.
        label: above the page's controls.
        token: that every viewer must show.
        bounds: of what they may send.

    Raises:
        ConfigError: the address cannot be listened on.
    """
    gate = Gate(host, token, bounds)
    check_free(host, port)
    put_in = threading.Event()
    original = websockets.asyncio.server.serve

    def guarded(handler: Any, *arguments: Any, **options: Any) -> Any:
        put_in.set()
        files = options.pop("process_request")

        async def watched(connection: ServerConnection) -> None:
            with gate.viewer() as room:
                if room:
                    await handler(connection)
                else:
                    await connection.close(CloseCode.TRY_AGAIN_LATER, "too many pages")

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if (refusal := gate.admit(request)) is not None:
                return refusal
            response: Response | None = files(connection, request)
            if response is not None:
                response.headers.update(_SHUT)
                if (cookie := gate.cookie(request)) is not None:
                    response.headers["Set-Cookie"] = cookie
            return response

        return original(
            watched, *arguments,
            **options | {
                "process_request": answer,
                "max_size": gate.bounds.message_bytes,
                "max_queue": 16,
                "open_timeout": 10,
                "close_timeout": 2,
                "ping_interval": 10,
                "ping_timeout": 20,
                "create_connection": _connections(gate),
                "logger": _QUIET,  # what strangers send is counted, not printed
            },
        )  # fmt: skip

    # viser prints an address of its own, without the token.
    with mock.patch.object(websockets.asyncio.server, "serve", guarded), mock.patch("rich.print"):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if not put_in.is_set():
        close(server)
        raise RuntimeError("viser serves in another way than the gate knows: nothing is served")
    return server, gate


def close(server: viser.ViserServer) -> None:
    """Stops serving; every page is told that the connection ends."""
    with mock.patch("rich.print"):
        server.stop()


#: The page needs no other host, and no other page may hold it in a frame.
_SHUT = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def _connections(gate: Gate) -> type[ServerConnection]:
    class Connection(ServerConnection):
        """Gives out only what the gate accepts, at its rate."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._room = gate.bounds.burst
            self._at = clock.monotonic()

        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                raw = await super().recv(decode)
                now = clock.monotonic()
                refill = (now - self._at) * gate.bounds.messages
                self._room, self._at = min(self._room + refill, gate.bounds.burst) - 1.0, now
                if self._room < 0.0:
                    await self._end(CloseCode.POLICY_VIOLATION, "too many messages")
                if gate.accepts(raw):
                    return raw
                gate.dropped += 1

        async def _end(self, code: CloseCode, reason: str) -> None:
            gate.refused += 1
            await self.close(code, reason)
            raise ConnectionClosedError(None, Close(code, reason))

    return Connection


def check_free(host: str, port: int) -> None:
    """Viser takes the next port where one is taken; a page elsewhere than told helps nobody.

    Raises:
        ConfigError: an address or a port that cannot be listened on.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except (OSError, UnicodeError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        free = "; --port 0 takes any that is free" if port else ""
        raise ConfigError(
            f"--host {host} --port {port}: cannot be listened on: {reason}{free}"
        ) from None


def _upgrades(request: Request) -> bool:
    return request.headers.get("Upgrade", "").lower() == "websocket"


def _name(host: str) -> str:
    """The name in a Host header, its port and brackets apart."""
    return urllib.parse.urlsplit(f"//{host}").hostname or ""


def _port(host: str) -> int:
    """The port in a Host header; 0 where it is none."""
    try:
        return urllib.parse.urlsplit(f"//{host}").port or 80
    except ValueError:
        return 0


def _cookie_name(request: Request) -> str:
    """Cookies know no port: pages on two of them keep two."""
    return f"proxcgal_{_port(request.headers.get('Host', ''))}"
