"""What was understood of a robot's file, as text to read before trusting it."""

import numpy as np

from proxcgal.models.description import Joint, RobotDescription, listed
from proxcgal.models.doubts import doubts

_DEGREE = np.degrees(1.0)


def understanding(description: RobotDescription) -> str:
    """Tree, limits, sizes and doubts, a line each."""
    d = description
    lines = [
        f"robot '{d.name}' of {d.source}",
        f"{len(d.joints)} joints, {len(d.links)} links with a surface, "
        f"{len(d.frames)} frames; the world is the frame of the base",
        f"tool: {repr(d.tool) if d.tool else 'not said; one of ' + listed(d.ends)}",
        "",
        "tree",
        *_branch(d, -1, 1),
        "",
        "joints, in the order of q",
        *_table([["", "type", "lower", "upper", "speed", "axis"],
                 *(_joint_row(row, joint) for row, joint in enumerate(d.joints))]),
        "",
        "links",
        *_table([["", "size [m]", "triangles", "without area"],
                 *([link.name, " x ".join(f"{s:.3f}" for s in np.ptp(link.vertices_L, axis=0)),
                    str(len(link.triangles)), str(link.dropped_faces)] for link in d.links)]),
    ]  # fmt: skip
    missing = [joint.name for joint in d.joints if not np.isfinite(joint.qd_max)]
    notes = [*d.notes, *doubts(d)]
    if missing:
        notes.append(f"joint {listed(missing)}: no speed limit; speed_limits= or [limits] gives it")
    if notes:
        lines += ["", "look at", *(f"  {note}" for note in notes)]
    return "\n".join(lines)


def _branch(d: RobotDescription, joint: int, depth: int) -> list[str]:
    """What a joint carries, and below it the joints there, each with what it carries."""
    names = [frame.name for frame in d.frames if frame.joint == joint]
    shown = {link.name for link in d.links}
    carried = ", ".join(f"{name}*" if name in shown else name for name in names) or "nothing"
    head = "base" if joint < 0 else d.joints[joint].name
    lines = [f"{'  ' * depth}{head}: {carried}"]
    for row, other in enumerate(d.joints):
        if other.parent == joint:
            lines += _branch(d, row, depth + 1)
    return lines


def _joint_row(row: int, joint: Joint) -> list[str]:
    turns = joint.type == "revolute"
    unit, per_s, factor = ("deg", "deg/s", _DEGREE) if turns else ("m", "m/s", 1.0)

    def value(number: float, of: str) -> str:
        return f"{number * factor:.4g} {of}" if np.isfinite(number) else "none"

    return [
        f"{row} {joint.name}", joint.type, value(joint.q_min, unit), value(joint.q_max, unit),
        value(joint.qd_max, per_s), " ".join(f"{a:.3g}" for a in joint.axis + 0.0),
    ]  # fmt: skip


def _table(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [("  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True))).rstrip()
            for row in rows]  # fmt: skip
