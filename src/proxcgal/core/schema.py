"""Tables of a file that users write: strict types, bounds, and defaults of the C++ core."""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from proxcgal import _core


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


def like(
    struct: str,
    attribute: str,
    description: str,
    *,
    ge: float | None = None,
    le: float | None = None,
    lt: int | None = None,
) -> Any:
    """A field whose default is that of the core's struct; bounds as pydantic names them."""

    def default() -> Any:
        value = getattr(getattr(_core, struct)(), attribute)
        return tuple(np.asarray(value).tolist()) if isinstance(value, list | np.ndarray) else value

    return Field(default_factory=default, description=description, ge=ge, le=le, lt=lt)


class Section(BaseModel):
    """A table of the file: unknown keys are errors, values are not converted, nothing changes."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
