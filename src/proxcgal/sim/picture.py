"""Pictures of the simulated world, drawn off screen by MuJoCo."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from proxcgal.core.errors import SimulationError
from proxcgal.core.typing import Array
from proxcgal.sim.off_screen import TOO_LATE

Color = tuple[float, float, float, float]

FLOOR = 2  #: group of the floor, which is in no cloud


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


class Pictures:
    """Draws one compiled model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Args: `model` with what `furnish` adds."""
        self._model = model
        self._renderers: dict[tuple[int, int], Any] = {}

    def draw(
        self,
        data: mujoco.MjData,
        marks: Iterable[Spheres | Arrow],
        size: tuple[int, int],
        camera: Camera,
    ) -> NDArray[np.uint8]:
        """(height, width, 3) of the model at its posture, with marks drawn into it.

        Args:
            data: where everything is.
            marks: what MuJoCo knows nothing of: clouds, pairs, frames.
            size: width and height in pixels, at most 1920 x 1080.
            camera: where to look from.

        Raises:
            SimulationError: there is no way to draw off screen.
        """
        view = mujoco.MjvCamera()
        view.lookat[:] = camera.lookat_W
        view.distance = camera.distance
        view.azimuth, view.elevation = np.rad2deg([camera.azimuth, camera.elevation])
        renderer = self._renderer(size)
        renderer.update_scene(data, view)
        for mark in marks:
            _draw(renderer.scene, mark)
        pixels: NDArray[np.uint8] = renderer.render().copy()
        return pixels

    def close(self) -> None:
        """Frees what drawing holds."""
        while self._renderers:
            self._renderers.popitem()[1].close()

    def _renderer(self, size: tuple[int, int]) -> Any:
        if size not in self._renderers:
            try:
                self._renderers[size] = mujoco.Renderer(self._model, size[1], size[0])
            except Exception as error:  # each GL backend fails in its own way
                cure = "install libegl1 and libgl1-mesa-dri, or libosmesa6"
                if TOO_LATE:
                    cure = "mujoco was imported before proxcgal.sim: import that first"
                backend = os.environ.get("MUJOCO_GL")
                raise SimulationError(
                    f"cannot draw off screen with MUJOCO_GL={backend}: {error}; {cure}"
                ) from None
        return self._renderers[size]


def furnish(spec: Any) -> None:
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
        group=FLOOR, contype=0, conaffinity=0, material="floor",
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
