"""What people look at: RViz markers and diagnostics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from proxcgal import _core
from proxcgal.core.modes import NAMES
from proxcgal.models.robots import Robot
from proxcgal.sim.tick import TickResult
from proxcgal_ros.convert import point

Array = NDArray[np.float64]
_LEVELS = (
    DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.ERROR
)  # fmt: skip
_PAIR, _VIEWS = 0, 1  # ids
_SHOWN = 0.3  # [m] of a field of view


class Views:
    """The sensors' fields of view as pyramids."""

    def __init__(self, robot: Robot, skin: _core.Skin) -> None:
        """Args: the arm and what it carries."""
        links = list(robot.link_names)
        self._robot = robot
        self._links = np.array([links.index(mount.link) for mount in skin.mounts], np.intp)
        self._T_LS = np.array([mount.T_LS for mount in skin.mounts]).reshape(-1, 4, 4)
        side = _SHOWN * np.tan(skin.model.field_of_view / 2.0)
        corners = [[x * side, y * side, _SHOWN] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        apex = [0.0, 0.0, 0.0]
        edges = [[apex, corner] for corner in corners]
        edges += [[corners[i], corners[(i + 1) % 4]] for i in range(4)]
        self._edges_S: Array = np.array(edges).reshape(-1, 3)

    def marker(self, q: Array, head: Header) -> Marker:
        """All of them as lines in the base frame."""
        T_WS = np.asarray(self._robot.link_poses(q))[self._links] @ self._T_LS
        ends_W = self._edges_S @ np.swapaxes(T_WS[:, :3, :3], 1, 2) + T_WS[:, None, :3, 3]
        lines = [Point(x=x, y=y, z=z) for x, y, z in ends_W.reshape(-1, 3).tolist()]
        return _marker(head, _VIEWS, "fields_of_view", Marker.LINE_LIST, lines, 0.001,
                       ColorRGBA(r=0.2, g=0.5, b=0.9, a=0.5))  # fmt: skip


def pair_marker(result: TickResult, head: Header) -> Marker:
    """An arrow from the obstacle to the arm; removed where nothing is in view."""
    ends: list[Point] = []
    if result.surface_W is not None and result.obstacle_W is not None:
        ends = [point(result.obstacle_W), point(result.surface_W)]
    active = float(result.activation())
    return _marker(head, _PAIR, "closest_pair", Marker.ARROW, ends, 0.01,
                   ColorRGBA(r=active, g=1.0 - active, b=0.1, a=1.0))  # fmt: skip


def markers(*shown: Marker) -> MarkerArray:
    """Together."""
    return MarkerArray(markers=list(shown))


def _marker(
    head: Header, number: int, name: str, kind: int, points: list[Point], width: float,
    color: ColorRGBA,
) -> Marker:  # fmt: skip
    marker = Marker(header=head, ns=f"proxcgal/{name}", id=number, type=kind, color=color)
    marker.action = Marker.ADD if points else Marker.DELETE
    marker.points = points
    marker.pose.orientation.w = 1.0
    marker.scale.x = width
    if kind == Marker.ARROW:
        marker.scale.y, marker.scale.z = 2.0 * width, 3.0 * width
    return marker


def diagnostics(
    node: str, hardware: str, result: TickResult | None, names: Sequence[str],
    ages: Sequence[float], slow: float, silent: float, head: Header,
) -> DiagnosticArray:  # fmt: skip
    """The controller's mode and findings, and each sensor's age.

    Args:
        node: its name.
        hardware: the robot's name.
        result: of the last tick; None before the first.
        names: of the sensors.
        ages: [s] since the last scan of each was received.
        slow: [s] age from which a sensor degrades the mode.
        silent: [s] age from which its silence may hold the arm.
        head: stamp.
    """
    message = DiagnosticArray(header=head)
    if result is None:
        mode, level, reasons = "no joint states yet", DiagnosticStatus.STALE, ""
    else:
        mode, level = NAMES[result.mode], _LEVELS[result.mode]
        reasons = ", ".join(sorted({found.reason for found in result.findings}))
    controller = DiagnosticStatus(
        level=level, name=f"{node}: controller", hardware_id=hardware, message=mode
    )
    controller.values = [KeyValue(key="mode", value=mode), KeyValue(key="findings", value=reasons)]
    if result is not None:
        controller.values += [
            KeyValue(key="distance_m", value=f"{result.seen:.4f}"),
            KeyValue(key="tick_us", value=f"{result.tick_us:.0f}"),
        ]
    message.status = [controller]
    for name, age in zip(names, ages, strict=True):
        level, text = DiagnosticStatus.OK, "fresh"
        if age > slow:
            level, text = DiagnosticStatus.WARN, "late"
        if age > silent:
            level, text = DiagnosticStatus.ERROR, "silent"
        status = DiagnosticStatus(
            level=level, name=f"{node}: sensor {name}", hardware_id=name, message=text
        )
        status.values = [KeyValue(key="age_s", value=f"{age:.4f}")]
        message.status.append(status)
    return message
