"""The page's access, against real and hostile clients of a real server."""

import socket
import time as clock
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

import proxcgal as px
from proxcgal.viewer import live_view
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.client_messages import ClientBounds, between, one_of, switch
from proxcgal.viewer.page_server import checked_token, close, page_address, serve

SPOKEN = f"viser-v{viser.__version__}"
TOKEN = "correct-horse-battery"
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 1.0, 1.0],
    "fov": 0.8, "near": 0.1, "far": 100.0, "image_height": 400, "image_width": 640,
    "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip


class Served:
    """A server with one slider, and ways to reach it."""

    def __init__(self, **options: Any) -> None:
        self.server, self.access = serve("127.0.0.1", 0, label="test", **options)
        self.slider = self.server.gui.add_slider("d_min", 0.05, 0.5, 0.01, 0.2)
        self.access.allow_control(self.slider, between(0.05, 0.5))
        self.other = self.server.gui.add_slider("not offered", 0.0, 1.0, 0.1, 0.5)
        self.port = self.server.get_port()

    def connect(self, path: str = "", **options: Any) -> ClientConnection:
        return connect(
            f"ws://127.0.0.1:{self.port}/{path}", subprotocols=[SPOKEN], max_size=None, **options
        )

    def get(self, path: str = "", **headers: str) -> Any:
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/{path}", headers=headers)
        return urllib.request.urlopen(request, timeout=60)

    def set_slider(self, value: object, control: Any = None) -> dict[str, Any]:
        uuid = (control or self.slider)._impl.uuid
        return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


@pytest.fixture
def open_page() -> Iterator[Served]:
    served = Served()
    yield served
    close(served.server)


@pytest.fixture
def guarded() -> Iterator[Served]:
    served = Served(token=TOKEN)
    yield served
    close(served.server)


def say(connection: ClientConnection, message: object) -> None:
    connection.send(msgspec.msgpack.encode(message))


def hear(connection: ClientConnection) -> None:
    while True:
        connection.recv(timeout=60.0)


def flood(connection: ClientConnection) -> None:
    for _ in range(100_000):
        say(connection, CAMERA)


def until(condition: Any, seconds: float = 60.0) -> bool:
    end = clock.monotonic() + seconds
    while clock.monotonic() < end:
        if condition():
            return True
        clock.sleep(0.02)
    return False


def test_a_page_on_this_machine_is_served_and_its_slider_heard(open_page: Served) -> None:
    assert b"<html" in open_page.get().read()[:2000].lower()
    with open_page.connect() as connection:
        say(connection, CAMERA)
        say(connection, open_page.set_slider(0.3))
        assert until(lambda: open_page.slider.value == 0.3)
        assert until(lambda: len(open_page.server.get_clients()) == 1)
    assert until(lambda: open_page.access.viewers == 0)
    assert open_page.server.get_clients() == {}


def test_without_the_token_neither_page_nor_connection_is_given(guarded: Served) -> None:
    for path in ("", "?token=", "?token=wrong", f"?token={TOKEN}x"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            guarded.get(path)
        with pytest.raises(InvalidStatus, match="403"):
            guarded.connect(path)
    with pytest.raises(InvalidStatus, match="403"):
        guarded.connect(additional_headers={"Cookie": f"proxcgal_{guarded.port}=wrong"})
    assert guarded.access.refused == 9
    assert guarded.access.viewers == 0


def test_with_the_token_the_page_gets_a_cookie_and_that_opens_the_connection(
    guarded: Served,
) -> None:
    answer = guarded.get(f"?token={TOKEN}")
    cookie = answer.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    with guarded.connect(additional_headers={"Cookie": cookie.partition(";")[0]}) as connection:
        say(connection, CAMERA)
        assert until(lambda: len(guarded.server.get_clients()) == 1)


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Host": "evil.example"},  # a name that was made to point to this machine
        {"Origin": "http://[::1"},
        {"Origin": "http://a]b"},
        {"Host": "[::1"},
        {"Host": "127.0.0.1:port"},
        {"Host": "127.0.0.1:99999999"},
    ],
)
def test_pages_of_other_sites_are_refused(open_page: Served, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        open_page.connect(additional_headers=headers)


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},  # would open a tunnel to a public host
        {"type": "FileTransferStartUpload", "source_component_uuid": "x", "transfer_uuid": "y",
         "filename": "f", "mime_type": "m", "part_count": 1, "size_bytes": 10**12},
        {"type": "GuiRemoveMessage", "uuid": "x"},
        {"type": "ResetGuiMessage"},
        {**CAMERA, "position": [float("nan"), 0.0, 0.0]},
        {**CAMERA, "position": [1.0, 0.0]},
        {**CAMERA, "surprise": 1},
        {"type": "TransformControlsUpdateMessage", "name": "/handle", "owner": "",
         "wxyz": [0.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 0.0]},
        {"type": "TransformControlsUpdateMessage", "name": "/handle", "owner": "",
         "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, float("inf")]},
        {"type": 3}, {}, [], None, 7, "text",
    ],
)  # fmt: skip
def test_a_message_that_no_page_needs_is_dropped(message: object) -> None:
    assert not AccessControl("127.0.0.1").accepts(msgspec.msgpack.encode(message))


def test_a_value_outside_of_its_control_is_dropped(open_page: Served) -> None:
    access, setting = open_page.access, open_page.set_slider
    assert access.accepts(msgspec.msgpack.encode(setting(0.4)))
    for value in (0.0, 0.6, -1, 1e9, float("nan"), float("inf"), "0.3", True, None, [0.3]):
        assert not access.accepts(msgspec.msgpack.encode(setting(value)))
    assert not access.accepts(msgspec.msgpack.encode(setting(0.4, open_page.other)))
    wider = setting(0.4) | {"updates": {"value": 0.4, "max": 9.0}}
    assert not access.accepts(msgspec.msgpack.encode(wider))
    assert not access.accepts(
        msgspec.msgpack.encode(setting(0.4) | {"updates": {"visible": False}})
    )


def test_lists_and_switches_take_what_they_offer() -> None:
    assert one_of(["wb", "sm"])("sm")
    assert not one_of(["wb", "sm"])("rm -rf")
    assert not one_of(["wb", "sm"])(["sm"])
    assert switch(True)
    assert not switch(1)


@given(st.binary(max_size=300))
def test_no_bytes_break_the_gate(raw: bytes) -> None:
    AccessControl("127.0.0.1").accepts(raw)
    AccessControl("127.0.0.1").accepts(b"\xdc" * 3 + raw)


def test_messages_deeply_nested_are_dropped() -> None:
    assert not AccessControl("127.0.0.1").accepts(b"\x91" * 10_000 + b"\x00")


def test_a_message_too_large_ends_its_connection_and_no_other(open_page: Served) -> None:
    with open_page.connect() as good, open_page.connect() as bad:
        say(good, CAMERA)
        bad.send(bytes(100_000))
        with pytest.raises(ConnectionClosed, match="1009"):
            hear(bad)
        say(good, open_page.set_slider(0.35))
        assert until(lambda: open_page.slider.value == 0.35)


def test_a_flood_ends_its_connection_and_no_other(open_page: Served) -> None:
    with open_page.connect() as good, open_page.connect() as bad:
        say(good, CAMERA)
        with pytest.raises(ConnectionClosed):
            flood(bad)
        say(good, open_page.set_slider(0.25))
        assert until(lambda: open_page.slider.value == 0.25)
    assert until(lambda: open_page.access.viewers == 0)


def test_rubbish_is_dropped_without_ending_the_connection(open_page: Served) -> None:
    with open_page.connect() as connection:
        for raw in (b"", b"\xff" * 20, "text", msgspec.msgpack.encode({"type": "ShareUrlRequest"})):
            connection.send(raw)
        say(connection, CAMERA)
        say(connection, open_page.set_slider(0.15))
        assert until(lambda: open_page.slider.value == 0.15)
    assert open_page.access.dropped == 4


def test_more_pages_than_allowed_are_told_so_and_one_that_leaves_makes_room() -> None:
    served = Served(bounds=ClientBounds(viewers=2))
    try:
        with served.connect() as first, served.connect():
            assert until(lambda: served.access.viewers == 2)
            with pytest.raises(InvalidStatus, match="503"):
                served.connect()
            first.close()
            assert until(lambda: served.access.viewers == 1)
            with served.connect():
                assert until(lambda: served.access.viewers == 2)
    finally:
        close(served.server)


def test_a_viewer_that_vanishes_leaves_nothing_behind(open_page: Served) -> None:
    connections = [open_page.connect() for _ in range(3)]
    for connection in connections:
        say(connection, CAMERA)
    assert until(lambda: len(open_page.server.get_clients()) == 3)
    for connection in connections:
        connection.socket.shutdown(socket.SHUT_RDWR)  # no goodbye
    assert until(lambda: open_page.access.viewers == 0)
    assert open_page.server.get_clients() == {}
    assert open_page.server._websock_server._client_state_from_id == {}
    assert open_page.server._websock_server._broadcast_buffer.generator_cursors == {}


def test_a_port_that_is_taken_is_told() -> None:
    served = Served()
    try:
        with pytest.raises(px.ConfigError, match=f"--port {served.port}: cannot be listened on"):
            serve("127.0.0.1", served.port, label="second")
    finally:
        close(served.server)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_on_this_machine_no_token_is_needed(host: str) -> None:
    assert checked_token(host, 8080, None) is None


def test_beyond_this_machine_there_is_a_warning_and_always_a_token() -> None:
    with pytest.warns(UserWarning, match="others than this machine"):
        drawn = checked_token("0.0.0.0", 0, None)
    assert drawn is not None
    assert len(drawn) >= 16
    with pytest.warns(UserWarning, match="not encrypted"):
        assert checked_token("0.0.0.0", 0, TOKEN) == TOKEN
    assert page_address("0.0.0.0", 8080, TOKEN) == f"http://127.0.0.1:8080/?token={TOKEN}"


@pytest.mark.parametrize("token", ["", "short", "with space 123", "käse12345678", "a" * 8 + ";"])
def test_a_token_that_cannot_be_is_refused(token: str) -> None:
    with pytest.raises(px.ConfigError, match="--token"):
        checked_token("127.0.0.1", 8080, token)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["no_such_scene"], "no_such_scene"),
        (["front_plane", "--port", "70000"], "--port 70000: must be 0 to 65535"),
        (["front_plane", "--token", "short"], "--token 'short': must be 8 characters or more"),
        (["front_plane", "--host", "no such host", "--port", "0"], "cannot be listened on"),
        (["front_plane", "--set", "controller.d_min=-1"], "controller.d_min"),
    ],
)
def test_what_cannot_be_viewed_is_told_in_a_line(
    call: Callable[..., Any], options: list[str], message: str
) -> None:
    answer = call("view", *options)
    assert answer.code == 2
    assert message in answer.err
    assert "Traceback" not in answer.err


def test_the_address_is_told_once_there_is_something_to_see(
    call: Callable[..., Any], arm_cell: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def attend(page: Any) -> None:
        handles = page._server.scene._handle_from_node_name
        seen.extend(name for name in handles if name.startswith("/arm/"))

    monkeypatch.setattr(live_view, "_attend", attend)
    monkeypatch.setattr(live_view.os, "nice", lambda _: 0)  # of this process: for good
    answer = call("view", arm_cell, "--port", "0")
    assert answer.code == 0
    assert answer.out.startswith("http://127.0.0.1:")
    assert {"/arm/0_base_link", "/arm/1_upper"} <= set(seen)


def test_a_simulation_that_cannot_begin_is_told_without_an_address(
    call: Callable[..., Any], arm_cell: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_view.os, "nice", lambda _: 0)
    monkeypatch.setattr(live_view, "check_setup", lambda *_, **__: None)  # else it fails before
    answer = call("view", arm_cell, "--port", "0", "--set", "q0=[9.0, 0.0]")
    assert answer.code == 2
    assert answer.out == ""
    assert "q0" in answer.err
