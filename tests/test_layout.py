"""The layout shows which way a value goes, and code may only depend that way."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CPP = ROOT / "cpp"
PACKAGE = ROOT / "src" / "proxcgal"

# Each layer may use itself and what stands before it.
CPP_LAYERS = ("base", "geometry", "robot", "stages", "controller", "bindings")
CPP_LAYER_OF = {
    "types": "base",
    "error": "base",
    "box": "base",
    "voxel_index": "base",
    "require": "base",
    "stopwatch": "base",
    "frames": "base",
    "velocities": "base",
    "geometry": "geometry",
    "robot": "robot",
    "pipeline": "stages",
    "safety": "stages",
    "task_config": "stages",
    "sight_lines": "stages",
    "joint_history": "controller",
    "freshness": "controller",
    "perception": "controller",
    "caution": "controller",
    "internal_clock": "controller",
    "tick_history": "controller",
    "control_points": "controller",
    "own_pairs": "controller",
    "task_stack": "controller",
    "execution": "controller",
    "controller": "controller",
    "controller_config": "controller",
    "admittance": "controller",
    "hand_guide": "controller",
    "python": "bindings",
}
# What stages take from one another: each entry is one type too many outside of `types`.
SHARED_STAGES = {
    ("pipeline/distance", "pipeline/filter"),  # Method
}

PYTHON_LAYERS = ("base", "models", "sim", "study", "apps")
PYTHON_LAYER_OF = {"_core": "base", "errors": "base", "closing": "base"} | {
    name: name for name in PYTHON_LAYERS[1:]
}
# World casts rays and draws; physics steps an arm with weight and brakes.
ONLY_IN = {"mujoco": [("sim", "world"), ("sim", "physics")], "viser": [("apps", "view")]}


def cpp_files(*folders: str) -> list[Path]:
    found = [file for folder in folders for file in (CPP / folder).rglob("*.[ch]pp")]
    assert found
    return sorted(found)


def includes(file: Path) -> Iterator[str]:
    yield from re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', file.read_text(), re.MULTILINE)


def unit(path: Path) -> str:
    """A header and its source are one unit: its path without root and ending."""
    for root in (CPP / "include" / "proxcgal", CPP / "src", CPP):
        if path.is_relative_to(root):
            return str(path.relative_to(root).with_suffix(""))
    raise AssertionError(path)


def own_includes(file: Path) -> Iterator[str]:
    """The units of this project that a file includes."""
    for name in includes(file):
        for root in (file.parent, CPP / "include", CPP / "src"):
            if (root / name).is_file():
                yield unit((root / name).resolve())
                break


def cpp_layer(name: str) -> int:
    top = name.split("/")[0]
    assert top in CPP_LAYER_OF, f"{name}: give {top!r} a layer in this test"
    return CPP_LAYERS.index(CPP_LAYER_OF[top])


def is_stage(name: str) -> bool:
    return name.startswith("pipeline/")


def stage_includes() -> set[tuple[str, str]]:
    return {
        (unit(file), other)
        for file in cpp_files("include", "src")
        if is_stage(unit(file))
        for other in own_includes(file)
        if is_stage(other) and other != unit(file)
    }


def test_cpp_includes_point_one_way() -> None:
    wrong = [
        f"{file.relative_to(CPP)} includes {other}"
        for file in cpp_files("include", "src", "python")
        for other in own_includes(file)
        if cpp_layer(other) > cpp_layer(unit(file))
    ]
    assert wrong == []


def test_stages_share_nothing_but_what_is_listed() -> None:
    assert stage_includes() - SHARED_STAGES == set()


def test_nothing_is_listed_that_stages_do_not_share() -> None:
    assert SHARED_STAGES - stage_includes() == set()


def test_monitor_knows_no_stage() -> None:
    wrong = [
        f"{file.relative_to(CPP)} includes {other}"
        for file in cpp_files("include", "src")
        if unit(file).startswith("safety/")
        for other in own_includes(file)
        if is_stage(other)
    ]
    assert wrong == []


@pytest.mark.parametrize("library", ["CGAL/", "kdl/", "nanobind/", "Python.h"])
def test_no_public_header_shows_a_library_behind_it(library: str) -> None:
    wrong = [
        f"{file.relative_to(CPP)} includes {name}"
        for file in cpp_files("include")
        for name in includes(file)
        if name.startswith(library)
    ]
    assert wrong == []


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
