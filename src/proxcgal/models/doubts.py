"""What in a description looks like a mistake: millimetres for metres, degrees for radians."""

import numpy as np

from proxcgal.models.description import RobotDescription, listed

# No link of an arm is larger, and no joint of it farther from the one before [m].
LARGEST_LINK = 5.0
# A mesh that is smaller all ways was drawn in another unit, or is nothing one can hit [m].
SMALLEST_LINK = 0.001
# More than two turns either way [rad], and faster than a joint of an arm turns [rad/s].
MOST_TURN = 4 * np.pi + 0.1
FASTEST_TURN = 50.0


def doubts(description: RobotDescription) -> list[str]:
    """One sentence for each kind of thing to look at, with the names; none for a sound robot."""
    found = []
    sizes = {link.name: float(np.ptp(link.vertices_L, axis=0).max()) for link in description.links}
    if large := {name: size for name, size in sizes.items() if size > LARGEST_LINK}:
        found.append(
            f"link {_with(large, 'm')} is larger than {LARGEST_LINK:g} m; is its mesh in "
            "millimetres, without the scale 0.001?"
        )
    if small := {name: size for name, size in sizes.items() if size < SMALLEST_LINK}:
        found.append(
            f"link {_with(small, 'm')} is smaller than {SMALLEST_LINK * 1000:g} mm; is its mesh "
            "in another unit, or scaled twice?"
        )
    far = {
        joint.name: float(np.linalg.norm(joint.origin[:3, 3]))
        for joint in description.joints
        if joint.parent >= 0 and np.linalg.norm(joint.origin[:3, 3]) > LARGEST_LINK
    }
    if far:
        found.append(
            f"joint {_with(far, 'm')} is farther than {LARGEST_LINK:g} m from the one before; are "
            "the origins in millimetres?"
        )
    turning = [joint for joint in description.joints if joint.type == "revolute"]
    bounds = {
        j.name: max(abs(b) for b in (j.q_min, j.q_max) if np.isfinite(b))
        for j in turning
        if np.isfinite([j.q_min, j.q_max]).any()
    }
    if wide := {name: bound for name, bound in bounds.items() if bound > MOST_TURN}:
        found.append(f"joint {_with(wide, 'rad')} turns that far; are its limits in degrees?")
    fast = {j.name: j.qd_max for j in turning if np.isfinite(j.qd_max) and j.qd_max > FASTEST_TURN}
    if fast:
        found.append(f"joint {_with(fast, 'rad/s')} is that fast; is its speed in degrees?")
    return found


def _with(values: dict[str, float], unit: str) -> str:
    return ", ".join(f"{listed([name])} ({value:.4g} {unit})" for name, value in values.items())
