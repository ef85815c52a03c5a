"""From a xacro to the URDF that it makes."""

import glob
import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from proxcgal.core.errors import ModelError
from proxcgal.models.formats.child import run_limited
from proxcgal.models.formats.paths import MeshFolders

_CHILD = Path(__file__).with_name("xacro_child.py")


@dataclass
class Expanded:
    """A URDF, and what it was made from."""

    root: ET.Element
    files: list[Path]
    #: What else decided: environment variables, and the files that patterns of includes found.
    context: dict[str, Any]


def expand(path: Path, folders: MeshFolders, arguments: Mapping[str, str]) -> Expanded:
    """Expand a xacro, in a process of its own.

    What decides is in the file, those it includes, the arguments, and the environment variables
    that it names; not the working folder. It can read files that it names: only those that one
    trusts are for use.

    Raises:
        ModelError: what is wrong, with the file; which argument is missing, or is none of its own.
    """
    known = {folder.name: folder for folder in folders.package_dirs}
    for folder in folders.package_dirs:
        known |= {inner.name: inner for inner in folder.iterdir() if inner.is_dir()}
    known |= folders.packages
    request = {"path": str(path), "arguments": dict(arguments),
               "packages": {name: str(where) for name, where in known.items()}}  # fmt: skip
    reply, _ = run_limited(_CHILD, request, path)
    try:
        root = ET.fromstring(reply["text"])
    except ET.ParseError as error:
        raise ModelError(f"{path}: xacro makes what is not well-formed XML: {error}") from None
    context = {"environment": reply["environment"], "patterns": reply["patterns"]}
    return Expanded(root, [Path(file) for file in reply["files"]], context)


def still_holds(context: Mapping[str, Any]) -> bool:
    """Whether the environment variables and the files that patterns find are as they were."""
    return all(
        os.environ.get(name) == value for name, value in context.get("environment", {}).items()
    ) and all(
        sorted(glob.glob(pattern)) == files  # noqa: PTH207  as xacro itself does
        for pattern, files in context.get("patterns", {}).items()
    )


def checked_arguments(arguments: object) -> dict[str, str]:
    """Arguments as text, sorted by name.

    Raises:
        ModelError: no mapping of names to text, numbers or truth values.
    """
    if arguments is None:
        return {}
    if not isinstance(arguments, Mapping):
        raise ModelError(f"xacro_args = {arguments!r}; a mapping of names to values is needed")
    found = {}
    for name, value in sorted(arguments.items(), key=lambda item: str(item[0])):
        if not isinstance(name, str) or not isinstance(value, str | int | float | bool):
            raise ModelError(
                f"xacro_args has {name!r}: {value!r}; text, a number, True or False is needed"
            )
        found[name] = str(value).lower() if isinstance(value, bool) else str(value)
    return found
