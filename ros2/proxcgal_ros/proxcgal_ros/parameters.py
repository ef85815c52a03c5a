"""The node's parameters: declared with ranges and descriptions; most may change at run time."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from proxcgal.core.errors import ConfigError

SECOND_GOAL = ("preempt", "refuse")


@dataclass(frozen=True)
class Number:
    """A parameter that may change while the node runs."""

    low: float
    high: float
    description: str


#: Keys of a scenario's [controller] that may change at run time, and between what.
TUNING: dict[str, Number] = {
    "d_min": Number(0.02, 1.0, "[m] distance that avoidance keeps"),
    "buffer": Number(0.01, 1.0, "[m] above d_min; avoidance comes in inside it"),
    "avoid_gain": Number(0.1, 10.0, "[1/s] of avoidance"),
    "reach_gain": Number(0.1, 10.0, "[1/s] of the way to the goal"),
    "max_linear": Number(0.01, 2.0, "[m/s] at most of the tool on its way to the goal"),
    "max_angular": Number(0.01, 3.0, "[rad/s] at most of the tool on its way to the goal"),
}
#: The node's own, with their defaults.
RULES: dict[str, tuple[float, Number]] = {
    "goal_timeout": (
        60.0,
        Number(0.1, 3600.0, "[s] a goal that is not reached by then is aborted"),
    ),
    "position_tolerance": (0.03, Number(0.001, 0.5, "[m] from the goal; nearer is there")),
    "angle_tolerance": (0.05, Number(0.001, 1.0, "[rad] from the goal; nearer is there")),
    "cloud_hz": (15.0, Number(0.1, 100.0, "[1/s] clouds and markers, at most")),
    "diagnostics_hz": (2.0, Number(0.1, 50.0, "[1/s] diagnostics, at most")),
}


#: Of parameters, as people write them.
_KINDS = {
    ParameterType.PARAMETER_STRING: "a text",
    ParameterType.PARAMETER_STRING_ARRAY: "a list of texts",
    ParameterType.PARAMETER_BOOL: "true or false",
    ParameterType.PARAMETER_DOUBLE: "a number with a point, such as 0.2",
}


def _declared(node: Node, name: str, default: Any, kind: ParameterDescriptor) -> Any:
    """Declares it, and gives its value. Raises: ConfigError, with what is allowed."""
    try:
        return node.declare_parameter(name, default, kind).value
    except (InvalidParameterTypeException, InvalidParameterValueException) as error:
        told = re.search(r" to '(.*?)' of type|value \((.*?)\) for", str(error), re.DOTALL)
        value = next(filter(None, told.groups()), "") if told else str(error)
        allowed = _KINDS[kind.type]
        for span in kind.floating_point_range:
            allowed += f", from {span.from_value:g} to {span.to_value:g}"
        raise ConfigError(
            f"parameter {name} = {value}: must be {allowed} ({kind.description})"
        ) from None


def fixed_text(node: Node, name: str, default: str, description: str) -> str:
    """Declares a parameter that only a launch can set, and gives its value."""
    kind = ParameterDescriptor(
        type=ParameterType.PARAMETER_STRING, description=description, read_only=True
    )
    return str(_declared(node, name, default, kind))


def fixed_texts(node: Node, name: str, description: str) -> list[str]:
    """The same for a list of texts, empty by default."""
    kind = ParameterDescriptor(
        type=ParameterType.PARAMETER_STRING_ARRAY, description=description, read_only=True
    )
    value = _declared(node, name, Parameter.Type.STRING_ARRAY, kind)
    return [str(text) for text in value or []]


def fixed_switch(node: Node, name: str, description: str) -> bool:
    """The same for a switch that is off by default."""
    kind = ParameterDescriptor(
        type=ParameterType.PARAMETER_BOOL, description=description, read_only=True
    )
    return bool(_declared(node, name, False, kind))


def declare_numbers(node: Node, values: Mapping[str, float]) -> dict[str, float]:
    """Declares TUNING and RULES.

    Args:
        node: whose they become.
        values: of the scenario's controller.

    Returns:
        Their values, as the launch set them.

    Raises:
        ConfigError: a value out of its range, with the range.
    """
    wanted = {name: (values[name], number) for name, number in TUNING.items() if name in values}
    found = {}
    for name, (default, number) in {**wanted, **RULES}.items():
        kind = ParameterDescriptor(
            type=ParameterType.PARAMETER_DOUBLE, description=number.description,
            floating_point_range=[
                FloatingPointRange(from_value=number.low, to_value=number.high, step=0.0)
            ],
        )  # fmt: skip
        found[name] = float(_declared(node, name, default, kind))
    return found


def declare_second_goal(node: Node) -> str:
    """Declares what a goal does while another is pursued."""
    kind = ParameterDescriptor(
        type=ParameterType.PARAMETER_STRING,
        description="what a goal does while another is pursued",
        additional_constraints=f"one of {', '.join(SECOND_GOAL)}",
    )
    value = str(_declared(node, "second_goal", SECOND_GOAL[0], kind))
    if value not in SECOND_GOAL:
        raise ConfigError(f"parameter second_goal = {value!r}: one of {', '.join(SECOND_GOAL)}")
    return value


def warn_unknown(node: Node) -> None:
    """A warning for each parameter of the launch that the node has not declared: it does nothing.

    Call it once all are declared.
    """
    known = sorted(node.get_parameters_by_prefix(""))
    for name in getattr(node, "_parameter_overrides", {}):
        if node.has_parameter(name) or name.startswith("qos_overrides."):
            continue
        near = difflib.get_close_matches(name, known, n=3)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}"
        node.get_logger().warning(f"parameter {name}: not known, it changes nothing; {hint}")


def on_change(node: Node, apply: Callable[[dict[str, object]], None]) -> None:
    """Calls `apply` with what is to change; where that raises ConfigError, nothing changes."""

    def check(parameters: list[Parameter]) -> SetParametersResult:
        changed: dict[str, object] = {parameter.name: parameter.value for parameter in parameters}
        second = changed.get("second_goal", SECOND_GOAL[0])
        if second not in SECOND_GOAL:
            reason = f"second_goal = {second!r}: one of {', '.join(SECOND_GOAL)}"
            return SetParametersResult(successful=False, reason=reason)
        try:
            apply(changed)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)
