"""What is wrong with a scenario file, one line per problem: file, key, value, what is allowed."""

from collections.abc import Iterator, Sequence
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from proxcgal.core import toml

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
        key = ".".join(_steps(model, problem["loc"])) or "file"
        is_override = any(key == name or key.startswith(f"{name}.") for name in overridden)
        place = f"{origin}: {'override ' if is_override else ''}{key}"
        subject, allowed = _sentence(model, problem)
        told.setdefault(place + subject, []).append(allowed)
    return [f"{what}: {' or '.join(dict.fromkeys(reasons))}" for what, reasons in told.items()]


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


def _steps(model: type[BaseModel], loc: Sequence[int | str]) -> list[str]:
    """The path to the key; pydantic puts the tried type of a union in, which is no key.

    A name is a key where the schema has a table there, or a dictionary of the user's own names.
    """
    steps: list[str] = []
    place: Any = model
    for step in loc:
        if isinstance(step, int):
            steps.append(str(step))
        elif (table := next(models_in(place), None)) is not None:
            steps.append(step)
            place = _fields(table)[step].annotation if step in _fields(table) else None
        elif get_origin(place) is dict:
            steps.append(step)
            place = get_args(place)[1]
    return steps


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """By the names that the file has for them."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _sentence(model: type[BaseModel], problem: Any) -> tuple[str, str]:
    """` = value` and what is allowed instead."""
    steps, kind = _steps(model, problem["loc"]), problem["type"]
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
    """Keys of the table at `steps`, each with what it means."""
    for step in (step for step in steps if not step.isdigit()):
        fields = _fields(model)
        if step not in fields:
            return {}
        model = next(models_in(fields[step].annotation), model)
    return {name: field.description or "a table" for name, field in _fields(model).items()}
