"""Two robots' descriptions made one chain."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from proxcgal.core.errors import ModelError
from proxcgal.core.transforms import nearest_rotation
from proxcgal.core.typing import Array
from proxcgal.models.description import RobotDescription, listed

#: How far a rotation may be from orthonormal, as the largest entry of R R' - I.
ROUNDED = 1e-3


def joined(
    first: RobotDescription,
    link: str,
    second: RobotDescription,
    pose: ArrayLike,
    prefixes: tuple[str, str],
) -> tuple[RobotDescription, list[int]]:
    """One description out of two; its tool is the second's.

    Args:
        first: keeps its place; its joints come first.
        link: the link, or named frame, of `first` that carries `second`.
        second: hangs there by its base.
        pose: (4, 4) of its base frame in that link's frame [m].
        prefixes: put before the names of each one's joints, links and frames.

    Returns:
        The description, and for each of its links its row in those of `first` and then `second`.

    Raises:
        ModelError: no such link, a pose that is none, or names that are not unique in the end.
    """
    where = first.frame(link)
    own = renamed(first, prefixes[0])
    there = hung_on(second, where.T_JF @ rigid(pose, "pose"), where.joint, len(first.joints))
    added = renamed(there, prefixes[1])
    links = (*own.links, *added.links)
    order = sorted(range(len(links)), key=lambda row: links[row].joint)
    one = replace(
        own,
        name=f"{first.name}_{second.name}",
        joints=(*own.joints, *added.joints),
        links=tuple(links[row] for row in order),
        frames=(*own.frames, *added.frames),
        tool=added.tool,
        source=f"{own.source} + {added.source}",
    )
    names: dict[str, Sequence[str]] = {
        "joint": one.joint_names,
        "link": one.link_names,
        "frame": [frame.name for frame in one.frames],
    }
    for kind, all_names in names.items():
        if twice := [name for name, count in Counter(all_names).items() if count > 1]:
            raise ModelError(
                f"attach with prefix {prefixes!r}: both robots have {kind} {listed(twice)}; a "
                "prefix that sets them apart is needed"
            )
    return one, order


def rigid(pose: ArrayLike, what: str) -> Array:
    """A (4, 4) rigid pose: the one nearest to a matrix that was rounded.

    A rotation whose product with its transpose is within ROUNDED of the identity is taken: one made
    from a quaternion of 4 decimals is within 4e-4.

    Raises:
        ModelError: it is none.
    """
    try:
        T = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError):
        raise ModelError(f"{what} = {str(pose)[:80]}; a finite (4, 4) pose is needed") from None
    if T.shape != (4, 4):
        raise ModelError(f"{what} has shape {T.shape}; a finite (4, 4) pose is needed")
    if not np.isfinite(T).all():
        raise ModelError(f"{what} holds NaN or infinity; a finite (4, 4) pose is needed")
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    if not (off < ROUNDED and np.linalg.det(R) > 0) or (T[3] != [0, 0, 0, 1]).any():
        raise ModelError(f"{what} is {T.tolist()}; a rotation and a translation are needed")
    if off > 1e-12:
        T = T.copy()
        T[:3, :3] = nearest_rotation(R)
    return T


def renamed(description: RobotDescription, prefix: str) -> RobotDescription:
    """The same robot with `prefix` before the names of its joints, links and frames."""

    def name(part: Any) -> Any:
        return replace(part, name=prefix + part.name)

    return replace(
        description,
        joints=tuple(name(joint) for joint in description.joints),
        links=tuple(name(link) for link in description.links),
        frames=tuple(name(frame) for frame in description.frames),
        tool=prefix + description.tool,
    )


def hung_on(
    description: RobotDescription, T_JB: Array, joint: int, offset: int
) -> RobotDescription:
    """The robot hung on a joint of another: its rows shifted by `offset`, its base at T_JB."""

    def row(own: int) -> int:
        return joint if own < 0 else own + offset

    def placed(own: int, pose: Array) -> Array:
        return T_JB @ pose if own < 0 else pose

    return replace(
        description,
        joints=tuple(
            replace(j, parent=row(j.parent), origin=placed(j.parent, j.origin))
            for j in description.joints
        ),
        links=tuple(
            replace(k, joint=row(k.joint), T_JL=placed(k.joint, k.T_JL)) for k in description.links
        ),
        frames=tuple(
            replace(f, joint=row(f.joint), T_JF=placed(f.joint, f.T_JF)) for f in description.frames
        ),
    )
