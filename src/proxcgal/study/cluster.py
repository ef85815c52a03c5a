"""Workers of a dask.distributed scheduler: another machine's processes, or a hundred machines'."""

import logging
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Executor
from importlib import import_module
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.provenance import versions

CONNECT_S = 4.0  # [s] in which a scheduler has to take a connection
GREETING_S = 3.0  # [s] in which it sends its first bytes
ANSWER_S = 6.0  # [s] in which a client has to be ready, whatever the other side sends
# A scheduler's first 8 bytes are a length; what text begins with, taken as one, is far above this.
_LONGEST_GREETING = 1 << 26

_alone = threading.Lock()  # MuJoCo's warnings belong to a process: one job at a time in each


class Cluster:
    """A scheduler that runs already, and its workers."""

    def __init__(self, address: str) -> None:
        """Connects.

        Args:
            address: of the scheduler, such as tcp://10.0.0.1:8786.

        Raises:
            ConfigError: no scheduler answers there, or a worker has other versions.
        """
        try:
            distributed: Any = import_module("distributed")  # 0.5 s; ships half of its types
        except ImportError:
            raise ConfigError(
                f"--cluster {address}: needs the package distributed: "
                "pip install 'proxcgal[cluster]'"
            ) from None
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(
                logging.CRITICAL
            )  # its errors are reported in one line here
        self.address = address
        #: What a job ends as that workers died with, whether they ran it or had it in their queue.
        self.killed: type[Exception] = distributed.KilledWorker
        try:
            # First: a client of an address that is none fails half made, and again when collected.
            plain = import_module("distributed.comm").resolve_address(address)
            _require_greeting(plain)
            self._client = _within(
                ANSWER_S,
                lambda: distributed.Client(address, timeout=CONNECT_S, set_as_default=False),
            )
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"--cluster {address}: no scheduler answers there: {_first_line(error)}; "
                "it takes the address that `dask scheduler` prints, such as tcp://10.0.0.1:8786"
            ) from None
        self.executor: Executor = self._client.get_executor(pure=False)
        try:
            self._compare()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Gives up what still runs there, and leaves; the scheduler goes on."""
        self._client.close()

    def deaths(self, killed: BaseException) -> int:
        """How many workers died before the scheduler gave a job up."""
        return int(getattr(killed, "allowed_failures", 0)) + 1

    def _compare(self) -> None:
        """Compares the versions of the workers that are there; later ones are not checked."""
        if not self._client.scheduler_info()["workers"]:
            raise ConfigError(
                f"--cluster {self.address}: has no workers; start some with "
                f"`dask worker {self.address} --nthreads 1`"
            )
        try:
            found: dict[str, dict[str, str]] = self._client.run(versions)
        except Exception as error:
            raise ConfigError(
                f"--cluster {self.address}: a worker has no proxcgal that can be used: "
                f"{type(error).__name__}: {_first_line(error)}"
            ) from None
        own = versions()
        apart = [
            f"--cluster {self.address}: worker {worker} has {name} {theirs.get(name)}, "
            f"this machine {own.get(name)}: all must be the same"
            for worker, theirs in sorted(found.items())
            for name in sorted((own.keys() | theirs.keys()) - {"machine", "python"})
            if theirs.get(name) != own.get(name)
        ]
        if apart:
            raise ConfigError("\n".join(apart))


def _require_greeting(address: str) -> None:
    """See that a scheduler speaks at a tcp:// address: it sends its handshake unasked.

    distributed waits without end for one that takes a connection and says nothing of the kind.

    Raises:
        OSError: nobody there, or something else.
    """
    scheme, _, place = address.partition("://")
    if scheme != "tcp":
        return
    host, _, port = place.rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port)), GREETING_S) as connection:
        connection.settimeout(GREETING_S)
        try:
            first = connection.recv(8, socket.MSG_WAITALL)
        except TimeoutError:
            raise OSError(f"it says nothing for {GREETING_S:g} s") from None
    if len(first) < 8 or int.from_bytes(first, "little") > _LONGEST_GREETING:
        raise OSError("it does not speak dask's protocol")


def _within(seconds: float, make: Callable[[], Any]) -> Any:
    """What `make` makes, within that time. Raises: OSError: it takes longer; as `make` does."""
    made: list[Any] = []
    failed: list[BaseException] = []

    def work() -> None:
        try:
            made.append(make())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(seconds)
    if failed:
        raise failed[0]
    if not made:
        raise OSError(f"no answer within {seconds:g} s")
    return made[0]


def work_far(job: Any) -> Any:
    """One job on a worker of the cluster; its share done is not reported."""
    with _alone:
        return job(lambda _: None)


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
