"""The 12-joint robot: every scene from every start, with each task on and off, known and sensed."""

import polars as pl

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.models.macro_micro import part
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.campaign import (
    Campaign,
    CampaignKind,
    CampaignPlan,
    CampaignRequest,
    Trial,
    ranked,
)
from proxcgal.study.campaign_store import Row
from proxcgal.study.joint.figures import figures
from proxcgal.study.joint.metrics import COLUMNS, joint_metrics
from proxcgal.study.joint.texts import captions, listings, verdicts
from proxcgal.study.trial_simulation import robot_of, simulate_trial

SCENES = (
    "joint_free", "joint_cylinder", "joint_cylinder_tight", "joint_gate", "joint_behind",
    "joint_chassis",
)  # fmt: skip
#: Stacks that are compared with `full`: the thesis's own, and each task off or added.
STACKS: dict[str, tuple[str, ...]] = {
    "full": (),
    "thesis": ('controller.tasks=["thesis"]',),
    "no_joint_limits": ('controller.off=["joint_limits"]',),
    "no_avoidance": ('controller.off=["avoidance"]',),
    "no_minimum_altitude": ('controller.off=["minimum_altitude"]',),
    "with_self_collision": (
        'controller.tasks=["joint_limits", "self_collision", "avoidance", "minimum_altitude", '
        '"reach"]',
    ),
    "with_manipulability": (
        'controller.tasks=["joint_limits", "avoidance", "minimum_altitude", '
        '"manipulability_micro", "manipulability_macro", "reach"]',
    ),
}
#: Perceptions other than known: the controller, and what is changed of the scene.
SENSED = 'perception="sensed"'
PERCEPTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "sensed": ("wb", (SENSED,)),
    "sensed_2nd_set": ("wb", (SENSED, "skin.with_optional=true")),
    "memory": ("wb_memory", (SENSED,)),
    "memory_2nd_set": ("wb_memory", (SENSED, "skin.with_optional=true")),
}


def plan(request: CampaignRequest) -> Campaign:
    """Known: each stack once, as nothing is drawn there. Sensed: the full stack for each seed.

    Raises:
        ProxError: a scene that does not load or is of another kind.
    """
    campaign = CampaignPlan("joint", request, SCENES)
    for source in campaign.scenarios:
        base = load_scenario(source, request.overrides)
        if not isinstance(base, JointScenario):
            raise ConfigError(f"--scenario {source}: kind = {base.kind!r}; needs 'joint'")
        robot = campaign.add_scene(source, base).robot
        part(robot, base.controller.macro_joints, "macro")  # the numbers are of both arms
        for init in base.initial:
            runs = [("wb_known", stack, "known", 0, changes) for stack, changes in STACKS.items()]
            runs += [
                (controller, "full", perception, number, changes)
                for perception, (controller, changes) in PERCEPTIONS.items()
                for number in range(request.runs)
            ]
            for controller, stack, perception, number, changes in runs:
                overrides = (*request.overrides, f'initial=["{init}"]', *changes)
                scenario = load_scenario(source, overrides)
                campaign.add_trial(
                    scenario, source, overrides, controller, number, robot, scene=scenario.name,
                    init=init, stack=stack, perception=perception, run=number,
                )  # fmt: skip
    return campaign.campaign(perform, COLUMNS)


def perform(trial: Trial, report: OnProgress) -> Row:
    """One run's numbers."""
    log = simulate_trial(
        trial.scenario, trial.controller, trial.seed, report, robot_digest=trial.robot_digest
    )
    return joint_metrics(log, trial.scenario, robot_of(trial.scenario, trial.robot_digest))


def analyse(table: pl.DataFrame, campaign: Campaign) -> Summary:
    """The numbers of `summary.json`: one entry a run."""
    done = table.filter(pl.col("error").is_null())
    tasks = {trial.key: list(trial.scenario.controller.levels) for trial in campaign.trials}
    keys = [name for name in COLUMNS if name not in ("series", "tasks")]
    runs = [
        {"scenario": row["scene"], "init": row["init"], "tasks": tasks[row["key"]]}
        | {key: row[key] for key in ("stack", "perception", "controller", "seed", *keys)}
        for row in done.iter_rows(named=True)
    ]
    return {
        "robot": campaign.trials[0].scenario.robot,
        "runs": runs,
        "self_min_m": done["self_min_m"].min(),
        "self_under_limit": int((done["self_min_m"] < SELF_LIMIT_M).sum()) if len(done) else 0,
    }


KIND = CampaignKind(
    title="The 12-joint robot: what each task costs and buys",
    introduction="A UR10e on the flange of a KUKA KR 150-2, one chain of 12 joints, goals by task "
    "priority. Every scene from every initial configuration, with the full stack, the thesis's, "
    "and each task switched off or added; then sensed from the forearm's rings instead of known. "
    "The scenes' positions, the configurations and the law's numbers come from the code of the "
    "thesis's author, not from its text; the car body's shell is ours. The robot has no inertias: "
    "every run is kinematic. Engineering figures from a simulation, not a certificate of any kind.",
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions,
    # Those first that came nearest to an obstacle.
    worst=ranked(pl.col("stack") != "no_avoidance", true_min_m=False),
    worst_of="the runs with avoidance, by the least true distance", runs=5,
)  # fmt: skip
