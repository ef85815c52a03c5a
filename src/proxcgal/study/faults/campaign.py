"""Faults put into running trials: is the mode right, how soon, and does the arm recover?"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from proxcgal.core import modes
from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.metrics import Summary
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.scenario.fault_keys import FAULT_VALUES
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.assembly import Assembly
from proxcgal.study.campaign import (
    Campaign,
    CampaignKind,
    CampaignPlan,
    CampaignRequest,
    Trial,
    ranked,
)
from proxcgal.study.campaign_store import Row as Numbers
from proxcgal.study.faults.cases import ROW_OF, ROWS, TICK_MS, Fault, Row
from proxcgal.study.faults.figures import figures
from proxcgal.study.faults.texts import captions, listings, pages, verdicts
from proxcgal.study.trial_simulation import robot_of, simulate_trial

#: Scenes in which the arm moves, and every sensor sees a room.
SCENES = ("timing_ur10e", "timing_panda")
SET = (
    "goal.offset=[0.0, 0.25, 0.05]", "duration=2.1", "vertices_per_link=1000",
    "skin.check_mounts=false",
)  # fmt: skip
EARLIEST, LATEST = 0.3, 0.6  # [s] of the onset, drawn: the arm moves
#: [s] after the fault's end, by when the arm must be free again: HOLD clears 0.5 s after the first
#: clean scan.
RECOVERY = 0.7
COLUMNS = (
    "right", "latency_ms", "reached", "worst_mode", "told", "recovered", "same_commands",
    "no_flight", "qd_max",
)  # fmt: skip
_SLACK = 1e-9  # [s] a tick at the bound is in time


def plan(request: CampaignRequest) -> Campaign:
    """Every row on every robot, each run with its own onset, sensor and noise.

    Raises:
        ProxError: a scene that does not load, or whose sensors do not fit the rows.
    """
    campaign = CampaignPlan("faults", request, SCENES)
    for source in campaign.scenarios:
        kind = load_scenario(source).kind
        if kind != "static":
            raise ConfigError(
                f'--scenario {source}: kind = "{kind}": campaign faults takes scenarios of '
                'kind = "static"'
            )
        base = load_scenario(source, (*SET, *request.overrides))
        _refuse_short(base)
        setup = campaign.add_scene(source, base, base.robot, by="with")  # tables are by robot
        mounts = _visible(setup)
        for place, row in enumerate(ROWS):
            for number in range(request.runs):
                draw = np.random.default_rng([request.seed, number, place])
                onset = round(float(draw.uniform(EARLIEST, LATEST)), 3)
                if row.refused:
                    faults: Sequence[Fault] = _mount_faults(row, mounts, draw)
                    text = _assignment(faults, 0.0, float(base.duration))
                else:
                    faults = row.faults(int(draw.integers(len(setup.skin))))
                    text = _assignment(faults, onset, onset + row.duration)
                overrides = (*SET, *row.settings, *request.overrides, text)
                campaign.add_trial(
                    load_scenario(source, overrides), source, overrides, "wb", number, setup.robot,
                    robot=base.robot, row=row.name, run=number,
                )  # fmt: skip
    return campaign.campaign(perform, COLUMNS)


def _refuse_short(base: Scenario) -> None:
    """A run that ends sooner shows no recovery."""
    longest = max(row.duration for row in ROWS)
    least = LATEST + longest + RECOVERY
    if base.duration <= least:
        raise ConfigError(
            f"--set duration={base.duration:g}: must be more than {least:g} s: a fault begins at "
            f"{LATEST:g} s at the latest, lasts up to {longest:g} s, and the arm is to be free "
            f"again {RECOVERY:g} s later"
        )


def _visible(setup: Setup) -> list[tuple[int, str]]:
    """Sensors and directions in which a wrong mount can be found at the scene's start."""
    checks = Assembly.of(setup, "wb", seed=0).mount_checks().sensors
    return [(check.sensor, axis) for check in checks for axis in check.visible]


def _mount_faults(
    row: Row, mounts: Sequence[tuple[int, str]], draw: np.random.Generator
) -> list[Fault]:
    """The row's fault at one of those sensors, in one of those directions, either way."""
    (fault,) = row.faults(0)
    turns = fault["kind"] == "mount_turn"
    there = [(sensor, axis) for sensor, axis in mounts if axis.startswith("turn") == turns]
    if not there:
        raise ConfigError(f"no sensor sees enough of the arm to tell {row.name!r} at this start")
    sensor, axis = there[int(draw.integers(len(there)))]
    size = FAULT_VALUES[str(fault["kind"])].default * float(draw.choice([-1.0, 1.0]))
    return [fault | {"sensor": sensor, "axis": axis[-1], "value": size}]


def _assignment(faults: Any, start: float, end: float) -> str:
    """The `[[fault]]` tables as one assignment."""
    tables = []
    for fault in faults:
        keys = [
            f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}"
            for key, value in fault.items()
        ]
        tables.append("{" + ", ".join([*keys, f"from = {start}", f"to = {round(end, 3)}"]) + "}")
    return f"fault=[{', '.join(tables)}]"


def perform(trial: Trial, report: OnProgress) -> Numbers:
    """One trial beside its row's requirements."""
    row = ROW_OF[str(trial.tags["row"])]
    if row.refused:
        return _refused(trial, report)
    log = _simulate(trial, trial.scenario, report)
    # By ticks, because the caller's clock may be what jumps.
    time = log.elapsed
    onset = trial.scenario.faults[0].start
    after = time >= onset
    reached = after & (log.mode >= row.least)
    latency = float(time[reached][0] - onset) if reached.any() else np.inf
    worst = int(log.mode[after].max())
    free = time > onset + row.duration + RECOVERY
    recovered = row.least == modes.STOP or bool((log.mode[free] == modes.RUN).all())
    reported = not row.finding or log.findings.get(row.finding, 0) > 0
    same = not row.same_commands or _same(trial, log, report)
    calm = not ((log.leaked_points > 0) & (log.activation > 0.0)).any()
    in_time = row.least == modes.RUN or latency <= row.within + TICK_MS / 1000.0 + _SLACK
    right = in_time and worst <= row.most and reported and recovered and same
    right = right and (calm or not row.no_flight)
    return {
        "right": bool(right and np.isfinite(log.qd).all()),
        "latency_ms": 1000.0 * latency if np.isfinite(latency) and row.least > modes.RUN else None,
        "reached": bool(reached.any()),
        "worst_mode": modes.NAMES[worst],
        "told": reported,
        "recovered": recovered,
        "same_commands": same,
        "no_flight": calm,
        "qd_max": float(np.abs(log.qd).max()),
    }


def _refused(trial: Trial, report: OnProgress) -> Numbers:
    """Is that very sensor found before the run, and no other?"""
    setup = Setup.of(trial.scenario, robot_of(trial.scenario, trial.robot_digest))
    checks = Assembly.of(setup, trial.controller, trial.seed).mount_checks()
    wrong = [check.sensor for check in checks.wrong]
    report(1.0)
    found = wrong == [fault.sensor for fault in trial.scenario.faults]
    return {
        "right": found, "latency_ms": None, "reached": found,
        "worst_mode": "refused" if wrong else "began", "told": found, "recovered": True,
        "same_commands": True, "no_flight": True, "qd_max": 0.0,
    }  # fmt: skip


def _same(trial: Trial, log: TrialLog, report: OnProgress) -> bool:
    """Are the commands those of the same trial without the fault?"""
    other = _simulate(trial, trial.scenario.model_copy(update={"faults": ()}), report)
    return bool(np.array_equal(log.qd, other.qd))


def _simulate(trial: Trial, scenario: Scenario, report: OnProgress) -> TrialLog:
    return simulate_trial(
        scenario, trial.controller, trial.seed, report,
        robot_digest=trial.robot_digest, without_truth=True,
    )  # fmt: skip


def analyse(table: pl.DataFrame, campaign: Campaign) -> Summary:
    """The numbers of `summary.json`: per robot and row, how many were right and how soon."""
    done = table.filter(pl.col("error").is_null())
    rows: dict[str, dict[str, Any]] = {}
    for (robot, name), part in done.group_by(["robot", "row"], maintain_order=True):
        latency = part["latency_ms"].drop_nulls()
        counts = part["worst_mode"].value_counts().sort("worst_mode")
        rows.setdefault(str(robot), {})[str(name)] = {
            "runs": len(part),
            "right": int(part["right"].sum()),
            "latency_median_ms": latency.median(),
            "latency_max_ms": latency.max(),
            "worst_modes": dict(counts.iter_rows()),
        }
    return {
        "robots": rows,
        "right": int(done["right"].sum()),
        "self_min_m": None,
        "right_share": int(done["right"].sum()) / len(done) if len(done) else None,
    }


KIND = CampaignKind(
    title="Faults",
    introduction="A fault between the world and the controller while the arm moves: what mode "
    "follows, how soon, and whether the arm recovers. Engineering figures from a simulation, not a "
    "certificate.",
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions, worst=ranked(right=False, latency_ms=True), pages=pages,
    worst_of="all runs: the wrong ones, then the slowest",
)  # fmt: skip
