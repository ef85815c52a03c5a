"""Solids of a scene that somebody holds and moves; the others go their own way."""

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scene.arm_follower import arm_followers
from proxcgal.scene.obstacles import Scene

SPEED = 1.0  #: [m/s] at most, of a solid that a hand moves


class DraggedSolids:
    """Solids that somebody holds, by name; each goes where it is wanted, no faster than a bound."""

    def __init__(self, speed: float = SPEED) -> None:
        """Args: `speed` at most [m/s]."""
        self._speed = speed
        #: Where the held solids are, (4, 4) T_WO by name.
        self.held: dict[str, Array] = {}
        self._wanted: dict[str, Array] = {}
        self._velocity: dict[str, Array] = {}

    def move(self, name: str, now: Array, wanted: Array) -> None:
        """Takes a solid, where nobody held it, and says where it is to go.

        Args:
            name: of the solid.
            now: (4, 4) T_WO where it is.
            wanted: (4, 4) T_WO; turned at once, moved at bounded speed.
        """
        self.held.setdefault(name, np.array(now))
        self._wanted[name] = np.array(wanted)

    def release(self) -> None:
        """Lets all go: each is again where its own way has it."""
        for kept in (self.held, self._wanted, self._velocity):
            kept.clear()

    def advance(self, period: float) -> None:
        """Moves what is held for so long [s]."""
        for name, wanted in self._wanted.items():
            place = self.held[name][:3, 3]
            step = wanted[:3, 3] - place
            far = float(np.linalg.norm(step))
            step *= min(1.0, self._speed * period / max(far, 1e-12))
            self.held[name] = wanted.copy()
            self.held[name][:3, 3] = place + step
            self._velocity[name] = step / period

    def velocity(self, name: str) -> Array:
        """(3,) of a held solid's origin, in world [m/s]."""
        return self._velocity.get(name, np.zeros(3))


class LiveScene:
    """A scene some of whose solids are held; the others go their own way.

    A person's hand takes the arm along.
    """

    still = False

    def __init__(self, scene: Scene, hands: DraggedSolids, since: float = 0.0) -> None:
        """Args: the scene's own time begins at `since` [s]."""
        self._scene, self._hands, self._since = scene, hands, since
        self.names, self.solids = scene.names, scene.solids
        self._arms = arm_followers(scene.names, scene.solids)

    def poses(self, time: float) -> Array:
        """(n, 4, 4) T_WO."""
        poses = np.array(self._scene.poses(self._since + time))
        for name, pose in self._held():
            poses[self.names.index(name)] = pose
        for arm in self._arms:
            if arm.hand_name in self._hands.held:
                arm.follow(poses)
        return poses

    def twists(self, time: float) -> Array:
        """(n, 6) in world: velocity of each origin [m/s], angular velocity [rad/s]."""
        twists = np.array(self._scene.twists(self._since + time))
        for name, _ in self._held():
            twists[self.names.index(name)] = (*self._hands.velocity(name), 0.0, 0.0, 0.0)
        return twists

    def _held(self) -> list[tuple[str, Array]]:
        return [(name, pose) for name, pose in self._hands.held.items() if name in self.names]
