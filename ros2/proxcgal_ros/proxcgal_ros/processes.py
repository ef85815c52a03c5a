"""From the command line to a spinning node, and its end."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor

from proxcgal.core.errors import ConfigError

try:  # much less time a message, where this ROS 2 has it
    from rclpy.experimental import EventsExecutor
except ImportError:
    EventsExecutor = None

PARAMETERS = "parameters are given as --ros-args -p NAME:=VALUE"


@contextmanager
def spinning(arguments: list[str]) -> Iterator[tuple[Executor, Callable[[], bool]]]:
    """ROS 2 with an executor, and a question whether to go on: not after SIGINT or SIGTERM.

    The signals are not left to rclpy: at its end a node still tells the arm to rest.
    """
    ended = False

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal ended
        del number, frame
        ended = True

    try:
        rclpy.init(args=arguments, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    except RuntimeError:  # rclpy's own kinds of it have no public name
        words = arguments[arguments.index("--ros-args") + 1 :] if "--ros-args" in arguments else []
        raise ConfigError(f"--ros-args {' '.join(words)}: not understood; {PARAMETERS}") from None
    for number in (signal.SIGINT, signal.SIGTERM):  # for good: the process ends after this
        signal.signal(number, end)
    executor: Executor = SingleThreadedExecutor() if EventsExecutor is None else EventsExecutor()
    try:
        yield executor, lambda: rclpy.ok() and not ended
    except ExternalShutdownException:
        pass
    finally:
        executor.shutdown()
        rclpy.try_shutdown()
