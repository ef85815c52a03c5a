"""What is wrong with a scenario file, one line per problem: file, key, value, what is allowed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from proxcgal.sim import toml

_LONGEST_VALUE = 80


def lines(
    model: type[BaseModel], error: ValidationError, origin: str, overridden: Sequence[str]
) -> list[str]:
    """Every problem of `error`, in the file's order.

    Args:
        model: what was validated.
        error: what pydantic found.
        origin: the file, as the user named it.
        overridden: dotted keys whose value came from the command line, not from the file.
    """
    told: dict[str, list[str]] = {}
    for problem in _first_causes(error.errors()):
        key = ".".join(_steps(problem)) or "file"
        is_override = any(key == name or key.startswith(f"{name}.") for name in overridden)
        place = f"{origin}: {'override ' if is_override else ''}{key}"
        subject, allowed = _sentence(model, problem)
        told.setdefault(place + subject, []).append(allowed)
    return [f"{what}: {' or '.join(dict.fromkeys(reasons))}" for what, reasons in told.items()]


def describe_keys(model: type[BaseModel]) -> dict[str, str]:
    """Keys of one table, each with what it means."""
    return {
        field.alias or name: field.description or "a table"
        for name, field in model.model_fields.items()
    }


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables inside a type: itself, or what a list or an option holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from models_in(inner)


def _first_causes(problems: Sequence[Any]) -> list[Any]:
    """Leaves out 'too short' where it only follows from a bad entry of the same list."""
    return [
        problem
        for problem in problems
        if problem["type"] != "too_short"
        or not any(
            len(other["loc"]) > len(problem["loc"])
            and other["loc"][: len(problem["loc"])] == problem["loc"]
            for other in problems
        )
    ]


def _steps(problem: Any) -> list[str]:
    """The path to the key; pydantic puts the tried type of a union in, which is no key."""
    return [
        str(step)
        for step in problem["loc"]
        if isinstance(step, int)
        or not (step in ("int", "str", "float") or "-" in step or "[" in step)
    ]


def _sentence(model: type[BaseModel], problem: Any) -> tuple[str, str]:
    """` = value` and what is allowed instead."""
    steps, kind = _steps(problem), problem["type"]
    if kind == "missing":
        meaning = _keys_at(model, steps[:-1]).get(steps[-1], "")
        return "", "missing" + (f"; {meaning}" if meaning else "")
    if kind == "value_error":
        return "", str(problem["ctx"]["error"])
    given = toml.format_value(problem["input"])
    if len(given) > _LONGEST_VALUE:
        given = given[: _LONGEST_VALUE - 3] + "..."
    if kind == "extra_forbidden":
        known = ", ".join(_keys_at(model, steps[:-1]))
        return f" = {given}", f"unknown key; there are {known}"
    if kind == "model_type":
        return f" = {given}", "must be a table"
    allowed = str(problem["msg"]).replace("Input should", "must").replace("Tuple should", "must")
    return f" = {given}", allowed.replace(" after validation", "").replace("tuple", "list")


def _keys_at(model: type[BaseModel], steps: Sequence[str]) -> dict[str, str]:
    """Keys of the table at `steps`."""
    for step in steps:
        if step.isdigit():
            continue
        fields = {field.alias or name: field for name, field in model.model_fields.items()}
        if step not in fields:
            return {}
        model = next(models_in(fields[step].annotation), model)
    return describe_keys(model)
