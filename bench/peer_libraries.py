"""What a user would take instead, each used as well as its Python interface allows.

Trees and scenes are built beforehand, one a link, in the link's frame: the cloud is brought to the
link. Arrays go in batches, of the type and order that the library wants, where it has a call for
batches. All of this runs on one thread (`peers.py` sees to that).
"""

from __future__ import annotations

import coal
import fcpw
import igl
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from proxcgal.models.robots import Robot
from proxcgal.study.timing.inputs import Inputs

Array = NDArray[np.float64]

SINGLE_M, DOUBLE_M = 1e-5, 1e-9  # [m] what distances may be off: computed in float32, in float64
MIN_HIT = 0.005  # [m] default of px.remove_body
FAR = 3e38  # no bound


class Open3D:
    """RaycastingScene, which is Embree. Its rays have no upper bound, its distances neither."""

    name, package, error = "Open3D (Embree)", "open3d", SINGLE_M

    def __init__(self, robot: Robot) -> None:
        self._scenes = []
        for link in robot.link_names:
            vertices_L, triangles = robot.mesh(link)
            scene = o3d.t.geometry.RaycastingScene(nthreads=1)
            scene.add_triangles(
                o3d.core.Tensor(np.ascontiguousarray(vertices_L, np.float32)),
                o3d.core.Tensor(np.ascontiguousarray(triangles, np.uint32)),
            )
            self._scenes.append(scene)

    def first_hits(self, link: int, starts_L: Array, directions_L: Array, far: Array) -> Array:
        rays = np.empty((len(far), 6), np.float32)
        rays[:, :3], rays[:, 3:] = starts_L, directions_L
        tensor = o3d.core.Tensor.from_numpy(rays)
        return self._scenes[link].cast_rays(tensor, nthreads=1)["t_hit"].numpy()

    def nearest(self, link: int, points_L: Array, bound: float) -> float:
        tensor = o3d.core.Tensor.from_numpy(points_L.astype(np.float32))
        return float(self._scenes[link].compute_distance(tensor, nthreads=1).numpy().min())


class Fcpw:
    """Bounded rays, and closest points with the least distance so far as radius.

    The radius has to fall from point to point, so these are asked one by one: in batches, where it
    falls from link to link only, the same takes longer.
    """

    name, package, error = "FCPW", "fcpw", SINGLE_M

    def __init__(self, robot: Robot) -> None:
        self._scenes = []
        for link in robot.link_names:
            vertices_L, triangles = robot.mesh(link)
            scene = fcpw.scene_3D()
            scene.set_object_count(1)
            scene.set_object_vertices(np.asfortranarray(vertices_L, np.float32), 0)
            scene.set_object_triangles(np.asfortranarray(triangles, np.int32), 0)
            scene.build(fcpw.aggregate_type.bvh_surface_area, True)
            self._scenes.append(scene)

    def first_hits(self, link: int, starts_L: Array, directions_L: Array, far: Array) -> Array:
        found = fcpw.interaction_3D_list()
        self._scenes[link].intersect(
            np.asfortranarray(starts_L, np.float32), np.asfortranarray(directions_L, np.float32),
            far.astype(np.float32), found,
        )  # fmt: skip
        return np.array([hit.d for hit in found])

    def nearest(self, link: int, points_L: Array, bound: float) -> float:
        find, found = self._scenes[link].find_closest_point, fcpw.interaction_3D()
        for point_L in points_L.astype(np.float32):
            if find(point_L, found, min(bound * bound, FAR)):
                bound = min(bound, found.d)
        return bound


class Libigl:
    """Its AABB tree, in double precision; distances have no bound."""

    name, package, error = "libigl", "libigl", DOUBLE_M

    def __init__(self, robot: Robot) -> None:
        self._trees = []
        for link in robot.link_names:
            vertices_L, triangles = robot.mesh(link)
            mesh = np.asfortranarray(vertices_L), np.asfortranarray(triangles, np.int64)
            tree = igl.AABB()
            tree.init(*mesh)
            self._trees.append((tree, *mesh))

    def first_hits(self, link: int, starts_L: Array, directions_L: Array, far: Array) -> Array:
        tree, vertices_L, triangles = self._trees[link]
        return tree.intersect_ray_first(vertices_L, triangles, starts_L, directions_L)[1]

    def nearest(self, link: int, points_L: Array, bound: float) -> float:
        tree, vertices_L, triangles = self._trees[link]
        squared, _, _ = tree.squared_distance(vertices_L, triangles, points_L)
        return float(np.sqrt(squared.min()))


class Coal:
    """Distance of two bounding volume hierarchies, walked together; no rays.

    The cloud is a mesh of triangles that are points, indexed anew for every scan; one result for
    all links carries the least distance from one to the next.
    """

    name, package, error = "coal", "coal", DOUBLE_M

    def __init__(self, robot: Robot) -> None:
        self._links = [_hierarchy(*robot.mesh(link)) for link in robot.link_names]

    def closest(self, inputs: Inputs) -> float:
        points_W = inputs.environment_W
        rows = np.repeat(np.arange(len(points_W), dtype=np.int64), 3).reshape(-1, 3)
        cloud, world = _hierarchy(points_W, rows), coal.Transform3s()
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        for link, T_WL in zip(self._links, inputs.robot.link_poses(inputs.q), strict=True):
            pose = coal.Transform3s(T_WL[:3, :3], T_WL[:3, 3])
            coal.distance(link, pose, cloud, world, request, result)
        return float(result.min_distance)


def _hierarchy(vertices: Array, triangles: NDArray[np.integer]) -> coal.BVHModelOBBRSS:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    model.addVertices(np.ascontiguousarray(vertices))
    model.addTriangles(np.ascontiguousarray(triangles, np.int64))
    model.endModel()
    return model
