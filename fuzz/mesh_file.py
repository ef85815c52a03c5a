"""Fuzz target: mesh files, from the file to what distances are asked of.

The first byte chooses the format, the rest is the file.
"""

from __future__ import annotations

from bounds import promises
from places import folder

from proxcgal import MeshTree
from proxcgal.models.mesh.files import MESH_SUFFIXES, clean_mesh, load_mesh


def once(data: bytes) -> None:
    """Reads a mesh from these bytes; raises where a promise is broken."""
    if not data:
        return
    path = folder() / f"mesh{MESH_SUFFIXES[data[0] % len(MESH_SUFFIXES)]}"
    path.write_bytes(data[1:])
    with promises():
        vertices, triangles, _ = clean_mesh(*load_mesh(path), str(path))
        MeshTree(vertices, triangles).closest([[0.1, 0.2, 0.3]])
