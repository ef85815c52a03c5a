"""From typed words to a command's options; a message of one line where they do not fit."""

import difflib
import inspect
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import fields
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from proxcgal.core.errors import ConfigError

#: What a type takes.
_WORDS = {int: "a whole number", float: "a number"}


def parse_words(options_type: type, program: str, arguments: Sequence[str]) -> Any:
    """The options in these words.

    Args:
        options_type: a dataclass as tyro reads it.
        program: as the user calls it.
        arguments: without the program's name.

    Raises:
        ConfigError: what does not fit: option, value, what is allowed.
        SystemExit: after help.
    """
    import tyro  # 0.2 s that `--help` and a wrong command need not wait for

    _refuse_none(options_type, arguments)
    message = io.StringIO()
    try:
        with redirect_stderr(message):
            return tyro.cli(
                options_type,
                prog=program,
                description=inspect.cleandoc(options_type.__doc__ or ""),  # examples and all
                args=list(arguments),
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as end:
        if not end.code:
            raise
        box = _unboxed(message.getvalue())
    raise ConfigError(_line(options_type, program, arguments, box)) from None


def _refuse_none(options_type: type, arguments: Sequence[str]) -> None:
    """Tyro takes the word None for an option that was left out."""
    for before, word in zip(["", *arguments], arguments, strict=False):
        name, equals, value = word.partition("=")
        if not (equals and name.startswith("--")):
            name, value = before.partition("=")[0], word
        if value == "None" and _field(options_type, name) is not None:
            raise ConfigError(f"{name} None: {_allowed(options_type, name)}")


def _line(options_type: type, program: str, arguments: Sequence[str], box: str) -> str:
    """The parser's message as one line in our form; as it is where it is of another kind."""
    if found := re.match(r"Unrecognized options: (.*?)(?: Perhaps| Similar|$)", box):
        word = found[1].split(", ")[0]
        names = [f"--{field.name.replace('_', '-')}" for field in fields(options_type)]
        near = difflib.get_close_matches(word.partition("=")[0], names, n=1, cutoff=0.7)
        hint = f"; did you mean {near[0]}?" if near else f"; {program} --help tells what there is"
        return f"{word}: not known{hint}"
    if found := re.match(r"Missing from .*?: (\S+)", box):
        return f"{found[1]}: missing; {program} --help tells what it is"
    if found := re.match(r"Missing value for argument '(.*?)'", box):
        return f"{found[1]}: value missing: {_allowed(options_type, found[1])}"
    if found := re.match(r"invalid choice '(.*?)' for argument '(.*?)'", box):
        name = _shown(options_type, found[2])
        return f"{name} {found[1]}: {_allowed(options_type, found[2])}"
    if found := re.match(r"Error parsing (\S+?): ", box):
        value = _typed_value(found[1], arguments)
        return f"{_shown(options_type, found[1])} {value}: {_allowed(options_type, found[1])}"
    return box


def _unboxed(box: str) -> str:
    """The text in the parser's box under its title, up to the next rule, as one line."""
    inside: list[str] = []
    for line in re.sub(r"\x1b\[[0-9;]*m", "", box).splitlines()[1:]:  # where it has no colours
        words = line.strip("│| ")
        if words and not words.strip("─-╰╯+"):
            if inside:
                break
        elif words:
            inside.append(words)
    return " ".join(inside)


def _allowed(options_type: type, name: str) -> str:
    field = _field(options_type, name)
    kinds = [] if field is None else list(_kinds(get_type_hints(options_type)[field]))
    if choices := [kind for kind in kinds if isinstance(kind, str)]:
        return f"must be one of {', '.join(dict.fromkeys(choices))}"
    return f"must be {next((_WORDS[kind] for kind in kinds if kind in _WORDS), 'a value')}"


def _kinds(annotation: Any) -> Iterator[Any]:
    """Types and choices that an annotation holds, in its order."""
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    elif get_origin(annotation) in (Union, UnionType, tuple):
        for inner in get_args(annotation):
            yield from _kinds(inner)
    elif annotation not in (NoneType, Ellipsis):
        yield annotation


def _field(options_type: type, name: str) -> str | None:
    """The field that an option or a positional argument goes to; None where there is none."""
    plain = name.lstrip("-").replace("-", "_").lower()
    return plain if name and plain in {field.name for field in fields(options_type)} else None


def _shown(options_type: type, name: str) -> str:
    return name if name.startswith("--") or _field(options_type, name) is None else name.upper()


def _typed_value(name: str, arguments: Sequence[str]) -> str:
    """The value as it was typed."""
    for word, value in zip(arguments, [*arguments[1:], ""], strict=True):
        if word == name:
            return value
        if word.startswith(f"{name}="):
            return word.partition("=")[2]
    return ""
