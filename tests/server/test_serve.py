"""The action server's front: real sockets, well-behaved and hostile clients."""

import asyncio
import contextlib
import json
import signal
import socket
import subprocess
import sys
import threading
import time as clock
from collections.abc import Iterator

import numpy as np
import pytest

import proxcgal as px
from proxcgal.cli import serve
from proxcgal.cli.main import main
from proxcgal.core.errors import ConfigError
from proxcgal.server import tcp_server
from proxcgal.server.tcp_server import TcpServer

REACHED = (3.0, 0.291, 1.05)
PATIENCE = 120.0  # [s] for what has to come, however busy the machine is


class Served:
    """A server in a thread of its own."""

    def __init__(self) -> None:
        self.robot = px.JointRobotServer("joint_free", ["simulation.control_hz=100.0"])
        self.loop = asyncio.new_event_loop()
        self.port = 0
        ready = threading.Event()

        async def work() -> None:
            front = TcpServer(self.robot)
            listening = await front.listen("127.0.0.1", 0)
            self.port = listening.sockets[0].getsockname()[1]
            ready.set()
            async with listening:
                await front.run()

        def spin() -> None:
            self.task = self.loop.create_task(work())
            with contextlib.suppress(asyncio.CancelledError):
                self.loop.run_until_complete(self.task)

        self.thread = threading.Thread(target=spin, daemon=True)
        self.thread.start()
        assert ready.wait(PATIENCE)

    def close(self) -> None:
        self.loop.call_soon_threadsafe(self.task.cancel)
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()
        self.robot.close()

    def client(self) -> "Client":
        return Client(self.port)


class Client:
    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.lines = self.socket.makefile("rb")

    def send(self, data: bytes | dict[str, object]) -> None:
        self.socket.sendall(data if isinstance(data, bytes) else json.dumps(data).encode() + b"\n")

    def read(self, kind: str = "") -> dict[str, object]:
        """The next message, of that kind where one is given."""
        while True:
            line = self.lines.readline()
            if not line:
                return {}
            message = json.loads(line)
            if kind in ("", message["type"]):
                return message

    def close(self) -> None:
        self.lines.close()
        self.socket.close()


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    running = Served()
    yield running
    running.close()


@pytest.fixture(scope="module")
def resting() -> Iterator[Served]:
    """One that has never been given a goal: its arm stands still."""
    running = Served()
    yield running
    running.close()


def test_a_goal_goes_out_and_its_feedback_and_one_result_come_back(served: Served) -> None:
    client = served.client()
    client.send({"op": "goal", "translation": [0.0, 0.0, 0.05], "frame": "end_effector"})
    accepted = client.read()
    assert accepted["type"] == "accepted"
    assert client.read("feedback")["goal"] == accepted["goal"]
    result = client.read("result")
    assert (result["goal"], result["outcome"]) == (accepted["goal"], "succeeded")
    client.send({"op": "state"})
    state = client.read()
    assert (state["type"], state["goal"]) == ("state", None)
    client.close()


def test_cancel_and_refusals_are_answered(served: Served) -> None:
    client = served.client()
    client.send({"op": "goal", "translation": REACHED, "init": "mob_mob"})
    refused = client.read()
    assert refused["type"] == "refused"
    assert "kuka_joint_a2" in str(refused["reason"])
    client.send({"op": "goal", "translation": REACHED, "init": "jl"})
    number = client.read("accepted")["goal"]
    client.send({"op": "cancel", "goal": number})
    assert client.read("cancelling")["goal"] == number
    assert client.read("result")["outcome"] == "cancelled"
    client.send({"op": "cancel", "goal": number})
    assert client.read("refused")["reason"] == "this goal is not executed"
    client.close()


def test_whoever_waits_for_a_goal_is_told_when_the_server_ends() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", "import sys; from proxcgal.cli.main import main; sys.exit(main())",
         "serve", "--port", "0"], stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        line = next(text for text in process.stderr if "listening on" in text)
        client = Client(int(line.rpartition(":")[2]))
        client.send({"op": "goal", "translation": REACHED, "init": "jl"})
        number = client.read("accepted")["goal"]
        process.send_signal(signal.SIGINT)
        result = client.read("result")
        assert (result["goal"], result["outcome"]) == (number, "aborted")
        assert result["reason"] == "the server was closed"
        assert client.read() == {}
        client.close()
        assert process.wait(PATIENCE) == 130


def test_a_goal_ends_when_its_client_is_gone(served: Served) -> None:
    client = served.client()
    client.send({"op": "goal", "translation": REACHED, "init": "jl"})
    number = int(str(client.read("accepted")["goal"]))
    client.close()
    until = clock.monotonic() + PATIENCE
    while served.robot.result(number) is None and clock.monotonic() < until:
        clock.sleep(0.02)
    result = served.robot.result(number)
    assert result is not None
    assert result.outcome == "cancelled"


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\xfe\n",
        b"{}\n",
        b"[]\n",
        b"null\n",
        b'{"op": 1}\n',
        b'{"op": "reset"}\n',
        b'{"op": "tasks", "tasks": ["reach"]}\n',
        b'{"op": "goal"}\n',
        b'{"op": "goal", "translation": [NaN, 0, 0]}\n',
        b'{"op": "goal", "translation": [1e999, 0, 0]}\n',
        b'{"op": "goal", "translation": {"0": 1}}\n',
        b'{"op": "goal", "translation": [[1], 2, 3]}\n',
        b'{"op": "goal", "translation": [true, 2, 3]}\n',
        b'{"op": "goal", "translation": [1, 2, 3], "init": ["free"]}\n',
        b'{"op": "goal", "translation": [1, 2, 3], "init": "' + b"x" * 2000 + b'"}\n',
        b'{"op": "goal", "translation": [1, 2, 3], "qd_max": 99}\n',
        b'{"op": "goal", "translation": [' + b"9" * 3900 + b", 0, 0]}\n",
        b'{"op": "cancel", "goal": "1"}\n',
        b'{"op": "cancel", "goal": 1e30}\n',
        b"[" * 4000 + b"\n",
    ],
)
def test_nonsense_is_answered_and_moves_nothing(resting: Served, line: bytes) -> None:
    client = resting.client()
    before = resting.robot.q
    client.send(line)
    assert client.read()["type"] in ("error", "refused")
    client.send({"op": "state"})
    state = client.read()
    assert state["type"] == "state"
    assert state["goal"] is None
    np.testing.assert_allclose(state["q"], before, atol=1e-9)
    client.close()


def test_what_a_goal_lacks_is_named(served: Served) -> None:
    client = served.client()
    client.send({"op": "goal", "frame": "kuka_base"})
    answer = client.read()
    assert answer["type"] == "refused"
    assert "translation is missing" in str(answer["reason"])
    client.close()


def test_a_message_without_end_is_cut_off(served: Served) -> None:
    client = served.client()
    client.send(b"x" * (tcp_server.LINE_BYTES + 2000))
    assert "at most" in str(client.read()["reason"])
    assert client.read() == {}
    client.close()


def test_a_client_may_send_a_burst_and_then_at_a_rate() -> None:
    client = tcp_server._Client(writer=None)  # type: ignore[arg-type]
    assert [client.spend(100.0) for _ in range(tcp_server.BURST + 1)] == [
        True
    ] * tcp_server.BURST + [False]
    assert not client.spend(100.0 + 0.9 / tcp_server.RATE)
    assert client.spend(100.0 + 1.1 / tcp_server.RATE)
    assert sum(client.spend(200.0) for _ in range(3 * tcp_server.BURST)) == tcp_server.BURST


def test_a_flood_is_cut_off_and_the_others_go_on(served: Served) -> None:
    began = clock.monotonic()
    flood, other = served.client(), served.client()
    flood.send(b'{"op": "state"}\n' * 2000)
    answers = []
    while message := flood.read():
        answers.append(message["type"])
    took = clock.monotonic() - began
    assert answers[-1] == "error"
    assert len(answers) <= tcp_server.BURST + tcp_server.RATE * took + 2
    other.send({"op": "state"})
    assert other.read()["type"] == "state"
    flood.close()
    other.close()


def test_clients_beyond_the_bound_are_turned_away(served: Served) -> None:
    clients = [served.client() for _ in range(tcp_server.CLIENTS)]
    for client in clients:
        client.send({"op": "state"})
        assert client.read()["type"] == "state"
    late = served.client()
    assert "connected already" in str(late.read()["reason"])
    assert late.read() == {}
    for client in [*clients, late]:
        client.close()
    # Once the server has seen them go, there is room again.
    until, kind = clock.monotonic() + PATIENCE, "error"
    while kind == "error" and clock.monotonic() < until:
        again = served.client()
        again.send({"op": "state"})
        kind = str(again.read()["type"])
        again.close()
    assert kind == "state"


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.2", "::", "example.org", ""])
def test_only_loopback_is_listened_on_unless_asked_for(host: str) -> None:
    with pytest.raises(ConfigError, match="not a loopback address"):
        serve._check_address(serve.ServeOptions(host=host))
    serve._check_address(serve.ServeOptions(host="::1"))


def test_serve_refuses_another_kind_of_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "--scenario", "front_plane"]) == 2
    assert "kind = 'static'; needs 'joint'" in capsys.readouterr().err
    assert main(["serve", "--port", "70000"]) == 2
    assert "must be 0 to 65535" in capsys.readouterr().err


def test_a_client_that_sends_no_more_still_gets_its_result(served: Served) -> None:
    client = served.client()
    client.send({"op": "goal", "translation": REACHED, "init": "jl"})
    number = client.read("accepted")["goal"]
    client.socket.shutdown(socket.SHUT_WR)
    served.robot.cancel(int(str(number)))
    assert client.read("result")["goal"] == number
    assert client.read() == {}


def test_a_client_that_says_nothing_is_dropped(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tcp_server, "IDLE_S", 0.2)
    assert served.client().read()["reason"] == "no message for 0.2 s"


def test_a_message_that_does_not_end_is_given_up(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tcp_server, "LINE_S", 0.2)
    client = served.client()
    client.send(b'{"op": "st')
    assert client.read()["reason"] == "a message takes at most 0.2 s"


def test_one_address_begins_two_messages_at_most(served: Served) -> None:
    slow = [served.client() for _ in range(2)]
    for client in slow:
        client.send(b'{"op": ')
        clock.sleep(0.1)
    third = served.client()
    third.send(b'{"op": ')
    assert third.read()["reason"] == "at most 2 unfinished messages of one address"
    slow[0].send(b'"state"}\n')  # the others go on
    assert slow[0].read()["type"] == "state"
    whole = served.client()
    whole.send({"op": "state"})
    assert whole.read()["type"] == "state"
