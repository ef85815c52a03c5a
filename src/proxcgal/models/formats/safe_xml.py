"""XML and its numbers, from files that may be broken or hostile: refused early, never expanded."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.core.typing import Array

MAX_BYTES = 64 * 2**20
MAX_DEPTH = 256  # nested tags; a chain of bodies in an MJCF nests one per joint
MAX_ELEMENTS = 100_000
# Farther from the origin nothing is looked for, and squares would leave single precision [m].
FARTHEST = 1e9
_CHUNK = 2**16
# An axis or quaternion shorter than this has no direction.
_NO_DIRECTION = 1e-9


def parse_xml(path: Path, roots: Collection[str], bare_names: bool = False) -> ET.Element:
    """Read an XML file as a tree.

    Args:
        path: the file.
        roots: what the outermost tag may be; empty for any.
        bare_names: take the prefix of a name space off every tag.

    Raises:
        ModelError: it cannot be read, is not well-formed, declares a document type or an entity,
            or goes past the bounds on size, depth and number of elements.
    """
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate()
    depth = count = 0

    def refuse(what: str) -> NoReturn:
        raise ModelError(f"{path}, line {parser.CurrentLineNumber}: {what}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        if bare_names:
            tag = tag.rpartition(":")[2]
        depth += 1
        count += 1
        if depth > MAX_DEPTH:
            refuse(f"tags nested deeper than {MAX_DEPTH}")
        if count > MAX_ELEMENTS:
            refuse(f"more than {MAX_ELEMENTS} elements")
        if count == 1 and roots and tag not in roots:
            refuse(f"the outermost tag is <{tag}>; expected <{'> or <'.join(sorted(roots))}>")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag.rpartition(":")[2] if bare_names else tag)

    def doctype(*_: object) -> None:
        refuse("a document type declaration, which can define entities; none is allowed")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise ModelError(f"{path}: {size} bytes; at most {MAX_BYTES} are read")
        with path.open("rb") as file:
            while chunk := file.read(_CHUNK):
                parser.Parse(chunk, False)
            parser.Parse(b"", True)
    except expat.ExpatError as error:
        raise ModelError(f"{path}: not well-formed XML: {error}") from None
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    return builder.close()


def parse_number(text: str, what: str, most: float = FARTHEST) -> float:
    """One finite number of at most that size.

    Raises:
        ModelError: it is none.
    """
    return float(parse_numbers(text, 1, what, most)[0])


def parse_numbers(text: str, count: int, what: str, most: float = FARTHEST) -> Array:
    """So many finite numbers, as they stand in an XML attribute, each of at most that size.

    Raises:
        ModelError: they are not.
    """
    try:
        values = np.array([float(token) for token in text.split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        finite = "a finite number is" if count == 1 else f"{count} finite numbers are"
        raise ModelError(f"{what} is '{text[:80]}'; {finite} needed")
    if (np.abs(values) > most).any():
        raise ModelError(f"{what} is '{text[:80]}'; at most {most:g} is taken")
    return values


def is_direction(values: Array) -> bool:
    """Whether an axis or a quaternion says which way."""
    return math.hypot(*values) > _NO_DIRECTION
