"""ROS 2 bags, without ROS 2's own library for them: what both directions share."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from proxcgal.core.errors import ConfigError

MESSAGES = "proxcgal_msgs"
_HEAD = 4  # of a serialized message: byte order


def typestore() -> Typestore:
    """The types of ROS 2 and of proxcgal_msgs. Raises: ConfigError, where those are missing."""
    store = get_typestore(Stores.ROS2_KILTED)
    for path in sorted((_messages() / "msg").glob("*.msg")):
        name = f"{MESSAGES}/msg/{path.stem}"
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))
    return store


def exact(data: bytes, name: str, store: Typestore) -> bytes:
    """A serialized message without what ROS 2 reserved behind it: readers count every byte."""
    return data[: _HEAD + _decoded(data, name, store)[1]]


def decoded(data: bytes | memoryview, name: str, store: Typestore) -> Any:
    """The message in such bytes, whatever stands behind it."""
    return _decoded(data, name, store)[0]


def _decoded(data: bytes | memoryview, name: str, store: Typestore) -> tuple[Any, int]:
    definition = store.get_msgdef(name)
    decode = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
    return decode(data[_HEAD:], 0, definition.cls, store)


def _messages() -> Path:
    """Where proxcgal_msgs is installed: in a sourced ROS 2, or beside this interpreter."""
    places = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for place in places:
        folder = Path(place) / "share" / MESSAGES
        if place and (folder / "msg").is_dir():
            return folder
    raise ConfigError(f"{MESSAGES} is not installed; looked in {', '.join(filter(None, places))}")
