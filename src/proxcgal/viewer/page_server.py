"""Starts viser's server behind the access control of its page.

The checks hang in the call by which viser starts its server: there is no second port behind them.
"""

import logging
import secrets
import socket
import threading
import time as clock
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosedError
from websockets.frames import Close, CloseCode
from websockets.http11 import Request, Response

from proxcgal.core.errors import ConfigError
from proxcgal.viewer.access import LOOPBACK, AccessControl
from proxcgal.viewer.client_messages import ClientBounds

_QUIET = logging.getLogger("proxcgal.page")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False


@contextmanager
def served_page(
    host: str,
    port: int,
    *,
    label: str,
    token: str | None = None,
    bounds: ClientBounds | None = None,
) -> Iterator[tuple[viser.ViserServer, AccessControl]]:
    """`serve`, and `close` at the end."""
    server, access = serve(host, port, label=label, token=token, bounds=bounds)
    try:
        yield server, access
    finally:
        close(server)


def serve(
    host: str,
    port: int,
    *,
    label: str,
    token: str | None = None,
    bounds: ClientBounds | None = None,
) -> tuple[viser.ViserServer, AccessControl]:
    """Starts viser's server behind its access control.

    Args:
        host: address to listen on.
        port: 0 for any that is free.
        label: above the page's controls.
        token: that every viewer must show.
        bounds: of what they may send.

    Raises:
        ConfigError: the address cannot be listened on.
    """
    access = AccessControl(host, token, bounds)
    check_free(host, port)
    put_in = threading.Event()
    original = websockets.asyncio.server.serve

    def guarded(handler: Any, *arguments: Any, **options: Any) -> Any:
        put_in.set()
        files = options.pop("process_request")

        async def watched(connection: ServerConnection) -> None:
            with access.viewer() as room:
                if room:
                    await handler(connection)
                else:
                    await connection.close(CloseCode.TRY_AGAIN_LATER, "too many pages")

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if (refusal := access.refusal(request)) is not None:
                return refusal
            response: Response | None = files(connection, request)
            if response is not None:
                response.headers.update(_SHUT)
                if (cookie := access.cookie(request)) is not None:
                    response.headers["Set-Cookie"] = cookie
            return response

        return original(
            watched, *arguments,
            **options | {
                "process_request": answer,
                "max_size": access.bounds.message_bytes,
                "max_queue": 16,
                "open_timeout": 10,
                "close_timeout": 2,
                "ping_interval": 10,
                "ping_timeout": 20,
                "create_connection": _connections(access),
                "logger": _QUIET,  # refused messages are counted, not printed
            },
        )  # fmt: skip

    # viser prints an address of its own, without the token.
    with mock.patch.object(websockets.asyncio.server, "serve", guarded), mock.patch("rich.print"):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if not put_in.is_set():
        close(server)
        raise RuntimeError("viser serves in another way than the gate knows: nothing is served")
    return server, access


def close(server: viser.ViserServer) -> None:
    """Stops serving; every page sees the connection end."""
    with mock.patch("rich.print"):
        server.stop()


#: The page needs no other host, and no other page may hold it in a frame.
_SHUT = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def _connections(access: AccessControl) -> type[ServerConnection]:
    class Connection(ServerConnection):
        """Gives out only accepted messages, at a bounded rate."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._room = access.bounds.burst
            self._at = clock.monotonic()

        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                raw = await super().recv(decode)
                now = clock.monotonic()
                refill = (now - self._at) * access.bounds.messages
                self._room, self._at = min(self._room + refill, access.bounds.burst) - 1.0, now
                if self._room < 0.0:
                    await self._end(CloseCode.POLICY_VIOLATION, "too many messages")
                if access.accepts(raw):
                    return raw
                access.dropped += 1

        async def _end(self, code: CloseCode, reason: str) -> None:
            access.refused += 1
            await self.close(code, reason)
            raise ConnectionClosedError(None, Close(code, reason))

    return Connection


def check_free(host: str, port: int) -> None:
    """Fails early where a port is taken: viser would take the next one.

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


def checked_token(host: str, port: int, token: str | None) -> str | None:
    """The token that pages must show, with a warning where other machines can reach the page.

    Raises:
        ConfigError: an address or a port that there is not, a token that is too easy to guess.
    """
    if not 0 <= port <= 65535:
        raise ConfigError(f"--port {port}: must be 0 to 65535")
    plain = token is None or token.replace("-", "").replace("_", "").isalnum()
    if token is not None and (len(token) < 8 or not token.isascii() or not plain):
        raise ConfigError(
            f"--token {token!r}: must be 8 characters or more, letters, digits, - and _ only"
        )
    if host in LOOPBACK:
        return token
    check_free(host, port)  # no warning of a page that cannot be reached
    warnings.warn(
        f"--host {host}: others than this machine can reach the page; it is not encrypted, and "
        "whoever knows the token can look on and drag the obstacle",
        stacklevel=2,
    )
    return token or secrets.token_urlsafe(16)


def page_address(host: str, port: int, token: str | None) -> str:
    """Address to open in a browser."""
    any_host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}
    name = any_host.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")
