"""Messages that a page may send to viser: small, of known kinds, every value checked."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientBounds:
    """Bounds of what a client may send."""

    viewers: int = 16  #: pages at once
    message_bytes: int = 16_384
    messages: float = 240.0  #: a second, of one page; a dragged handle and a turned camera send 100
    burst: float = 480.0  #: messages that may come at once
    longest_text: int = 200  #: characters of a value
    farthest: float = 1000.0  #: of any number in a pose [m]


class ClientMessage(NamedTuple):
    """A message whose form is allowed."""

    kind: str
    fields: dict[str, Any]


def parse_message(raw: object, bounds: ClientBounds) -> ClientMessage | None:
    """The message in these bytes; None where it is none that a page needs."""
    if not isinstance(raw, bytes) or len(raw) > bounds.message_bytes:
        return None
    try:
        content = msgspec.msgpack.decode(raw)
    except (msgspec.DecodeError, RecursionError, ValueError):
        return None
    kind = content.pop("type", None) if isinstance(content, dict) else None
    if not isinstance(kind, str) or (checks := _FIELDS.get(kind)) is None:
        return None
    if not checks.keys() - _MAY_LACK <= content.keys() <= checks.keys():
        return None
    if not all(checks[name](value, bounds) for name, value in content.items()):
        return None
    return ClientMessage(kind, content)


def switch(value: object) -> bool:
    """What a checkbox or a button may be set to."""
    return isinstance(value, bool)


def one_of(options: Collection[str]) -> Callable[[object], bool]:
    """What a list may be set to."""
    return lambda value: isinstance(value, str) and value in options


def between(low: float, high: float) -> Callable[[object], bool]:
    """What a slider may be set to; NaN is not."""
    return lambda value: (
        isinstance(value, int | float) and not isinstance(value, bool)
        and low - 1e-9 <= value <= high + 1e-9
    )  # fmt: skip


def _text(value: object, bounds: ClientBounds) -> bool:
    return isinstance(value, str) and len(value) <= bounds.longest_text


def _number(value: object, bounds: ClientBounds) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and abs(value) <= 1e6
    )


def _vector(length: int) -> Callable[[object, ClientBounds], bool]:
    return lambda value, bounds: (
        isinstance(value, list) and len(value) == length
        and all(_number(each, bounds) and abs(each) <= bounds.farthest for each in value)
    )  # fmt: skip


def _quaternion(value: object, bounds: ClientBounds) -> bool:
    return (
        isinstance(value, list)
        and _vector(4)(value, bounds)
        and 0.9 < float(sum(each * each for each in value)) < 1.1
    )


def _updates(value: object, bounds: ClientBounds) -> bool:
    """A control's value, and nothing else of it."""
    return isinstance(value, dict) and value.keys() == {"value"}


_POSE = {"wxyz": _quaternion, "position": _vector(3)}
_FIELDS: Mapping[str, Mapping[str, Callable[[Any, ClientBounds], bool]]] = {
    "ViewerCameraMessage": {
        **_POSE, "fov": _number, "near": _number, "far": _number, "image_height": _number,
        "image_width": _number, "look_at": _vector(3), "up_direction": _vector(3),
    },
    "GuiUpdateMessage": {"uuid": _text, "updates": _updates},
    "TransformControlsUpdateMessage": {"name": _text, "owner": _text, **_POSE},
    "TransformControlsDragStartMessage": {"name": _text, "owner": _text},
    "TransformControlsDragEndMessage": {"name": _text, "owner": _text},
}  # fmt: skip
_MAY_LACK = {"owner"}
