"""The action server over TCP: one JSON object a line, clients bounded in size, count and rate."""

import asyncio
import contextlib
import json
import signal
import sys
from dataclasses import asdict, dataclass, field
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.server.goals import GoalRefusedError, JointGoal
from proxcgal.server.joint_server import JointRobotServer

LINE_BYTES = 4096  # of one message
CLIENTS = 8
RATE = 20.0  # [1/s] messages of one client, in the long run
BURST = 20  # at once
UNREAD_BYTES = 1 << 18  # that a client may leave unread before it is dropped
FEEDBACK_S = 0.1  # [s] between two feedbacks
CLOSE_S = 1.0  # [s] that a client has to read its last message
IDLE_S = 300.0  # [s] without a message and without a goal, after which a client is dropped
LINE_S = 10.0  # [s] in which a message that has begun has to be whole
UNFINISHED = 2  # messages of one address that have begun and are not whole


def serve_until_stopped(robot: JointRobotServer, host: str, port: int, *, quiet: bool) -> None:
    """Serves until SIGINT, which is raised, or SIGTERM.

    Args:
        robot: that no other caller steps.
        host: address to listen on.
        port: 0 takes any that is free.
        quiet: no message on stderr.

    Raises:
        ConfigError: the port cannot be had.
    """
    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(_serve(robot, host, port, quiet))


async def _serve(robot: JointRobotServer, host: str, port: int, quiet: bool) -> None:
    server = TcpServer(robot)
    listening = await server.listen(host, port)
    host, port = listening.sockets[0].getsockname()[:2]
    if not quiet:
        print(f"listening on {host}:{port}", file=sys.stderr, flush=True)
    stop = asyncio.current_task()
    assert stop is not None
    # Ctrl-C cancels this task already; SIGTERM of a service manager does the same.
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.cancel)
    async with listening:
        try:
            await server.run()
        finally:
            listening.close()
            await server.close()


class ClientError(Exception):
    """What a client did that ends its connection."""


@dataclass(eq=False)
class _Client:
    """One connection with its rate, and its goals."""

    writer: asyncio.StreamWriter
    tokens: float = BURST
    refilled: float = 0.0
    goals: set[int] = field(default_factory=set)  # that are still to end
    buffer: bytes = b""  # of a message that has begun

    @property
    def address(self) -> str:
        """Of the other side, without its port."""
        return str((self.writer.get_extra_info("peername") or ("?",))[0])

    def spend(self, now: float) -> bool:
        """Takes one of the messages that it may still send; False: none is left."""
        self.tokens = min(self.tokens + (now - self.refilled) * RATE, BURST)
        self.refilled = now
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True

    def send(self, message: dict[str, Any]) -> None:
        """Writes a line; a client that does not read is dropped."""
        transport = self.writer.transport
        if transport.is_closing():
            return
        if transport.get_write_buffer_size() > UNREAD_BYTES:
            transport.abort()
            return
        self.writer.write(json.dumps(message, allow_nan=False).encode() + b"\n")


class TcpServer:
    """Clients on one side, one robot on the other; all of it in one thread.

    No message resets a stop, changes tasks or widens a limit: there is none for it.
    """

    def __init__(self, robot: JointRobotServer) -> None:
        """Args: `robot` that no other caller steps."""
        self._robot = robot
        self._clients: set[_Client] = set()

    async def listen(self, host: str, port: int) -> asyncio.Server:
        """Opens the port. Raises: ConfigError: it cannot be had."""
        try:
            return await asyncio.start_server(self._client, host, port, limit=LINE_BYTES)
        except OSError as error:
            raise ConfigError(f"{host}:{port}: cannot be listened on: {error.strerror}") from None

    async def run(self) -> None:
        """A tick each period, in real time; feedback and results to the clients of the goals."""
        loop = asyncio.get_running_loop()
        due = feedback_due = loop.time()
        while True:
            self._robot.step(wait=False)
            self._send_results()
            if loop.time() >= feedback_due:
                feedback_due = loop.time() + FEEDBACK_S
                self._send_feedback()
            due = max(due + self._robot.period, loop.time() - FEEDBACK_S)
            await asyncio.sleep(max(due - loop.time(), 0.0))

    async def close(self) -> None:
        """Ends the goal that is executed, sends its result, and closes all connections."""
        self._robot.close()
        self._send_results()
        clients = list(self._clients)
        for client in clients:
            client.writer.close()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(
                asyncio.gather(
                    *(client.writer.wait_closed() for client in clients), return_exceptions=True
                ),
                CLOSE_S,
            )

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = _Client(writer, refilled=asyncio.get_running_loop().time())
        try:
            if len(self._clients) >= CLIENTS:
                client.send(_error(f"{CLIENTS} clients are connected already"))
                return
            self._clients.add(client)
            await self._talk(client, reader)
        except (ConnectionError, TimeoutError):
            pass
        finally:
            self._clients.discard(client)
            for number in client.goals:  # their client is gone
                self._robot.cancel(number)
            with contextlib.suppress(ConnectionError, TimeoutError):
                await asyncio.wait_for(writer.drain(), 1.0)
            writer.close()

    async def _talk(self, client: _Client, reader: asyncio.StreamReader) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                line = await self._line(client, reader)
            except ClientError as error:
                client.send(_error(str(error)))
                return
            if not line:
                await self._outlast(client)
                return
            if not client.spend(loop.time()):
                client.send(_error(f"at most {RATE:g} messages a second"))
                return
            client.send(self._answer(client, line))

    async def _line(self, client: _Client, reader: asyncio.StreamReader) -> bytes:
        """The next message, whole; empty where the client sends no more.

        Raises:
            ClientError: it is too long or too slow, or its address has begun too many.
        """
        loop = asyncio.get_running_loop()
        latest = loop.time() + (LINE_S if client.buffer else IDLE_S)
        while b"\n" not in client.buffer:
            if len(client.buffer) > LINE_BYTES:
                raise ClientError(f"a message has at most {LINE_BYTES} bytes")
            try:
                data = await asyncio.wait_for(reader.read(LINE_BYTES), latest - loop.time())
            except TimeoutError:
                if client.buffer:
                    raise ClientError(f"a message takes at most {LINE_S:g} s") from None
                if not client.goals:
                    raise ClientError(f"no message for {IDLE_S:g} s") from None
                latest = loop.time() + IDLE_S
                continue
            if not data:
                return b""
            if not client.buffer:
                latest = loop.time() + LINE_S
            client.buffer += data
            self._bound_unfinished(client)
        line, _, client.buffer = client.buffer.partition(b"\n")
        if len(line) >= LINE_BYTES:
            raise ClientError(f"a message has at most {LINE_BYTES} bytes")
        return line + b"\n"

    def _bound_unfinished(self, client: _Client) -> None:
        unfinished = sum(
            bool(other.buffer) and b"\n" not in other.buffer
            for other in self._clients
            if other.address == client.address
        )
        if unfinished > UNFINISHED and b"\n" not in client.buffer:
            raise ClientError(f"at most {UNFINISHED} unfinished messages of one address")

    async def _outlast(self, client: _Client) -> None:
        """Waits for the results of a client that sends no more and may still read."""
        while client.goals and not client.writer.transport.is_closing():
            await asyncio.sleep(FEEDBACK_S / 2)

    def _answer(self, client: _Client, line: bytes) -> dict[str, Any]:
        """The answer to one message, whatever it is."""
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            return _error("not a JSON object")
        if not isinstance(message, dict):
            return _error("not a JSON object")
        operations = {"goal": self._goal, "cancel": self._cancel, "state": self._state}
        name = message.pop("op", None)
        operation = operations.get(name) if isinstance(name, str) else None
        if operation is None:
            return _error(f"op must be one of {', '.join(operations)}")
        return operation(client, message)

    def _goal(self, client: _Client, message: dict[str, Any]) -> dict[str, Any]:
        optional = ("rpy", "frame", "init")
        unknown = [str(key)[:40] for key in message if key not in ("translation", *optional)]
        missing = ["translation"] if "translation" not in message else []
        texts = [key for key in ("init", "frame") if not isinstance(message.get(key, ""), str)]
        if unknown or texts or missing:
            return {
                "type": "refused",
                "reason": f"a goal has translation, and may have {', '.join(optional)}"
                + "".join(f"; {key} is missing" for key in missing)
                + "".join(f"; {key} is unknown" for key in unknown[:4])
                + "".join(f"; {key} must be a string" for key in texts),
            }
        long = [key for key in ("init", "frame") if len(message.get(key, "")) > 80]
        if long:
            return {"type": "refused", "reason": f"{long[0]}: at most 80 characters"}
        try:
            number = self._robot.send_goal(JointGoal(**message))
        except GoalRefusedError as refused:
            return {"type": "refused", "reason": str(refused)}
        client.goals.add(number)
        return {"type": "accepted", "goal": number}

    def _cancel(self, client: _Client, message: dict[str, Any]) -> dict[str, Any]:
        """Any client may cancel: braking is never wrong."""
        number = message.get("goal")
        if message.keys() != {"goal"} or not isinstance(number, int) or isinstance(number, bool):
            return {"type": "refused", "reason": "cancel has a goal, which is a number"}
        if not self._robot.cancel(number):
            return {"type": "refused", "goal": number, "reason": "this goal is not executed"}
        return {"type": "cancelling", "goal": number}

    def _state(self, client: _Client, message: dict[str, Any]) -> dict[str, Any]:
        feedback = self._robot.feedback()
        return {
            "type": "state",
            "q": self._robot.q.tolist(),
            "tasks": list(self._robot.tasks),
            "goal": None if feedback is None else asdict(feedback),
        }

    def _send_results(self) -> None:
        for client in list(self._clients):
            for number in sorted(client.goals):
                result = self._robot.result(number)
                if result is not None:
                    client.goals.discard(number)
                    client.send({"type": "result", **asdict(result)})

    def _send_feedback(self) -> None:
        feedback = self._robot.feedback()
        for client in list(self._clients):
            if feedback is not None and feedback.goal in client.goals:
                client.send({"type": "feedback", **asdict(feedback)})


def _error(reason: str) -> dict[str, Any]:
    return {"type": "error", "reason": reason}
