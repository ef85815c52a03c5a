"""The layout shows which way a value goes, and code may only depend that way."""

from pathlib import Path

import pytest
from layout import Layout

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "proxcgal"

ROOMS = (
    "_core", "core", "models", "scene", "scenario", "sim", "evaluation", "recording", "trial",
    "study", "devices", "viewer", "server", "report", "cli",
)  # fmt: skip
MOST_FILES = 25  # of a room
ONLY_IN = {"mujoco": ("sim", "models.mjcf"), "viser": ("viewer",)}


@pytest.fixture(scope="module")
def package() -> Layout:
    return Layout(PACKAGE)


def test_python_imports_point_one_way(package: Layout) -> None:
    assert package.against_order(ROOMS) == []


def test_no_import_goes_in_a_circle(package: Layout) -> None:
    assert package.circle() == []


def test_only_the_command_line_imports_late(package: Layout) -> None:
    assert package.in_functions("cli") == []


def test_no_room_is_crowded(package: Layout) -> None:
    assert package.crowded(MOST_FILES) == []


@pytest.mark.parametrize("library", ONLY_IN)
def test_library_is_imported_in_its_rooms_only(package: Layout, library: str) -> None:
    assert package.outside(library, ONLY_IN[library]) == []


# The checks themselves, on packages made up for them.


def made_up(folder: Path, **files: str) -> Layout:
    """A package `proxcgal` of rooms `core`, `sim` and `cli`; `__` in a name is a folder."""
    root = folder / "proxcgal"
    for name in ("", "core", "sim", "cli"):
        (root / name).mkdir(parents=True)
        (root / name / "__init__.py").write_text("")
    for name, text in files.items():
        (root / f"{name.replace('__', '/')}.py").write_text(text)
    return Layout(root)


def test_what_points_the_right_way_is_found_right(tmp_path: Path) -> None:
    good = made_up(
        tmp_path,
        core__a="from proxcgal import _core\n",
        sim__b="import mujoco\nfrom proxcgal.core.a import x\nfrom proxcgal.core import a\n",
        cli__c="def f():\n    from proxcgal.sim.b import y\n",
    )
    assert good.against_order(ROOMS) == []
    assert good.circle() == []
    assert good.in_functions("cli") == []
    assert good.outside("mujoco", ("sim",)) == []
    assert good.crowded(2) == []


@pytest.mark.parametrize(
    "text",
    [
        "from proxcgal.sim.b import y\n",
        "from proxcgal.sim import b\n",
        "import proxcgal.sim.b\n",
        "from ..sim.b import y\n",
        "def f():\n    from proxcgal.sim.b import y\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from proxcgal.sim.b import y\n",
    ],
)
def test_an_import_of_a_later_room_is_found_wherever_it_stands(tmp_path: Path, text: str) -> None:
    layout = made_up(tmp_path, core__a=text, sim__b="y = 1\n")
    assert layout.against_order(ROOMS) == ["core.a imports sim.b"]


def test_a_room_that_the_order_does_not_name_is_found(tmp_path: Path) -> None:
    layout = made_up(tmp_path, sim__b="from proxcgal.core.a import x\n", core__a="x = 1\n")
    assert layout.against_order(("core",)) == ["sim.b imports core.a"]
    assert layout.against_order(("sim",)) == ["sim.b imports core.a"]


@pytest.mark.parametrize("late", [False, True])
def test_a_circle_is_found_that_a_function_hides(tmp_path: Path, late: bool) -> None:
    back = "from proxcgal.sim import b\n"
    layout = made_up(
        tmp_path,
        sim__b="from proxcgal.sim.c import z\n",
        sim__c=f"def f():\n    {back}" if late else back,
    )
    assert set(layout.circle()) == {"sim.b", "sim.c"}


def test_a_late_import_is_found_outside_of_the_command_line(tmp_path: Path) -> None:
    late = "class A:\n    async def f(self):\n        from proxcgal.core.a import x\n"
    layout = made_up(tmp_path, core__a="x = 1\n", sim__b=late, cli__c=late)
    assert layout.in_functions("cli") == ["sim.b imports core.a"]


@pytest.mark.parametrize("text", ["import mujoco\n", "from mujoco.viewer import launch\n"])
def test_a_library_outside_of_its_room_is_found(tmp_path: Path, text: str) -> None:
    layout = made_up(tmp_path, core__a=text, sim__b=text)
    assert layout.outside("mujoco", ("sim",)) == ["core.a"]


def test_a_crowded_room_is_found(tmp_path: Path) -> None:
    layout = made_up(tmp_path, sim__b="", sim__c="")
    assert layout.crowded(3) == []
    assert layout.crowded(2) == ["sim"]
