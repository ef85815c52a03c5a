"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Literal, TypeVar

import tyro

from proxcgal.core.errors import ConfigError

ControllerName = Literal["wb", "sm", "wb_known", "wb_memory"]
T = TypeVar("T")

#: May be given once with several values, or several times.
Settings = Annotated[
    tuple[tuple[str, ...], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="KEY=VALUE ...", help_behavior_hint=""),
]
Folders = Annotated[
    tuple[tuple[Path, ...], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="DIR ...", help_behavior_hint=""),
]
Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]
Number = Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")]


def flat(groups: tuple[tuple[T, ...], ...], option: str = "--set") -> list[T]:
    """The values of all the times an option was given, in order.

    Raises:
        ConfigError: it was given without any.
    """
    if () in groups:
        raise ConfigError(f"{option}: given without a value")
    return [value for group in groups for value in group]


def checked_workers(workers: int | None) -> int | None:
    """The option as given. Raises: ConfigError under 1."""
    if workers is not None and workers < 1:
        raise ConfigError(f"--workers {workers}: must be 1 or more")
    return workers


def xacro_arguments(words: list[str]) -> dict[str, str]:
    """Arguments of a xacro, by name. Raises: ConfigError: one is no name=value, or comes twice."""
    found: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ConfigError(f"--xacro-arg {word}: name=value is needed")
        if name in found:
            raise ConfigError(f"--xacro-arg {name}: given twice")
        found[name] = value
    return found
