"""What the documentation has to say of the keys of a scenario file."""

from pydantic import BaseModel

from proxcgal.core import toml
from proxcgal.scenario.problems import models_in


def rows_of(model: type[BaseModel], path: str = "") -> list[str]:
    """The rows of the documentation's tables: key, default, meaning."""
    rows = []
    for name, field in model.model_fields.items():
        key = f"{path}{field.alias or name}"
        if inner := list(models_in(field.annotation)):
            rows += rows_of(inner[0], f"{key}.")
        else:
            value = field.get_default(call_default_factory=True, validated_data={})
            default = "required" if field.is_required() else toml.format_value(value)
            rows.append(f"| `{key}` | {default} | {field.description} |".replace("None", "-"))
    return rows
