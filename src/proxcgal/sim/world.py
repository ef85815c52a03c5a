"""The simulated world: rays are cast in it, and MuJoCo draws the pictures.

MuJoCo casts the rays at the scene; at the robot's own links, with their tens of thousands of faces,
our trees cast them four times faster, with the same hits (tested).

Beside `physics` the only module that imports MuJoCo. Nothing is stepped: the arm follows its
velocity commands exactly and the scene its paths, so poses are set, and rays and pictures are taken
at them.
"""

import copy
import ctypes
import os
import sys
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.errors import SimulationError
from proxcgal.core.typing import Array, Bools
from proxcgal.models.robots import Robot, once_per_robot
from proxcgal.models.surfaces import Surfaces
from proxcgal.scene.obstacles import Scene
from proxcgal.scene.solids import Box, CapsuleSolid, Cylinder, Solid, Sphere


def _off_screen_library() -> str:
    """What to draw with where there is no display; "disable" where nothing can."""
    for backend, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return backend
    return "disable"


if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("MUJOCO_GL")):
    os.environ["MUJOCO_GL"] = _off_screen_library()  # read once, by the import

_TOO_LATE = "mujoco" in sys.modules
import mujoco  # noqa: E402

Color = tuple[float, float, float, float]

#: Groups: the scene that MuJoCo casts rays at; the links; the floor, which is in no cloud.
_SCENE, _LINKS, _FLOOR = 0, 1, 2
_CAST_GROUP = np.array([1, 0, 0, 0, 0, 0], np.uint8)
_GEOMS: dict[type[Solid], Any] = {
    Box: mujoco.mjtGeom.mjGEOM_BOX,
    Cylinder: mujoco.mjtGeom.mjGEOM_CYLINDER,
    CapsuleSolid: mujoco.mjtGeom.mjGEOM_CAPSULE,
    Sphere: mujoco.mjtGeom.mjGEOM_SPHERE,
}
_LINK_COLORS = ((0.83, 0.84, 0.86, 1.0), (0.45, 0.62, 0.76, 1.0))
_OBSTACLE_COLOR = (0.98, 0.72, 0.35, 0.4)
_UNSENSED_COLOR = (0.62, 0.64, 0.67, 0.35)


@dataclass(frozen=True, slots=True)
class Spheres:
    """Points to draw."""

    centers_W: Array  #: (n, 3) [m]
    radius: float  #: [m]
    color: Color


@dataclass(frozen=True, slots=True)
class Arrow:
    """An arrow to draw."""

    tail_W: Array  #: (3,) [m]
    tip_W: Array  #: (3,) [m]
    width: float  #: [m]
    color: Color


@dataclass(frozen=True, slots=True)
class Camera:
    """Where a picture is taken from."""

    lookat_W: tuple[float, ...] = (0.35, 0.05, 0.45)  #: (3,) [m]
    distance: float = 2.2  #: [m]
    azimuth: float = 2.2  #: [rad] direction of view about z, 0 along x
    elevation: float = -0.35  #: [rad] negative looks down


@dataclass(frozen=True, slots=True)
class Hits:
    """First surfaces along rays."""

    length: Array  #: (k, n) [m] along the ray, inf where nothing is hit
    robot: Bools  #: (k, n) true where the robot itself is hit


class World:
    """A robot's full-resolution links and a scene's solids, at one moment at a time."""

    def __init__(
        self,
        robot: Robot,
        scene: Scene | None = None,
        floor: float = 0.0,
        sensed: Collection[str] | None = None,
    ) -> None:
        """Builds both.

        Args:
            robot: its `full_mesh` gives what rays meet, its `link_poses` where.
            scene: solids in the base frame; left out: none.
            floor: its height in pictures [m].
            sensed: solids that sensors see, by name; others are grey in pictures. Left out: all.

        Raises:
            SimulationError: MuJoCo refuses a mesh, with the link's name.
        """
        self._robot = robot
        self._scene = scene
        self._links = len(robot.link_names)
        self._trees = Surfaces.of(robot).trees
        solids = () if scene is None else scene.solids
        self._warnings: list[str] = []
        mujoco.set_mju_user_warning(self._warnings.append)
        self._model = copy.copy(_compiled(robot, tuple(type(solid) for solid in solids)))
        self._data = mujoco.MjData(self._model)
        self._model.geom_pos[self._model.geom("floor").id, 2] = floor
        self._shape(solids)
        for row, name in enumerate(() if scene is None else scene.names):
            if sensed is not None and name not in sensed:
                geom = int(self._model.body_geomadr[1 + self._links + row])
                self._model.geom_rgba[geom] = _UNSENSED_COLOR
        self._renderers: dict[tuple[int, int], Any] = {}
        self._place_scene(0.0)
        self.place(np.zeros(robot.n_q))

    def place(self, q: Array, time: float = 0.0) -> None:
        """Puts every link where the robot's kinematics has it, the scene where it is at `time`.

        Raises:
            SimulationError: `q` gives no finite pose, or MuJoCo warned.
        """
        poses_W = np.asarray(self._robot.link_poses(q))
        if not np.isfinite(poses_W).all():
            raise SimulationError(f"the arm has no finite pose at q = {np.asarray(q).tolist()}")
        self._poses_W = poses_W
        self._put(0, poses_W)
        if self._scene is not None and not self._scene.still:
            self._place_scene(time)
        mujoco.mj_kinematics(self._model, self._data)
        self._check()

    def cast(self, origins_W: Array, directions_W: Array, start: float = 0.0) -> Hits:
        """First hit of each ray on any surface of the robot or the scene.

        No link is left out: a sensor sees its own arm. Hits nearer than `start` belong to the
        sensor's own mounting; such a ray goes on behind them.

        Args:
            origins_W: (k, 3) [m], a row for each bundle of rays.
            directions_W: (k, n, 3), unit length.
            start: [m] along the ray.
        """
        directions = np.ascontiguousarray(directions_W, np.float64)
        scene = self._cast_at_scene(np.ascontiguousarray(origins_W, np.float64), directions, start)
        # One origin a ray, behind the mounting.
        begin_W = (origins_W[:, None] + start * directions).reshape(-1, 3)
        own = np.full(len(begin_W), np.inf)
        along_W = directions.reshape(-1, 3)
        for tree, T_WL in zip(self._trees, self._poses_W, strict=True):
            R_WL, p_WL = T_WL[:3, :3], T_WL[:3, 3]
            own = np.minimum(own, tree.first_hit((begin_W - p_WL) @ R_WL, along_W @ R_WL))
        own = start + own.reshape(scene.shape)
        return Hits(np.minimum(own, scene), own < scene)

    def _cast_at_scene(self, origins_W: Array, directions: Array, start: float) -> Array:
        shape = directions.shape[:2]
        if self._scene is None or not self._scene.solids:
            return np.full(shape, np.inf)
        length, geom = np.full(shape, -1.0), np.empty(shape, np.int32)
        for row, origin in enumerate(origins_W):
            mujoco.mj_multiRay(
                self._model, self._data, origin, directions[row].ravel(), _CAST_GROUP, True, -1,
                geom[row], length[row], None, shape[1], mujoco.mjMAXVAL,
            )  # fmt: skip
        found = np.empty(1, np.int32)
        for row, ray in np.argwhere((length >= 0.0) & (length < start)):
            direction = directions[row, ray]
            beyond = mujoco.mj_ray(
                self._model, self._data, origins_W[row] + start * direction, direction,
                _CAST_GROUP, True, -1, found, None,
            )  # fmt: skip
            length[row, ray] = start + beyond if beyond >= 0.0 else -1.0
        self._check()
        length[length < 0.0] = np.inf
        return length

    def picture(
        self,
        marks: Iterable[Spheres | Arrow] = (),
        size: tuple[int, int] = (640, 480),
        camera: Camera | None = None,
    ) -> NDArray[np.uint8]:
        """The scene at its posture, with marks drawn into it.

        Args:
            marks: what MuJoCo knows nothing of: clouds, pairs, frames.
            size: width and height in pixels, at most 1920 x 1080.
            camera: where to look from.

        Returns:
            (height, width, 3).

        Raises:
            SimulationError: there is no way to draw off screen.
        """
        camera = camera or Camera()
        view = mujoco.MjvCamera()
        view.lookat[:] = camera.lookat_W
        view.distance = camera.distance
        view.azimuth, view.elevation = np.rad2deg([camera.azimuth, camera.elevation])
        renderer = self._renderer(size)
        renderer.update_scene(self._data, view)
        for mark in marks:
            _draw(renderer.scene, mark)
        pixels: NDArray[np.uint8] = renderer.render().copy()
        self._check()
        return pixels

    def close(self) -> None:
        """Frees what drawing holds."""
        while self._renderers:
            self._renderers.popitem()[1].close()

    def _check(self) -> None:
        numbers = [int(number) for number in self._data.warning.number]
        if any(numbers) and not self._warnings:
            self._warnings.append(f"warning counters {numbers}")
        if self._warnings:
            found, self._warnings[:] = "; ".join(self._warnings), []
            raise SimulationError(f"MuJoCo warned: {found}")

    def _shape(self, solids: Sequence[Solid]) -> None:
        """Gives the compiled solids their sizes, and all that MuJoCo derives of them."""
        model = self._model
        for row, solid in enumerate(solids):
            geom = int(model.body_geomadr[1 + self._links + row])
            model.geom_size[geom] = _size(solid)
            model.geom_aabb[geom, 3:] = solid.extent
            model.geom_rbound[geom] = np.linalg.norm(solid.extent)
        mujoco.mj_setConst(model, self._data)

    def _place_scene(self, time: float) -> None:
        if self._scene is not None:
            self._put(self._links, self._scene.poses(time))

    def _put(self, first: int, poses: Array) -> None:
        """Places bodies from that row on."""
        for row, pose in enumerate(poses, first):
            self._data.mocap_pos[row] = pose[:3, 3]
            self._data.mocap_quat[row] = _quaternion(pose[:3, :3])

    def _renderer(self, size: tuple[int, int]) -> Any:
        if size not in self._renderers:
            try:
                self._renderers[size] = mujoco.Renderer(self._model, size[1], size[0])
            except Exception as error:  # each GL backend fails in its own way
                cure = "install libegl1 and libgl1-mesa-dri, or libosmesa6"
                if _TOO_LATE:
                    cure = "mujoco was imported before proxcgal.sim: import that first"
                raise SimulationError(
                    f"cannot draw off screen with MUJOCO_GL={os.environ.get('MUJOCO_GL')}: "
                    f"{error}; {cure}"
                ) from None
        return self._renderers[size]


def _size(solid: Solid) -> tuple[float, ...]:
    """As MuJoCo has it: three numbers, whatever the shape."""
    if isinstance(solid, Box):
        return tuple(solid.extent)
    if isinstance(solid, Sphere):
        return solid.radius, 0.0, 0.0
    height = solid.height if isinstance(solid, Cylinder) else solid.length
    return solid.radius, 0.5 * height, 0.0


@once_per_robot
def _compiled(robot: Robot, shapes: tuple[type[Solid], ...]) -> Any:
    """The robot's links and solids of no particular size; made once for each."""
    spec = mujoco.MjSpec()
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    for row, name in enumerate(robot.link_names):
        vertices_L, triangles = robot.full_mesh(name)
        mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = np.asarray(vertices_L, np.float64).ravel()
        mesh.userface = np.asarray(triangles, np.int32).ravel()
        body = spec.worldbody.add_body(name=name, mocap=True)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0, group=_LINKS,
            rgba=_LINK_COLORS[row % 2],
        )  # fmt: skip
    for shape in shapes:
        spec.worldbody.add_body(mocap=True).add_geom(
            type=_GEOMS[shape], size=(0.5, 0.5, 0.5), contype=0, conaffinity=0,
            rgba=_OBSTACLE_COLOR,
        )  # fmt: skip
    _furnish(spec)
    try:
        return spec.compile()
    except ValueError as error:
        raise SimulationError(f"MuJoCo refuses the scene: {error}") from None


def _quaternion(rotation: Array) -> Array:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion


def _furnish(spec: Any) -> None:
    """Light, sky and floor: only for pictures."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 8, 6
    spec.visual.headlight.ambient = (0.45, 0.45, 0.45)
    spec.visual.headlight.diffuse = (0.45, 0.45, 0.45)
    spec.visual.headlight.specular = (0.1, 0.1, 0.1)
    spec.worldbody.add_light(
        pos=(0.5, -1.0, 3.0), dir=(0.0, 0.3, -1.0), diffuse=(0.35, 0.35, 0.35),
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=False,  # it halves the time
    )  # fmt: skip
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=64, height=64,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, rgb1=(1, 1, 1), rgb2=(0.92, 0.94, 0.97),
    )  # fmt: skip
    spec.add_material(name="floor", rgba=(0.9, 0.92, 0.94, 1.0), emission=0.25)
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(3.0, 3.0, 0.1),
        group=_FLOOR, contype=0, conaffinity=0, material="floor",
    )  # fmt: skip


def _draw(scene: Any, mark: Spheres | Arrow) -> None:
    """Appends a mark to what will be drawn, as far as the scene has room."""
    color = np.array(mark.color, np.float32)
    if isinstance(mark, Spheres):
        kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, mark.radius)
        upright = np.eye(3).ravel()
        for center in mark.centers_W[: scene.maxgeom - scene.ngeom]:
            mujoco.mjv_initGeom(scene.geoms[scene.ngeom], kind, size, center, upright, color)
            scene.ngeom += 1
    elif scene.ngeom < scene.maxgeom and np.any(mark.tip_W != mark.tail_W):
        kind = mujoco.mjtGeom.mjGEOM_ARROW
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), color)
        mujoco.mjv_connector(geom, kind, mark.width, mark.tail_W, mark.tip_W)
        scene.ngeom += 1
