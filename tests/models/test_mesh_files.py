"""Mesh files: what is wrong with one is told with the file and the face."""

import struct
from pathlib import Path

import numpy as np
import pytest

import proxcgal as px
from proxcgal.models.mesh.files import MAX_FACES, clean_mesh, load_mesh
from proxcgal.models.mesh.shapes import box, capsule, cylinder, ellipsoid

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def robot_with(mesh: Path) -> str:
    return f"""<robot name="r"><link name="a"/><link name="b"><visual><geometry>
        <mesh filename="{mesh.name}"/></geometry></visual></link>
        <joint name="j" type="continuous"><parent link="a"/><child link="b"/>
        <limit velocity="1" effort="1"/></joint></robot>"""


def stl_header(faces: int) -> bytes:
    return b"\0" * 80 + struct.pack("<I", faces)


BAD = {
    "nan.obj": (b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is .*nan.*used by face 0"),
    "infinite.off": (b"OFF\n3 1 0\n0 0 inf\n1 0 0\n0 1 0\n3 0 1 2\n", "vertex 0 is"),
    "empty.obj": (b"", "no triangles"),
    "points.obj": (TRIANGLE.encode(), "no triangles"),
    "beyond.obj": (TRIANGLE.encode() + b"f 1 2 3\nf 1 2 9\n", "face 1 has vertex 8; there are 3"),
    "zero.obj": (TRIANGLE.encode() + b"f 1 2 0\n", "line 4: face 0 has vertex 0"),
    "behind.obj": (TRIANGLE.encode() + b"f 1 2 -9\n", "line 4: face 0 has vertex -9"),
    "words.obj": (TRIANGLE.encode() + b"f a b c\n", "line 4: not a face"),
    "two.obj": (TRIANGLE.encode() + b"f 1 2\n", "2 corners; 3 are needed"),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of its 1 faces has an area"),
    "noise.stl": (b"\x93\x01no mesh at all" * 20, "faces; at most|cut off"),
    "cut.stl": (stl_header(10) + b"\0" * 70, "cut off: 10 faces take 584 bytes, 154 are there"),
    "huge.stl": (stl_header(10_000_000), f"10000000 faces; at most {MAX_FACES}"),
    "noise.dae": (b"<html/>", "outermost tag is <html>"),
    "entity.dae": (b'<!DOCTYPE x [<!ENTITY a "b">]><COLLADA/>', "document type"),
    "indices.ply": (
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        b"0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
        "face 0 has vertex 7; there are 3",
    ),
    "text.txt": (b"", "not a mesh file"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mesh_is_refused_with_its_file(tmp_path: Path, name: str) -> None:
    content, said = BAD[name]
    mesh = tmp_path / name
    mesh.write_bytes(content)
    path = tmp_path / "r.urdf"
    path.write_text(robot_with(mesh))
    with pytest.raises(px.GeometryError, match=said) as caught:
        px.load_robot(path)
    assert name in str(caught.value)


def test_faces_without_area_are_left_out_and_counted(tmp_path: Path) -> None:
    mesh = tmp_path / "some.obj"
    mesh.write_text(TRIANGLE + "v 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\nf 2 4 3\n")
    (tmp_path / "r.urdf").write_text(robot_with(mesh))
    robot = px.load_robot(tmp_path / "r.urdf", vertices_per_link=None)
    assert robot.description.links[0].dropped_faces == 2
    assert len(robot.full_mesh("b")[1]) == 2


def test_polygons_and_backward_indices_of_an_obj_are_understood(tmp_path: Path) -> None:
    mesh = tmp_path / "quad.obj"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nf 1/1/1 2//2 3 4\nf -4 -3 -2\n"
    )
    vertices, triangles = load_mesh(mesh)
    assert vertices.shape == (4, 3)
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]


def test_every_mesh_format_gives_the_same_surface(tmp_path: Path) -> None:
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    for suffix in ("stl", "obj", "ply", "off", "dae"):
        path = tmp_path / f"sphere.{suffix}"
        sphere.export(path)
        vertices, triangles, dropped = clean_mesh(*load_mesh(path), suffix)
        assert (len(vertices), len(triangles), dropped) == (162, 320, 0), suffix
        np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 0.3, atol=1e-6)


def test_the_length_unit_of_a_collada_file_is_applied(tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / "box.dae"
    trimesh.creation.box((1, 1, 1)).export(path)
    text = path.read_text()
    if "<unit" in text:
        import re

        text = re.sub(r"<unit[^>]*>", '<unit name="inch" meter="0.0254"/>', text)
    else:
        text = text.replace("</asset>", '<unit name="inch" meter="0.0254"/></asset>', 1)
    path.write_text(text)
    np.testing.assert_allclose(np.ptp(load_mesh(path)[0], axis=0), 0.0254)


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (box(np.array([1.0, 2.0, 3.0])), 6.0),
        (cylinder(0.5, 2.0), np.pi / 2),
        (ellipsoid(np.array([0.3, 0.4, 0.5])), 4 / 3 * np.pi * 0.06),
        (capsule(0.2, 0.5), np.pi * 0.04 * 0.5 + 4 / 3 * np.pi * 0.008),
    ],
)
def test_simple_shapes_are_closed_and_have_their_volume(
    mesh: tuple[np.ndarray, np.ndarray], volume: float
) -> None:
    vertices, triangles = mesh
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=0.01)
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    forth, back = ({tuple(side) for side in s.tolist()} for s in (sides, sides[:, ::-1]))
    assert forth == back
    assert len(forth) == len(sides)
