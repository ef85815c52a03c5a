"""What the limit stage does next to obstacles: the figures of docs/reliability.md, goals 3, 9, 11.

    python bench/limit_probes.py [postures] [inside] [balls] [plates] [late] [--runs N] [--robot R]

Each probe moves the arm by its commands, without delay, and measures distances with
`px.signed_distance`, which the tick does not use.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

import proxcgal as px

PERIOD = 0.01
REACHABLE = 0.19  #: [m] final distance asked for where the joints can reach it


@dataclass
class Run:
    """One run of the arm beside one obstacle."""

    distances: list[float] = field(default_factory=list)  #: [m] signed, of each tick
    closing: list[float] = field(default_factory=list)  #: [m/s] by the arm's own motion
    modes: set[str] = field(default_factory=set)
    findings: set[str] = field(default_factory=set)
    tool: list[np.ndarray] = field(default_factory=list)

    @property
    def fastest_near(self) -> float:
        """Largest own closing speed nearer than 0.10 m [m/s]."""
        near = [c for d, c in zip(self.distances, self.closing, strict=True) if d < 0.10]
        return max(near, default=0.0)


def controller(robot: px.Robot, **settings: object) -> px.Controller:
    """With the settings that users get."""
    return px.Controller(robot, px.Skin([]), px.ControllerConfig(**settings))


def distance(robot: px.Robot, q: np.ndarray, points_W: np.ndarray) -> float:
    return float(px.signed_distance(robot, q, points_W).distance.min())


def drive(
    robot: px.Robot,
    q: np.ndarray,
    points_at: Callable[[float], np.ndarray],
    velocity_at: Callable[[float], np.ndarray | None] = lambda _time: None,
    *,
    seconds: float = 3.0,
    goal: np.ndarray | None = None,
    intervals: Iterator[float] | None = None,
    **settings: object,
) -> Run:
    """Moves the arm among known points.

    Args:
        robot: at rest at the start.
        q: (n_q,) where it starts [rad].
        points_at: (n, 3) in world, by time [m].
        velocity_at: theirs, (3,), or None where it is not known [m/s].
        seconds: length of the run.
        goal: (4, 4) T_WT; left out: where the tool is at the start.
        intervals: [s] between ticks; left out: the nominal period.
        **settings: of the controller.
    """
    ctrl, run, time = controller(robot, **settings), Run(), 0.0
    goal = robot.tool_pose(q) if goal is None else goal
    q = q.copy()
    before = distance(robot, q, points_at(0.0))
    while time < seconds:
        points_W = points_at(time)
        out = ctrl.tick_known(time, q, points_W, goal, velocity_at(time))
        run.modes.add(out.mode.name)
        run.findings.update(f.reason for f in out.findings)
        step = next(intervals) if intervals else PERIOD
        q += step * out.qd
        after = distance(robot, q, points_W)  # the obstacle stands still meanwhile
        run.closing.append((before - after) / step)
        time += step
        before = distance(robot, q, points_at(time))
        run.distances.append(before)
        run.tool.append(robot.tool_pose(q)[:3, 3])
    run.q = q
    return run


def random_posture(robot: px.Robot, random: np.random.Generator) -> np.ndarray:
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    return random.uniform(low + 0.05, high - 0.05)


def surface_point(
    robot: px.Robot, q: np.ndarray, random: np.random.Generator, offset: float
) -> tuple[np.ndarray, str] | None:
    """A point `offset` outside a random moved link's surface, with no other link nearer."""
    links = [name for name in robot.link_names if np.any(robot.jacobian(q, name, np.zeros(3)))]
    link = links[random.integers(len(links))]
    vertices_L, triangles = robot.mesh(link)
    corners = vertices_L[triangles[random.integers(len(triangles))]]
    at_L = random.dirichlet(np.ones(3)) @ corners
    normal_L = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if not np.linalg.norm(normal_L) > 0.0:
        return None
    normal_L = normal_L / np.linalg.norm(normal_L)
    pose = robot.link_poses(q)[robot.link_names.index(link)]
    for sign in (1.0, -1.0):  # drawn meshes do not all turn their normals outwards
        point_W = pose[:3, :3] @ (at_L + sign * offset * normal_L) + pose[:3, 3]
        if abs(distance(robot, q, point_W[None]) - offset) < 1e-3:
            return point_W, link
    return None


def row_norm(robot: px.Robot, q: np.ndarray, point_W: np.ndarray) -> float:
    """Of n'J at the nearest surface point, by finite differences of the distance."""
    return float(np.linalg.norm(gradient(robot, q, point_W)))


def gradient(robot: px.Robot, q: np.ndarray, point_W: np.ndarray, h: float = 1e-4) -> np.ndarray:
    steps = h * np.eye(robot.n_q)
    return np.array(
        [
            distance(robot, q + step, point_W[None]) - distance(robot, q - step, point_W[None])
            for step in steps
        ]
    ) / (2.0 * h)


def best_distance(robot: px.Robot, q0: np.ndarray, point_W: np.ndarray, seconds: float) -> float:
    """The distance that a greedy posture search reaches in the time, within the joints' limits.

    Independent of the tick: finite differences of the signed distance, each joint as fast as its
    share of the gradient asks for, at most at its own speed.
    """
    q, best, dt = q0.copy(), -np.inf, 0.05
    for _ in range(round(seconds / dt)):
        best = max(best, distance(robot, q, point_W[None]))
        if best > REACHABLE + 0.05:
            break
        slope = gradient(robot, q, point_W)
        if not np.linalg.norm(slope) > 1e-6:
            break
        rate = 0.25 / np.linalg.norm(slope) ** 2  # [m/s] outwards
        qd = np.clip(rate * slope, -robot.qd_max, robot.qd_max)
        q = np.clip(q + dt * qd, robot.q_min, robot.q_max)
    return best


def beside(
    robot: px.Robot, runs: int, seed: int, offset: Callable[[np.random.Generator], float]
) -> Iterator[tuple[np.ndarray, np.ndarray, str]]:
    """Random postures, each with a point at that offset from a link that joints can move away."""
    random, found = np.random.default_rng(seed), 0
    while found < runs:
        q = random_posture(robot, random)
        placed = surface_point(robot, q, random, offset(random))
        if placed is None or row_norm(robot, q, placed[0]) < 0.1:
            continue
        found += 1
        yield q, *placed


def postures(robot: px.Robot, runs: int, nearest: int = 1) -> str:
    """A point 10 mm before a link: how far is it after 3 s?"""
    short, excluded, fast, held = [], 0, 0.0, 0
    for q, point_W, link in beside(robot, runs, 1, lambda _random: 0.010):
        best = best_distance(robot, q, point_W, 3.0)
        run = drive(
            robot, q, lambda _t, p=point_W: p[None],
            tasks=[px.Avoidance(nearest=nearest), px.Reach()],
        )  # fmt: skip
        excluded += best < REACHABLE + 0.02
        fast = max(fast, run.fastest_near)
        held += bool({"HOLD", "STOP"} & run.modes)
        if run.distances[-1] < min(REACHABLE, best - 0.02):
            short.append((link, run.distances[-1], best))
    return (
        f"postures, nearest={nearest}: {len(short)} of {runs} short "
        f"{[(k, round(d, 3), round(b, 3)) for k, d, b in short[:8]]}; "
        f"{excluded} where the joints cannot reach {REACHABLE} m; own closing speed under 0.10 m "
        f"at most {fast:.3f} m/s; held {held}"
    )


def inside(robot: px.Robot, runs: int, nearest: int = 1) -> str:
    """A point 6 to 15 mm inside a link: is it out within 2.5 s?"""
    late, short = [], []
    for q, point_W, link in beside(robot, runs, 2, lambda r: -r.uniform(0.006, 0.015)):
        run = drive(
            robot, q, lambda _t, p=point_W: p[None],
            tasks=[px.Avoidance(nearest=nearest), px.Reach()],
        )  # fmt: skip
        out = next((i * PERIOD for i, d in enumerate(run.distances) if d > 0.0), np.inf)
        if out > 2.5:
            late.append((link, run.distances[-1]))
        best = best_distance(robot, q, point_W, 3.0)
        if run.distances[-1] < min(REACHABLE, best - 0.02):
            short.append((link, round(run.distances[-1], 3), round(best, 3)))
    return (
        f"inside, nearest={nearest}: {len(late)} of {runs} not out in 2.5 s {late[:5]}; "
        f"{len(short)} short after 3 s {short[:8]}"
    )


def balls(robot: px.Robot, runs: int, told: bool = False) -> str:
    """Balls that come at a link and stop 5 to 30 mm before it."""
    rows = []
    for i, (q, point_W, _link) in enumerate(
        beside(robot, runs, 3, lambda r: r.uniform(0.005, 0.030))
    ):
        speed = 0.4 + 1.2 * (i % 4) / 3
        found = px.signed_distance(robot, q, point_W[None])
        away = found.normal_W[0]
        start, arrival = point_W + 1.0 * away, 1.0 / speed

        def at(time: float, a=start, b=point_W, end=arrival) -> np.ndarray:
            return (a + (b - a) * min(time / end, 1.0))[None]

        def velocity(time: float, v=-speed * away, end=arrival) -> np.ndarray | None:
            return (v if time < end else np.zeros(3)) if told else None

        run = drive(robot, q, at, velocity, seconds=arrival + 3.0)
        best = best_distance(robot, q, point_W, 3.0)
        rows.append((speed, min(run.distances), run.distances[-1], best, run.fastest_near))
    table = np.array(rows)
    lines = [f"balls, velocity {'told' if told else 'unknown'}: {runs}"]
    for speed in np.unique(table[:, 0]):
        some = table[table[:, 0] == speed]
        short = some[:, 2] < np.minimum(REACHABLE, some[:, 3] - 0.02)
        lines.append(
            f"  {speed:.1f} m/s: least {some[:, 1].min():.3f}, median"
            f" {np.median(some[:, 1]):.3f} m; final least {some[:, 2].min():.3f} m,"
            f" short {short.sum()} of {len(some)}; own closing under 0.10 m at most"
            f" {some[:, 4].max():.3f} m/s"
        )
    return "\n".join(lines)


def plate(
    center_W: np.ndarray, along: np.ndarray, up: np.ndarray, half: float = 0.12
) -> np.ndarray:
    """Points of a square, 5 mm apart."""
    grid = np.arange(-half, half + 1e-9, 0.005)
    u, v = (each.ravel()[:, None] for each in np.meshgrid(grid, grid))
    return center_W + u * along + v * up


def plates(robot: px.Robot) -> str:
    """The forearm between two plates 0.30 m apart; none, one, both of them closing in."""
    q = np.array([0.3, -1.7, 1.9, -1.7, -1.57, 0.0])
    pose = robot.link_poses(q)[robot.link_names.index("forearm_link")]
    vertices_W = robot.mesh("forearm_link")[0] @ pose[:3, :3].T + pose[:3, 3]
    middle = 0.5 * (vertices_W.max(axis=0) + vertices_W.min(axis=0))
    _, _, axes = np.linalg.svd(vertices_W - vertices_W.mean(axis=0))
    along, up = axes[0], np.cross(axes[0], [0.0, 0.0, 1.0])
    normal = up / np.linalg.norm(up)  # horizontal, across the forearm
    up = np.cross(normal, along)
    goal = robot.tool_pose(q)
    goal[:3, 3] += 0.3 * normal  # beyond one of them
    lines = ["plates 0.30 m apart:"]
    for low, high in ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1)):

        def at(time: float, a=low, b=high) -> np.ndarray:
            left = max(0.0, 1.5 - time)
            return np.vstack(
                [
                    plate(middle - (0.15 + a * left) * normal, along, up),
                    plate(middle + (0.15 + b * left) * normal, along, up),
                ]
            )

        run = drive(robot, q, at, seconds=8.0, goal=goal)
        path = np.array(run.tool)
        speed = np.linalg.norm(np.diff(path[-300:], axis=0), axis=1) / PERIOD
        lines.append(
            f"  closing at {low}, {high} m/s: tool {1e3 * np.sqrt(np.mean(speed**2)):.2f} mm/s rms"
            f" in the last 3 s, distance least {min(run.distances):.3f}, last"
            f" {run.distances[-1]:.3f} m, own closing speed under 0.10 m at most"
            f" {run.fastest_near:.3f} m/s, modes {sorted(run.modes)},"
            f" findings {sorted(run.findings)}"
        )
    return "\n".join(lines)


def late(robot: px.Robot, runs: int) -> str:
    """Ticks at any time: does a joint pass its limit?"""
    lines = ["late ticks, worst excess past a joint's limit [mrad]:"]
    nothing = np.full((1, 3), 50.0)
    for name, draw in (
        ("nominal", lambda r: 1.0),
        ("jitter 10 %", lambda r: r.uniform(0.9, 1.1)),
        ("jitter 50 %", lambda r: r.uniform(0.5, 1.5)),
        ("always 1.5", lambda r: 1.5),
        ("always 2", lambda r: 2.0),
    ):
        random, worst, findings = np.random.default_rng(4), 0.0, set()
        for _ in range(runs):
            # From near a limit straight into it.
            q = random_posture(robot, random)
            joint = random.integers(robot.n_q)
            q[joint] = robot.q_max[joint] - random.uniform(0.0, 0.8)
            ctrl, time = controller(robot), 0.0
            goal_q = q.copy()
            goal_q[joint] += 1.5
            goal = robot.tool_pose(goal_q)
            for _ in range(150):
                out = ctrl.tick_known(time, q, nothing, goal)
                step = PERIOD * draw(random)
                q = q + step * out.qd
                time += step
                findings.update(f.reason for f in out.findings)
                worst = max(worst, float(np.max([q - robot.q_max, robot.q_min - q])))
        lines.append(f"  {name}: {1e3 * max(worst, 0.0):.3f}; findings {sorted(findings)}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("probes", nargs="*", help="postures, inside, balls, plates, late")
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--robot", default="ur10e")
    arguments = parser.parse_args()
    robot = px.load_robot(arguments.robot)
    probes: dict[str, list[Callable[[], str]]] = {
        "postures": [lambda n=n: postures(robot, arguments.runs, n) for n in (1, 3)],
        "inside": [lambda n=n: inside(robot, arguments.runs, n) for n in (1, 3)],
        "balls": [lambda t=t: balls(robot, arguments.runs, t) for t in (False, True)],
        "plates": [lambda: plates(robot)],
        "late": [lambda: late(robot, max(arguments.runs // 3, 5))],
    }
    for name in arguments.probes or list(probes):
        if name not in probes:
            parser.error(f"no probe {name!r}; there are {', '.join(probes)}")
        for probe in probes[name]:
            print(probe(), flush=True)


if __name__ == "__main__":
    main()
