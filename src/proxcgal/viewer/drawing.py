"""Draws a scene model and its moments with viser, for the live page, a replay and a report."""

from collections.abc import Collection
from typing import Any

import numpy as np
import trimesh
import viser
import viser.transforms
from numpy.typing import NDArray

from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array
from proxcgal.scene.solids import Box, CapsuleSolid, Cylinder, Solid, Sphere
from proxcgal.sim.moment import Posed
from proxcgal.viewer.scene_model import SceneModel

Color = tuple[int, int, int]

LINKS: tuple[Color, Color] = ((206, 210, 216), (112, 152, 190))
GHOST: Color = (238, 150, 60)
KEPT: Color = (214, 30, 40)
REMOVED: Color = (66, 120, 240)
PAIR: Color = (16, 150, 60)
GHOST_PAIR: Color = (220, 120, 20)
SOLID: Color = (250, 186, 92)
UNSENSED: Color = (176, 182, 190)
SENSOR: Color = (250, 204, 40)
SILENT: Color = (120, 120, 120)
_VIEW: Color = (214, 176, 60)
_WALL = 1.0  # [m] half an edge from which a solid is a wall, which hides nothing
_FRUSTUM = 0.10  # [m] of a field of view that is drawn, along its axis
_SHAFT: dict[str, Any] = {"shaft_radius": 0.008, "head_radius": 0.02, "head_length": 0.05}
_NOTHING = np.zeros((1, 3), np.float32)  # clouds and arrows are never empty: they are hidden


class Drawing:
    """The nodes of one arm in its scene."""

    def __init__(
        self, scene: viser.SceneApi, model: SceneModel, *, name: str = "", ghost: bool = False
    ) -> None:
        """Adds them, where they are at the start.

        Args:
            scene: of the server.
            model: what to draw.
            name: before every node's, for a second arm.
            ghost: another arm in the same scene: see-through, without sensors, clouds and solids.
        """
        self._scene = scene
        self.model = model
        self._ghost = ghost
        self._name = name
        self._links = [self._link(row, link) for row, link in enumerate(model.links)]
        self._views: list[tuple[list[int], Any, Any]] = []
        self._solids: list[Any] = []
        if not ghost:
            self._views = self._sensors()
            self._solids = [
                _solid(
                    scene,
                    f"{name}/scene/{row}_{label}",
                    solid,
                    SOLID if label in model.sensed else UNSENSED,
                )
                for row, (label, solid) in enumerate(zip(model.names, model.solids, strict=True))
            ]
            self._place(self._solids, model.solids_W)
            self._kept = self._cloud("kept", KEPT, 0.009)
            self._held = self._cloud("held", SILENT, 0.009)
            self._removed = self._cloud("removed", REMOVED, 0.006)
            self._goal = scene.add_frame(
                f"{name}/goal", axes_length=0.12, axes_radius=0.005, visible=False
            )
        self._arrow = scene.add_arrows(
            f"{name}/pair", np.zeros((1, 2, 3)), GHOST_PAIR if ghost else PAIR, visible=False,
            **_SHAFT,
        )  # fmt: skip

    def show(self, moment: Posed) -> None:
        """Moves everything to where it is at that moment."""
        self._place(self._links, moment.links_W)
        pair = moment.control_W, moment.obstacle_W
        there = pair[0] is not None and pair[1] is not None
        _shown(self._arrow, there)
        if there:
            self._arrow.points = np.array([pair], np.float32)
        if self._ghost:
            return
        self._place(self._solids, moment.solids_W)
        self._points(self._kept, moment.kept_W)
        self._points(self._held, moment.held_W)
        self._points(self._removed, moment.removed_W)
        _shown(self._goal, moment.goal_W is not None)
        if moment.goal_W is not None:
            self._put(self._goal, moment.goal_W)

    def silence(self, off: Collection[int]) -> None:
        """Greys out the sensors of these rows, and no others."""
        for rows, frusta, dots in self._views:
            silent = np.array([row in off for row in rows])
            frusta.colors = np.repeat(
                np.where(silent[:, None], SILENT, _VIEW), 8, axis=0
            )[:, None, :].repeat(2, axis=1).astype(np.uint8)  # fmt: skip
            dots.colors = np.where(silent[:, None], SILENT, SENSOR).astype(np.uint8)

    def views_visible(self, visible: bool) -> None:
        """Shows or hides the fields of view."""
        for _, frusta, _ in self._views:
            _shown(frusta, visible)

    def clouds_visible(self, kept: bool, removed: bool) -> None:
        """Shows or hides either cloud from the next moment on."""
        self._kept_on, self._removed_on = kept, removed

    def remove(self) -> None:
        """Takes every node away."""
        own = () if self._ghost else (self._kept, self._held, self._removed, self._goal)
        for handle in (*self._links, *self._solids, self._arrow, *own):
            handle.remove()

    def _link(self, row: int, link: str) -> Any:
        vertices_L, triangles = self.model.meshes[row]
        return self._scene.add_mesh_simple(
            f"{self._name}/arm/{row}_{link}", vertices_L, triangles,
            color=GHOST if self._ghost else LINKS[row % 2],
            opacity=0.3 if self._ghost else None,
            flat_shading=True, side="double", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _sensors(self) -> list[tuple[list[int], Any, Any]]:
        """Below each link that carries some: their places, and the edges of their views."""
        made = []
        side = _FRUSTUM * np.tan(0.5 * self.model.field_of_view)
        corners = ((-side, -side), (side, -side), (side, side), (-side, side))
        ends_S = np.array([[x, y, _FRUSTUM] for x, y in corners])
        for link in sorted(set(self.model.sensor_links)):
            rows = [row for row, on in enumerate(self.model.sensor_links) if on == link]
            edges = []
            for row in rows:
                T_LS = self.model.sensors_L[row]
                ends_L = placed(T_LS, ends_S)
                edges += [[T_LS[:3, 3], end] for end in ends_L]
                edges += [[ends_L[k], ends_L[(k + 1) % 4]] for k in range(4)]
            place = f"{self._name}/arm/{link}_{self.model.links[link]}"
            frusta = self._scene.add_line_segments(
                f"{place}/views", np.array(edges), _VIEW, thickness=1.0, thickness_units="screen"
            )
            dots = self._scene.add_point_cloud(
                f"{place}/sensors", self.model.sensors_L[rows, :3, 3],
                np.array([SENSOR] * len(rows)),
                point_size=0.014, point_shape="circle", point_shading="flat", precision="float32",
            )  # fmt: skip
            made.append((rows, frusta, dots))
        return made

    _kept_on, _removed_on = True, True

    def _cloud(self, label: str, color: Color, size: float) -> Any:
        return self._scene.add_point_cloud(
            f"{self._name}/cloud/{label}", _NOTHING, color, point_size=size, point_shape="circle",
            point_shading="flat", visible=False,
        )  # fmt: skip

    def _points(self, cloud: Any, points_W: NDArray[np.float32]) -> None:
        on = self._removed_on if cloud is self._removed else self._kept_on
        _shown(cloud, on and len(points_W) > 0)
        if on and len(points_W):
            cloud.points = points_W.astype(np.float16)

    def _place(self, handles: list[Any], poses_W: Array) -> None:
        for handle, pose in zip(handles, poses_W, strict=True):
            self._put(handle, pose)

    @staticmethod
    def _put(handle: Any, T_WO: Array) -> None:
        wxyz, position = pose_parts(T_WO)
        if not np.array_equal(handle.position, position):
            handle.position = position
        if not np.array_equal(handle.wxyz, wxyz):
            handle.wxyz = wxyz


def pose_parts(T_WO: Array) -> tuple[Array, Array]:
    """Quaternion (4,), w first, and position (3,) of a pose (4, 4)."""
    rotation = viser.transforms.SO3.from_matrix(T_WO[:3, :3])
    return np.asarray(rotation.wxyz, np.float64), T_WO[:3, 3].copy()


def add_surroundings(server: viser.ViserServer, model: SceneModel) -> None:
    """Light, floor and initial camera, cheap enough for a renderer in software."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_environment_map(hdri=None)  # no texture
    scene.configure_default_lights(enabled=False, cast_shadow=False)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(150, 150, 155), intensity=2.2
    )
    scene.add_light_directional(
        "/light/sun", color=(255, 255, 255), intensity=1.6, position=(1.5, -2.0, 4.0),
        cast_shadow=False,
    )  # fmt: skip
    # At the height of the lowest solid that stands below the arm's base; else of that base, 0.
    lowest = (
        float(T_WO[2, 3] - np.abs(T_WO[2, :3]) @ solid.extent)
        for T_WO, solid in zip(model.solids_W, model.solids, strict=True)
    )
    scene.add_grid(
        "/floor", width=4.0, height=4.0, plane="xy", cell_size=0.25, section_size=1.0,
        cell_color=(226, 229, 233), section_color=(190, 196, 204),
        position=(0.0, 0.0, min(0.0, *lowest, 0.0)),
    )  # fmt: skip
    position, target = initial_viewpoint(model)
    server.initial_camera.position = tuple(position)
    server.initial_camera.look_at = tuple(target)
    server.initial_camera.up = (0.0, 0.0, 1.0)
    server.initial_camera.fov = 0.75


def initial_viewpoint(model: SceneModel) -> tuple[Array, Array]:
    """Camera position and target, (3,) each [m]: from beside the arm and its nearest solid."""
    centers = [T_WO[:3, 3] for T_WO in model.solids_W]
    near = min(centers, key=lambda c: float(np.linalg.norm(c - model.tool_W)), default=model.tool_W)
    target = 0.4 * model.tool_W + 0.3 * near + np.array([0.0, 0.0, 0.1])
    reach = float(np.linalg.norm(model.tool_W)) + 0.5
    across = np.arctan2(near[1], near[0]) - 2.0  # a little from behind: solids hide nothing
    away = np.array([np.cos(across), np.sin(across), 0.5])
    return target + (0.9 + 1.2 * reach) * away / np.linalg.norm(away), target


def _solid(scene: viser.SceneApi, name: str, solid: Solid, color: Color) -> Any:
    plain: dict[str, Any] = {
        "color": color,
        "opacity": 0.45 if solid.extent.max() < _WALL else 0.06,
        "cast_shadow": False,
        "receive_shadow": False,
    }
    if isinstance(solid, Box):
        return scene.add_box(name, dimensions=tuple(solid.size), **plain)  # type: ignore[arg-type]
    if isinstance(solid, Cylinder):
        return scene.add_cylinder(name, radius=solid.radius, height=solid.height, **plain)
    if isinstance(solid, Sphere):
        return scene.add_icosphere(name, radius=solid.radius, **plain)
    assert isinstance(solid, CapsuleSolid)
    shape = trimesh.creation.capsule(height=solid.length, radius=solid.radius, count=(16, 16))
    shape.apply_translation(-shape.bounds.mean(axis=0))
    return scene.add_mesh_simple(name, np.asarray(shape.vertices), np.asarray(shape.faces), **plain)


def _shown(handle: Any, visible: bool) -> None:
    if handle.visible != visible:
        handle.visible = visible
