"""C++ rooms: includes point one way, and each room stays small enough to read."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CPP = ROOT / "cpp"

# A room, or a file of the root, may use its own layer and the layers before it.
LAYERS = (
    ("types", "error", "fields"),
    ("geometry", "robot"),
    ("perception", "pipeline", "safety", "guiding"),
    ("control",),
    ("python",),
)
LAYER_OF = {room: layer for layer, rooms in enumerate(LAYERS) for room in rooms}
# Includes between stages: each entry is one type too many outside of `types`.
SHARED_STAGES = {
    ("distance", "filter"),  # Method
}
MOST_FILES = 25  # in one folder


def cpp_files(*folders: str) -> list[Path]:
    found = [file for folder in folders for file in (CPP / folder).rglob("*.[ch]pp")]
    assert found
    return sorted(found)


def includes(file: Path) -> Iterator[str]:
    yield from re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', file.read_text(), re.MULTILINE)


def unit(path: Path) -> str:
    """A header and its source are one unit: its path without root and suffix."""
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


def layer(name: str) -> int:
    room = name.split("/")[0]
    assert room in LAYER_OF, f"{name}: {room!r} is in no layer of this test"
    return LAYER_OF[room]


def stage(name: str) -> str | None:
    """The stage that a unit belongs to; task_config belongs to task."""
    room, _, rest = name.partition("/")
    return rest.split("_")[0] if room == "pipeline" else None


def stage_includes() -> set[tuple[str, str]]:
    return {
        (mine, other)
        for file in cpp_files("include", "src")
        if (mine := stage(unit(file)))
        for name in own_includes(file)
        if (other := stage(name)) and other != mine
    }


def test_includes_point_one_way() -> None:
    wrong = [
        f"{file.relative_to(CPP)} includes {other}"
        for file in cpp_files("include", "src", "python")
        for other in own_includes(file)
        if layer(other) > layer(unit(file))
    ]
    assert wrong == []


def test_rooms_include_one_another_in_no_circle() -> None:
    """Repeatedly removes rooms that include only removed ones; a circle is left over."""
    graph: dict[str, set[str]] = {}
    for file in cpp_files("include", "src", "python"):
        room = unit(file).split("/")[0]
        graph.setdefault(room, set()).update({o.split("/")[0] for o in own_includes(file)} - {room})
    while free := [room for room, others in graph.items() if not others & graph.keys()]:
        for room in free:
            del graph[room]
    assert graph == {}


def test_stages_share_only_listed_types() -> None:
    assert stage_includes() == SHARED_STAGES


@pytest.mark.parametrize("room", ["pipeline", "safety"])
def test_stages_and_safety_know_no_other_room_of_their_layer(room: str) -> None:
    others = set(LAYERS[2]) - {room}
    wrong = [
        f"{file.relative_to(CPP)} includes {other}"
        for file in cpp_files("include", "src")
        if unit(file).startswith(f"{room}/")
        for other in own_includes(file)
        if other.split("/")[0] in others
    ]
    assert wrong == []


@pytest.mark.parametrize("library", ["CGAL/", "kdl/", "nanobind/", "Python.h"])
def test_no_public_header_includes_a_hidden_library(library: str) -> None:
    wrong = [
        f"{file.relative_to(CPP)} includes {name}"
        for file in cpp_files("include")
        for name in includes(file)
        if name.startswith(library)
    ]
    assert wrong == []


def test_each_folder_has_at_most_25_files() -> None:
    folders = [folder for folder in CPP.rglob("*") if folder.is_dir()]
    sizes = {
        str(folder.relative_to(CPP)): sum(file.is_file() for file in folder.iterdir())
        for folder in folders
    }
    assert {name: size for name, size in sizes.items() if size > MOST_FILES} == {}


def test_tests_are_in_the_rooms_of_what_they_test() -> None:
    rooms = {folder.name for folder in (CPP / "tests").iterdir() if folder.is_dir()}
    assert rooms == {room for room in LAYER_OF if (CPP / "src" / room).is_dir()}
