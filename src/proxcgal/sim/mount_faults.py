"""Where the simulated sensors really sit: injected mount faults."""

from collections.abc import Sequence

import numpy as np

from proxcgal import _core
from proxcgal.core.transforms import rotation_from_vector
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.scenario.fault_keys import MOUNT_FAULTS, Fault
from proxcgal.sim.faults import rows_of, value_of

_STREAM = 3  # of the seed; noise and other faults draw from others


class RealMounts:
    """The sensors' mounts in the world, which `mount_` faults move from where they should be."""

    def __init__(
        self,
        robot: Robot,
        mounts: Sequence[_core.Mount],
        faults: Sequence[Fault] = (),
        seed: int = 0,
    ) -> None:
        """Resolves the faults.

        Args:
            robot: that carries the sensors.
            mounts: as the controller has them.
            faults: of the scenario, whatever kind.
            seed: of the run.
        """
        self._robot, links = robot, list(robot.link_names)
        self._links = np.array([links.index(mount.link) for mount in mounts], np.intp)
        self._T_LS: Array = np.array([mount.T_LS for mount in mounts]).reshape(-1, 4, 4)
        names = [mount.name for mount in mounts]
        self._moved: list[tuple[Fault, int, Array]] = []
        for place, fault in enumerate(faults):
            if fault.kind not in MOUNT_FAULTS:
                continue
            for row in sorted(rows_of(fault, names) or ()):
                drawn = np.random.default_rng([seed, _STREAM, place, row]).standard_normal(3)
                axis = np.eye(3)["xyz".index(fault.axis)] if fault.axis else drawn
                by = value_of(fault) * axis / np.linalg.norm(axis)
                T_SS = np.eye(4)
                if fault.kind == "mount_offset":
                    T_SS[:3, 3] = by
                else:
                    T_SS[:3, :3] = rotation_from_vector(by)
                self._moved.append((fault, row, T_SS))

    def poses_W(  # noqa: N802  a frame's suffix
        self, q: Array, time: float, rows: Sequence[int] | slice = slice(None)
    ) -> Array:
        """(k, 4, 4) T_WS of these sensors at a posture (n_q,) and a time of the run [s]."""
        poses: Array = self._robot.link_poses(q)[self._links[rows]] @ self.at(time)[rows]
        return poses

    def at(self, time: float) -> Array:
        """(n, 4, 4) T_LS of every sensor at that time of the run."""
        if not self._moved:
            return self._T_LS
        T_LS = self._T_LS.copy()
        for fault, row, T_SS in self._moved:
            if fault.start <= time and (fault.end is None or time < fault.end):
                T_LS[row] = T_LS[row] @ T_SS
        return T_LS
