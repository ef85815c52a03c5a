"""The layout shows which way a value goes, and code may only depend that way."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "proxcgal"

PYTHON_LAYERS = ("base", "models", "sim", "study", "apps")
PYTHON_LAYER_OF = {"_core": "base", "errors": "base", "closing": "base"} | {
    name: name for name in PYTHON_LAYERS[1:]
}
# World casts rays and draws; physics steps an arm with weight and brakes.
ONLY_IN = {"mujoco": [("sim", "world"), ("sim", "physics")], "viser": [("apps", "view")]}


def python_module(file: Path) -> tuple[str, ...]:
    """The parts of a module's name below the package; () for the package itself."""
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def imports(file: Path) -> Iterator[tuple[str, ...]]:
    """Every module that a file imports, absolute, as the parts of its name."""
    here = ("proxcgal", *file.relative_to(PACKAGE).with_suffix("").parts)
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = here[: len(here) - node.level] if node.level else ()
            base = (*start, *(node.module.split(".") if node.module else ()))
            if base == ("proxcgal",):
                yield from ((*base, alias.name) for alias in node.names)
            else:
                yield base


def python_layer(module: tuple[str, ...]) -> int | None:
    """The layer of a module below the package; None for the package itself, which shows them."""
    return PYTHON_LAYERS.index(PYTHON_LAYER_OF[module[0]]) if module else None


def python_files() -> list[Path]:
    found = sorted(PACKAGE.rglob("*.py"))
    assert found
    return found


def test_python_imports_point_one_way() -> None:
    wrong = []
    for file in python_files():
        layer = python_layer(python_module(file))
        for module in imports(file):
            if layer is None or module[0] != "proxcgal" or module[1:2] not in LAYERED:
                continue
            other = python_layer(module[1:])
            if other is not None and other > layer:
                wrong.append(f"{file.relative_to(PACKAGE)} imports {'.'.join(module)}")
    assert wrong == []


LAYERED = {(name,) for name in PYTHON_LAYER_OF}


def test_models_do_not_import_the_package_that_shows_them() -> None:
    wrong = [
        f"{file.relative_to(PACKAGE)} imports {'.'.join(module)}"
        for file in python_files()
        if python_layer(python_module(file)) in (0, 1)
        for module in imports(file)
        if module[0] == "proxcgal" and module[1:2] not in LAYERED
    ]
    assert wrong == []


@pytest.mark.parametrize("library", ONLY_IN)
def test_library_is_imported_in_one_place(library: str) -> None:
    places = ONLY_IN[library]
    wrong = [
        str(file.relative_to(PACKAGE))
        for file in python_files()
        if not any(python_module(file)[: len(place)] == place for place in places)
        for module in imports(file)
        if module[0] == library
    ]
    assert wrong == []
