"""Compiles an MJCF with MuJoCo and writes down what came out. Runs as a script of its own.

`formats.child.run_limited` starts it: MuJoCo's parser and compiler see the file in a process with
limits. It imports nothing of this package, whose core would double the time it takes to start.

A mesh file is not read here: a small box stands for it while MuJoCo compiles, and the geom's pose
is brought back from the box's inertial frame to the mesh's own. The vertices are then those of the
file, in double precision. Where a primitive is fitted to a mesh, or the mesh is given inline,
MuJoCo has the real one.
"""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

_Reply = dict[str, Any]
_Arrays = dict[str, np.ndarray]

_GEOM = mujoco.mjtGeom
_BOX = np.array([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]) * 0.01
_BOX_FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip
_EQUALITY = {int(kind): kind.name.removeprefix("mjEQ_").lower() for kind in
             (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT,
              mujoco.mjtEq.mjEQ_TENDON)}  # fmt: skip
_KEPT = (
    "body_parentid", "body_pos", "body_quat", "body_mocapid", "jnt_type", "jnt_bodyid",
    "jnt_pos", "jnt_axis", "jnt_limited", "jnt_range", "jnt_qposadr", "qpos0", "geom_type",
    "geom_bodyid", "geom_dataid", "geom_pos", "geom_quat", "geom_size", "geom_contype",
    "geom_conaffinity", "geom_group", "site_bodyid", "site_pos", "site_quat", "mesh_pos",
    "mesh_quat", "mesh_vertadr", "mesh_vertnum", "mesh_faceadr", "mesh_facenum", "mesh_vert",
    "mesh_face", "tendon_adr", "tendon_num", "tendon_limited", "wrap_type", "wrap_objid",
)  # fmt: skip
# Meshes that only MuJoCo reads.
_OWN_FORMATS = (".msh",)


class RefusedError(Exception):
    """What is not read, in words."""


def main() -> None:
    """Reads request.json, writes reply.json and reply.npz."""
    request = json.loads(Path("request.json").read_text())
    try:
        reply, arrays = compiled(request["path"], request["meshes"])
        if arrays:
            np.savez("reply.npz", **arrays)  # type: ignore[arg-type]
    except RefusedError as error:
        reply = {"error": str(error)}
    except MemoryError:
        reply = {"error": "reading it takes too much memory"}
    except (ValueError, RuntimeError, KeyError) as error:  # MuJoCo's own words
        said = " ".join(str(error).split())
        reply = {"error": f"MuJoCo: {said[:500]}"}
    Path("reply.json").write_text(json.dumps(reply))


def compiled(path: str, files: dict[str, str] | None) -> tuple[_Reply, _Arrays]:
    """The compiled model as plain data; or, where real meshes are needed and `files` is None, them.

    `files` gives the path of each mesh file, by the mesh's name.
    """
    spec = mujoco.MjSpec.from_file(path)
    _check(spec)
    _strip(spec)
    meshes = {mesh.name: mesh for mesh in spec.meshes if mesh.file}
    told = {name: _told(mesh, spec) for name, mesh in meshes.items()}
    fitted = {g.meshname for g in spec.geoms if g.meshname and g.type != _GEOM.mjGEOM_MESH}
    fitted |= {name for name in meshes if Path(meshes[name].file).suffix.lower() in _OWN_FORMATS}
    fitted &= set(meshes)
    if files is None and fitted:
        return {"meshes": told, "needs": sorted(fitted)}, {}
    for name, mesh in meshes.items():
        if name in fitted:
            mesh.file = (files or {})[name]
        else:
            _replace(mesh)
    for of in {id(m.compiler): m.compiler for m in meshes.values()}.values():
        of.meshdir = ""
    spec.strippath = False
    spec.meshdir = ""
    # Every body stays one, with its name.
    spec.compiler.fusestatic = 0
    model = spec.compile()
    reply = {"meshes": told, "stubs": sorted(set(meshes) - fitted), "name": spec.modelname}
    return reply | _names(model), _arrays(model)


def _told(mesh: "mujoco.MjsMesh", spec: "mujoco.MjSpec") -> _Reply:
    folder = mesh.compiler.meshdir or spec.meshdir or ""
    file = mesh.file
    if spec.strippath:
        file = file.replace("\\", "/").rpartition("/")[2]
    return {"file": file, "folder": folder, "scale": list(map(float, mesh.scale)),
            "refpos": list(map(float, mesh.refpos)),
            "refquat": list(map(float, mesh.refquat))}  # fmt: skip


def _check(spec: "mujoco.MjSpec") -> None:
    """Refuse what binds a joint to something else, by name."""
    for bond in spec.equalities:
        kind = _EQUALITY.get(int(bond.type), "flex")
        name = f" '{bond.name}'" if bond.name else ""
        if kind == "joint":
            to = f"'{bond.name2}'" if bond.name2 else "a constant"
            what = f"joint '{bond.name1}' is bound to {to} (equality{name})"
        else:
            what = (
                f"'{bond.name1}' is bound to '{bond.name2 or 'the world'}' ({kind} equality{name})"
            )
        raise RefusedError(
            f"{what}; joints that follow others are not read: take a model without that part and "
            "put it on with attach_mesh"
        )
    for flex in spec.flexes:
        raise RefusedError(f"flex '{flex.name}' bends; rigid bodies are read")
    for geom in spec.geoms:
        what = f"geom '{geom.name}' of body '{geom.parent.name}'"
        if geom.type == _GEOM.mjGEOM_SDF:
            raise RefusedError(f"{what} is an sdf; primitives and meshes are read")
        if geom.type == _GEOM.mjGEOM_HFIELD and geom.parent.name != "world":
            raise RefusedError(f"{what} is a height field; primitives and meshes are read")


def _strip(spec: "mujoco.MjSpec") -> None:
    """Take off what has no part in the robot's shape and motion, and would read other files."""
    for geom in list(spec.geoms):
        if geom.type == _GEOM.mjGEOM_HFIELD:
            spec.delete(geom)
        else:
            geom.material = ""
    for part in [*spec.sites, *spec.tendons, *spec.meshes]:
        part.material = ""
    for group in (spec.skins, spec.hfields, spec.materials, spec.textures, spec.keys):
        for item in list(group):
            spec.delete(item)


def _replace(mesh: "mujoco.MjsMesh") -> None:
    mesh.file = ""
    mesh.content_type = ""
    mesh.scale = [1, 1, 1]
    mesh.refpos = [0, 0, 0]
    mesh.refquat = [1, 0, 0, 0]
    mesh.uservert = _BOX.reshape(-1)
    mesh.userface = _BOX_FACES.reshape(-1)


def _names(model: "mujoco.MjModel") -> _Reply:
    def names(kind: int, count: int) -> list[str]:
        return [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]

    objects = mujoco.mjtObj
    return {
        "bodies": names(objects.mjOBJ_BODY, model.nbody),
        "joints": names(objects.mjOBJ_JOINT, model.njnt),
        "geoms": names(objects.mjOBJ_GEOM, model.ngeom),
        "sites": names(objects.mjOBJ_SITE, model.nsite),
        "mesh_names": names(objects.mjOBJ_MESH, model.nmesh),
        "tendons": names(objects.mjOBJ_TENDON, model.ntendon),
    }


def _arrays(model: "mujoco.MjModel") -> dict[str, np.ndarray]:
    return {name: np.asarray(getattr(model, name)) for name in _KEPT}


if __name__ == "__main__":
    main()
