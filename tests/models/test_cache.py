"""The cache of descriptions and meshes: quick, never stale, never in the way."""

import os
from pathlib import Path

import numpy as np
import pytest

import proxcgal as px
from proxcgal.core import cache
from proxcgal.models.formats import description_reader
from proxcgal.models.mesh import resolution
from proxcgal.models.mesh.resolution import subdivide
from proxcgal.models.mesh.shapes import box

OBJ = "v 0 0 0\nv {x} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


@pytest.fixture
def description(tmp_path: Path) -> Path:
    """A robot of one link, with a mesh file."""
    (tmp_path / "b.obj").write_text(OBJ.format(x=1))
    path = tmp_path / "r.urdf"
    path.write_text(
        '<robot name="r"><link name="a"/><link name="b"><visual><geometry>'
        '<mesh filename="b.obj"/></geometry></visual></link><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><limit lower="-1" upper="1" velocity="1" effort="1"/>'
        "</joint></robot>"
    )
    return path


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    calls: list[str] = []
    real = description_reader.parse_xml

    def parse(*arguments: object) -> object:
        calls.append("parse")
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(description_reader, "parse_xml", parse)
    return calls


def same(one: px.Robot, other: px.Robot) -> bool:
    return one.mesh_hashes == other.mesh_hashes and repr(one.description) == repr(other.description)


def test_a_second_load_reads_nothing_again_and_gives_the_same(
    home: Path, description: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = counted(monkeypatch)
    first, second = px.load_robot(description), px.load_robot(description)
    assert calls == ["parse"]
    assert same(first, second)
    np.testing.assert_array_equal(first.q_max, second.q_max)
    np.testing.assert_array_equal(first.link_poses([0.3]), second.link_poses([0.3]))


def test_a_changed_mesh_file_is_noticed(home: Path, description: Path) -> None:
    px.load_robot(description)
    stamp = (description.parent / "b.obj").stat()
    (description.parent / "b.obj").write_text(OBJ.format(x=2))
    os.utime(description.parent / "b.obj", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert px.load_robot(description).full_mesh("b")[0].max() == 2


def test_a_changed_description_is_noticed(home: Path, description: Path) -> None:
    px.load_robot(description)
    description.write_text(description.read_text().replace('upper="1"', 'upper="2"'))
    assert px.load_robot(description).q_max == [2]


def test_settings_have_entries_of_their_own(home: Path) -> None:
    v, f = subdivide(*box(np.array([0.1, 0.1, 0.2])), 300)
    for count, bound in ((100, np.inf), (200, np.inf), (100, 0.002), (100, 0.002)):
        resolution.control_mesh(v, f, count, bound)
    assert len(list((home / "proxcgal" / "control").iterdir())) == 3


@pytest.mark.parametrize("damage", [b"", b"not a zip", "cut", "flip"])
def test_a_damaged_entry_is_made_again(home: Path, description: Path, damage: bytes | str) -> None:
    first = px.load_robot(description)
    entries = list((home / "proxcgal").rglob("*.npz"))
    assert entries
    for entry in entries:
        whole = entry.read_bytes()
        middle = len(whole) // 2
        if damage == "cut":
            entry.write_bytes(whole[:middle])
        elif damage == "flip":
            entry.write_bytes(whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :])
        else:
            entry.write_bytes(damage)  # type: ignore[arg-type]
    assert same(px.load_robot(description), first)


def test_without_a_writable_folder_it_works_and_keeps_nothing(
    description: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A file where the folder should be: not even root can write there.
    (tmp_path / "taken").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "taken"))
    assert px.load_robot(description).link_names == ["b"]
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(Path, "home", classmethod(lambda cls: (_ for _ in ()).throw(RuntimeError)))
    assert px.load_robot(description).link_names == ["b"]


def test_an_entry_appears_whole_or_not_at_all(
    home: Path, description: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full_disk(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache.np, "savez", full_disk)
    assert px.load_robot(description).link_names == ["b"]
    assert not [p for p in home.rglob("*") if p.is_file()]
