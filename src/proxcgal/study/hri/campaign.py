"""The human study: virtual subjects at two tasks beside the arm ([WA] III-B, IV-B)."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import numpy as np
import polars as pl

from proxcgal.core.errors import ConfigError
from proxcgal.core.modes import HOLD
from proxcgal.core.progress import OnProgress
from proxcgal.core.typing import Array
from proxcgal.evaluation.phases import SAMPLES_HZ, mean_distances
from proxcgal.evaluation.trial_log import TOO_CLOSE, TrialLog, sampled_ticks
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import CONTROLLERS
from proxcgal.scenario.setup import Setup
from proxcgal.study.campaign import Campaign, Trial, plain
from proxcgal.study.hri.figures import figures
from proxcgal.study.hri.layouts import draw_layout
from proxcgal.study.hri.metrics import analyse
from proxcgal.study.hri.texts import captions, introduction, listings, verdicts
from proxcgal.study.kind import CampaignRequest, Kind
from proxcgal.study.store import Row, Series
from proxcgal.study.trials import identity, robot_of, simulate

SCENES = ("hri_task1", "hri_task2")
#: Of the ticks under 0.05 m: the human was in a blind spot where the cloud's nearest point was
#: this much farther away than the human really was, or there was none.
UNSEEN_M = 0.05
_ROUNDING = 1e-6  # of a limit
COLUMNS = (
    "mean_m", "seen_mean_m", "empty_ticks", "ticks", "true_min_m", "true_min_link",
    "too_close_ticks", "blind_ticks", "self_min_m", "leaked_points_max", "held_ticks", "finite",
    "limits_kept", "phase_means", "windows", "signals", "d_min_m", "buffer_m", "true_m", "seen_m",
    "activation",
)  # fmt: skip


def plan(request: CampaignRequest) -> Campaign:
    """Every controller with the same subjects, cells and noise; then all of it in moved cells.

    Raises:
        ProxError: a scenario without an operator, or one that does not load.
    """
    trials: list[Trial] = []
    redrawn: Counter[str] = Counter()
    scenes: dict[str, str] = {}
    phases: dict[str, str] = {}  # which scene has each
    recordings: list[str] = []
    compared: list[str] = []  # rows of the paper's tables
    keys = [assignment.partition("=")[0].strip() for assignment in request.overrides]
    for key in ("seed", "operator.subject", "operator.draw"):
        if key in keys:
            raise ConfigError(f"--set {key}=...: every subject has its own; --seed fixes them all")
    for source in request.scenarios or SCENES:
        base = _operated(source, request.overrides)
        robot = robot_of(base)
        Setup.of(base, robot)  # tells what does not fit before anything is drawn
        task = task_of(base)
        if any(trial.tags["task"] == task for trial in trials):
            raise ConfigError(f"--scenario {source}: there is another one named {task}")
        for phase in base.windows():
            if phase in phases:
                raise ConfigError(
                    f"--scenario {source}: phase {phase} is in {phases[phase]} too: Table II needs "
                    "another name for it"
                )
            phases[phase] = base.name
        if base.operator.recording is not None and (request.runs > 1 or request.jitter):
            raise ConfigError(
                f"--scenario {source}: operator.recording = {base.operator.recording}: its person "
                "is always the same, in the same place: needs --subjects 1 --no-jitter"
            )
        scenes |= identity(base, robot)
        if base.operator.recording is not None and base.operator.who not in recordings:
            recordings.append(base.operator.who)
        compared += [task, *base.windows()] if is_the_papers(base) else []
        for jitter in (False, True) if request.jitter else (False,):
            for subject in range(1, request.runs + 1):
                own = (
                    *request.overrides, f"operator.subject={subject}",
                    f"operator.draw={request.seed}",
                )  # fmt: skip
                layout = draw_layout(
                    _operated(source, own), own, request.seed, subject, jitter=jitter
                )
                redrawn += layout.redrawn
                trials += [
                    Trial(
                        scenario=layout.scenario, source=source, overrides=layout.overrides,
                        controller=controller, seed=request.seed + subject,
                        robot_digest=robot.digest,
                        tags={
                            "task": task, "layout": "jittered" if jitter else "main",
                            "subject": subject,
                        },
                    )
                    for controller in request.controllers or CONTROLLERS
                ]  # fmt: skip
    description = {
        "kind": "hri", "seed": request.seed, "scenarios": list(request.scenarios or SCENES),
        "set": list(request.overrides), **scenes,
    }  # fmt: skip
    settings = _plain_settings(trials[0].scenario.controller.model_dump(mode="json"))
    return Campaign(
        description=description, trials=trials, perform=perform, columns=COLUMNS,
        notes={
            "redrawn": dict(sorted(redrawn.items())), "settings": settings, "compared": compared,
            "recordings": recordings,
        },
    )  # fmt: skip


def is_the_papers(scenario: HriScenario) -> bool:
    """Is it one of the built-in cells, whatever its seed, controller, simulation and subject?"""
    return any(_cell(scenario) == _cell(_operated(name, ())) for name in SCENES)


def _cell(scenario: HriScenario) -> dict[str, Any]:
    aside = {"description", "seed", "controller", "simulation", "faults", "vertices_per_link"}
    whose = {"subject", "draw"}
    return {
        key: {k: v for k, v in value.items() if k not in whose} if key == "operator" else value
        for key, value in scenario.model_dump(exclude=aside).items()
    }


def task_of(scenario: HriScenario) -> str:
    """The task's name in tables: "task1" of `hri_task1`."""
    return plain(scenario.name.removeprefix("hri_"))


def _plain_settings(table: dict[str, Any]) -> dict[str, Any]:
    """As JSON can have it: a bound that is off is null."""
    return {
        key: _plain_settings(value) if isinstance(value, dict)
        else None if isinstance(value, float) and not np.isfinite(value)
        else value
        for key, value in table.items()
    }  # fmt: skip


def _operated(source: str, overrides: tuple[str, ...]) -> HriScenario:
    scenario = load_scenario(source, overrides)
    if not isinstance(scenario, HriScenario):
        raise ConfigError(f'--scenario {source}: kind = "{scenario.kind}": must be "hri"')
    return scenario


def perform(trial: Trial, report: OnProgress) -> Row:
    """One trial's numbers and, at the sensors' rate, its course."""
    log = simulate(
        trial.scenario, trial.controller, trial.seed, report, robot_digest=trial.robot_digest,
        truth_hz=SAMPLES_HZ,
    )  # fmt: skip
    assert isinstance(trial.scenario, HriScenario)
    return numbers(log, trial.scenario)


def numbers(log: TrialLog, scenario: HriScenario) -> Row:
    """What the campaign keeps of a trial.

    Args:
        log: with the true distance at least at the samples, and wherever it is under 0.05 m.
        scenario: what was run.
    """
    summary = log.summary()
    samples = sampled_ticks(log.elapsed, SAMPLES_HZ)
    close = log.true_m < TOO_CLOSE
    seen = np.isfinite(log.seen_m)
    nearest = int(np.nanargmin(log.true_m))
    means = mean_distances(log, scenario)
    mean, seen_mean = means.pop("cycle")
    setup = Setup.of(scenario, robot_of(scenario))
    finite = bool(np.isfinite(log.qd).all() and np.isfinite(log.q).all())
    settings = scenario.controller
    return {
        "mean_m": mean,
        "seen_mean_m": seen_mean,
        "empty_ticks": int((~seen).sum()),
        "ticks": len(log.elapsed),
        "true_min_m": summary["true_min_m"],
        "true_min_link": log.true_link[nearest],
        "too_close_ticks": int(close.sum()),
        "blind_ticks": int((close & (log.seen_m - log.true_m > UNSEEN_M)).sum()),
        "self_min_m": summary["self_min_m"],
        "leaked_points_max": summary["leaked_points_max"],
        "held_ticks": int((log.mode >= HOLD).sum()),
        "finite": finite,
        "limits_kept": finite and _limits_kept(log, setup),
        "phase_means": json.dumps(means),
        "windows": json.dumps(scenario.windows()),
        "signals": json.dumps(scenario.signals()),
        "d_min_m": settings.d_min,
        "buffer_m": settings.buffer,
        "true_m": _series(log.true_m[samples]),
        "seen_m": _series(log.seen_m[samples]),
        "activation": _series(log.activation[samples]),
    }


def _limits_kept(log: TrialLog, setup: Setup) -> bool:
    """Joint positions, speeds and accelerations of every command within the robot's limits."""
    robot = setup.robot
    slack = 1.0 + _ROUNDING
    period = 1.0 / setup.scenario.simulation.control_hz
    change = np.diff(log.qd, axis=0, prepend=np.zeros((1, robot.n_q))) / period
    inside = (log.q >= robot.q_min - _ROUNDING) & (log.q <= robot.q_max + _ROUNDING)
    return bool(
        inside.all()
        and (np.abs(log.qd) <= robot.qd_max * slack).all()
        and (np.abs(change) <= robot.qdd_max * slack).all()
    )


def _series(values: Array) -> Series:
    """Tenths of a millimetre, or of a thousandth; None where there is nothing."""
    return [round(v, 4) if np.isfinite(v) else None for v in values.tolist()]


def worst(table: pl.DataFrame) -> list[str]:
    """The whole-body trials of the cell as it is that came nearest to the human."""
    ours = table.filter(
        pl.col("controller") == "wb", pl.col("layout") == "main", pl.col("error").is_null()
    )
    order = ours.sort("true_min_m", "too_close_ticks", "key", descending=[False, True, False])
    return order["key"].to_list()


def shown(campaign: Campaign) -> list[Trial]:
    """The first subject at the last task, as in `trials.png`, whole body and sensor points."""
    last = campaign.trials[-1].tags["task"]
    own = [
        trial for trial in campaign.trials
        if (trial.tags["task"], trial.tags["layout"], trial.tags["subject"]) == (last, "main", 1)
    ]  # fmt: skip
    pair = [trial for name in ("wb", "sm") for trial in own if trial.controller == name]
    return pair or own[:1]


KIND = Kind(
    title="A human in the workspace",
    introduction=introduction,
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions, worst=worst,
    worst_of="wb's trials in the cell as it is, by the least true distance", shown=shown, runs=20,
)  # fmt: skip
