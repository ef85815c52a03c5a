"""Tables of a file that users write: strict types, bounds, and defaults of the C++ core."""

import math
from collections.abc import Collection, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetPydanticSchema,
    create_model,
)
from pydantic_core import core_schema

from proxcgal._core import FieldRecord, field_tables


def _not_nan(value: float) -> float:
    if math.isnan(value):
        raise ValueError("must not be nan")
    return value


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Vector = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]
#: May be infinite: a bound that is off.
Bound = Annotated[float, Field(allow_inf_nan=True), AfterValidator(_not_nan)]


class Section(BaseModel):
    """A table of the file: unknown keys are errors, values are not converted, nothing changes."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


def core_table(
    struct: str, *, only: Sequence[str] = (), omit: Collection[str] = (), **narrower: Any
) -> Any:
    """Base of a table whose keys are the settings of a config struct of the core.

    Args:
        struct: its name in `_core.field_tables()`: keys, types, bounds, defaults, descriptions.
        only: these settings, in this order; empty for all.
        omit: settings that a file does not have.
        narrower: further bounds of settings in a file, as pydantic names them.
    """
    return table_from(struct, field_tables()[struct], only, omit, **narrower)


def core_key(struct: str, setting: str) -> Any:
    """A key under a name of the file's own: bound, default and description of a core's setting."""
    record = _record(struct, setting)
    return _field(record, **(_bounds(record) if record.type in ("int", "float") else {}))


def core_choice(struct: str, setting: str) -> GetPydanticSchema:
    """For the annotation of a `core_key` that is one of several names."""
    names = _record(struct, setting).choices
    return GetPydanticSchema(lambda _type, _handler: core_schema.literal_schema(list(names)))


def _record(struct: str, setting: str) -> FieldRecord:
    return next(each for each in field_tables()[struct] if each.name == setting)


def table_from(
    struct: str,
    records: Sequence[FieldRecord],
    only: Sequence[str] = (),
    omit: Collection[str] = (),
    **narrower: Any,
) -> type[Section]:
    """The same from a table of fields, such as another module's of its own."""
    every = {record.name: record for record in records if record.name not in omit}
    chosen = [every[name] for name in only or every]
    keys: dict[str, Any] = {
        each.name: (
            Annotated[_annotation(each), Field(**narrower.get(each.name, {}))],
            _field(each),
        )
        for each in chosen
    }
    return create_model(struct, __base__=Section, **keys)


def _field(record: FieldRecord, **bounds: Any) -> Any:
    unit = f"[{record.unit}] " if record.unit else ""
    default: Any = ... if record.required else record.default
    if isinstance(default, list | np.ndarray):
        default = tuple(np.asarray(default).tolist())
    return Field(default, description=unit + record.sentence, **bounds)


def _annotation(record: FieldRecord) -> Any:
    """Its type with its bounds."""
    match record.type:
        case "enum":
            return Literal[tuple(record.choices)]
        case "strings":
            return tuple[str, ...]
        case "bool":
            return bool
        case "int":
            return Annotated[int, Field(**_bounds(record))]
        case "vector":
            number = Annotated[float, Field(**_bounds(record))]
            size = record.size or None
            return Annotated[tuple[number, ...], Field(min_length=size or 1, max_length=size)]
    # A file states finite numbers, but where infinity switches a bound off.
    standard: Any = record.default
    return Bound if math.isinf(standard) else Annotated[float, Field(**_bounds(record))]


def _bounds(record: FieldRecord) -> dict[str, Any]:
    """As pydantic names them; whole numbers for an int."""
    number = int if record.type == "int" else float
    least, most = "gt" if record.least_exclusive else "ge", "lt" if record.most_exclusive else "le"
    ends = ((least, record.least), (most, record.most))
    return {name: number(value) for name, value in ends if math.isfinite(value)}
