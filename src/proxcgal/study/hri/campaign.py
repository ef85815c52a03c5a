"""The human study: virtual subjects at two tasks beside the arm ([WA] III-B, IV-B)."""

from collections import Counter
from typing import Any

import numpy as np
import polars as pl

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.phases import SAMPLES_HZ
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import CONTROLLERS
from proxcgal.study.campaign import (
    Campaign,
    CampaignKind,
    CampaignPlan,
    CampaignRequest,
    Trial,
    file_name,
    ranked,
)
from proxcgal.study.campaign_store import Row
from proxcgal.study.hri.figures import figures
from proxcgal.study.hri.layouts import draw_layout
from proxcgal.study.hri.metrics import analyse
from proxcgal.study.hri.paper_tables import listings
from proxcgal.study.hri.texts import captions, introduction, verdicts
from proxcgal.study.hri.trial_metrics import COLUMNS, trial_metrics
from proxcgal.study.trial_simulation import simulate_trial

SCENES = ("hri_task1", "hri_task2")


def plan(request: CampaignRequest) -> Campaign:
    """Every controller with the same subjects, cells and noise; then all of it in moved cells.

    Raises:
        ProxError: a scenario without an operator, or one that does not load.
    """
    campaign = CampaignPlan("hri", request, SCENES)
    redrawn: Counter[str] = Counter()
    phases: dict[str, str] = {}  # which scene has each
    recordings: list[str] = []
    compared: list[str] = []  # rows of the paper's tables
    keys = [assignment.partition("=")[0].strip() for assignment in request.overrides]
    for key in ("seed", "operator.subject", "operator.draw"):
        if key in keys:
            raise ConfigError(f"--set {key}=...: every subject has its own; --seed fixes them all")
    for source in campaign.scenarios:
        base = _operated(source, request.overrides)
        task = task_of(base)
        robot = campaign.add_scene(source, base, task).robot
        for phase in base.windows():
            if phase in phases:
                raise ConfigError(
                    f"--scenario {source}: phase {phase} is in {phases[phase]} too: Table II needs "
                    "another name for it"
                )
            phases[phase] = base.name
        if base.operator.recording is not None:
            if request.runs > 1 or request.jitter:
                raise ConfigError(
                    f"--scenario {source}: operator.recording = {base.operator.recording}: its "
                    "person is always the same, in the same place: needs --subjects 1 --no-jitter"
                )
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
                for controller in request.controllers or CONTROLLERS:
                    campaign.add_trial(
                        layout.scenario, source, layout.overrides, controller, subject, robot,
                        task=task, layout="jittered" if jitter else "main", subject=subject,
                    )  # fmt: skip
    settings = campaign.trials[0].scenario.controller.model_dump(mode="json")
    return campaign.campaign(
        perform, COLUMNS, redrawn=dict(sorted(redrawn.items())),
        settings=_plain_settings(settings), compared=compared,
        recordings=list(dict.fromkeys(recordings)),
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
    return file_name(scenario.name.removeprefix("hri_"))


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
    log = simulate_trial(
        trial.scenario, trial.controller, trial.seed, report, robot_digest=trial.robot_digest,
        truth_hz=SAMPLES_HZ,
    )  # fmt: skip
    assert isinstance(trial.scenario, HriScenario)
    return trial_metrics(log, trial.scenario)


def side_by_side(campaign: Campaign) -> list[Trial]:
    """The first subject at the last task, as in `trials.png`, whole body and sensor points."""
    last = campaign.trials[-1].tags["task"]
    own = [
        trial for trial in campaign.trials
        if (trial.tags["task"], trial.tags["layout"], trial.tags["subject"]) == (last, "main", 1)
    ]  # fmt: skip
    pair = [trial for name in ("wb", "sm") for trial in own if trial.controller == name]
    return pair or own[:1]


KIND = CampaignKind(
    title="A human in the workspace",
    introduction=introduction,
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions,
    # Those first that came nearest to the human, or were too near for longer.
    worst=ranked(
        pl.col("controller") == "wb", pl.col("layout") == "main",
        true_min_m=False, too_close_ticks=True,
    ),
    worst_of="wb's trials in the cell as it is, by the least true distance", runs=20,
    side_by_side=side_by_side,
)  # fmt: skip
