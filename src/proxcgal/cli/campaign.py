"""`proxcgal campaign`: many trials, on this machine or on a cluster."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from proxcgal.cli.options import (
    ControllerName,
    Flag,
    Number,
    Settings,
    checked_workers,
    flat,
)
from proxcgal.core.errors import ConfigError

#: Those of `study.kinds`, which takes long to import.
KindName = Literal["static", "faults", "walkthrough", "joint", "hri"]


@dataclass(frozen=True)
class CampaignOptions:
    """Run many trials, and say what they amount to.

    static: panels, start postures and goals drawn at random round the static scenes, every draw
    with all controllers.
    faults: every fault of docs/reliability.md while the arm moves, on two robots: is the mode
    right, how soon, does the arm recover?
    joint: the 12-joint robot's scenes from each start, with each task on and off, known and sensed.
    walkthrough: random operators and paths guide the painting arm, a quarter of them within bounds;
    does the guard trip at once and on nothing else, how does the arm stop?
    hri: virtual subjects at two assembly tasks beside the arm, every subject with all controllers,
    then once more with all positions of the cell moved at random.

    Every finished trial is kept at once: the same command goes on where it was interrupted, and
    more --runs go on where fewer ended. Writes trials.parquet (a row a trial), summary.json,
    figures, recordings of the worst and report.html to DIR.

    Examples:
      proxcgal campaign static --runs 100
      proxcgal campaign static --runs 20 --set controller.d_min=0.25 --out out/farther
      proxcgal campaign faults --runs 20
      proxcgal campaign walkthrough --runs 200
      proxcgal campaign hri
      proxcgal campaign hri --subjects 20 --controller wb sm --no-jitter
      proxcgal campaign static --runs 1000 --cluster tcp://10.0.0.1:8786
    """

    kind: Annotated[
        KindName, tyro.conf.Positional, tyro.conf.arg(metavar="|".join(get_args(KindName)))
    ]
    """What is repeated."""
    runs: Number = None
    """Draws of each scene, runs of each fault and robot, sensed runs of each joint scene and start,
    or subjects; left out: 100, joint 5, hri 20."""
    subjects: Number = None
    """The same, as hri has it: virtual subjects 1 to N, each drawn from --seed and its number."""
    controller: Annotated[
        tuple[ControllerName, ...],
        tyro.conf.arg(metavar="wb|sm|wb_known|wb_memory ...", help_behavior_hint=""),
    ] = ()
    """Of hri, some controllers instead of all."""
    no_jitter: Flag = False
    """Of hri, only the cell as it is."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Fixes every random draw."""
    scenario: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="NAME|PATH ...", help_behavior_hint="")
    ] = ()
    """Scenes instead of the kind's own."""
    set: Settings = ()
    """Change keys of all scenarios, values as in TOML: controller.d_min=0.25"""
    workers: Number = None
    """Processes that simulate; left out: one a processor."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """A dask.distributed scheduler, whose workers simulate instead; each with --nthreads 1."""
    keep: Annotated[str, tyro.conf.arg(metavar="worst:N|none")] = "worst:5"
    """Trials to record, in DIR/recordings: the ticks that brought scans, to step through. Of static
    and hri those of wb alone, of hri in the cell as it is: there may be fewer than N."""
    no_picture: Flag = False
    """Leave the moving picture out, where the kind has one."""
    every_tick: Flag = False
    """Record every tick, so that `proxcgal replay FILE --set ...` can compute commands again."""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: out/campaign-KIND)")
    ] = None
    """Where results go, and where an interrupted campaign is found again."""
    quiet: Flag = False
    """No progress on stderr."""


def campaign_command(options: CampaignOptions, command: str) -> int:
    """Runs what is unfinished; prints tables, what was kept, what failed, the report's path."""
    from proxcgal.report.write_report import write_report
    from proxcgal.study.campaign import CampaignRequest
    from proxcgal.study.campaign_run import CampaignEffort, print_campaign, run_campaign
    from proxcgal.study.kinds import KINDS

    workers, recorded = checked_workers(options.workers), _recorded(options)
    kind = KINDS[options.kind]
    runs = options.runs if options.subjects is None else options.subjects
    request = CampaignRequest(
        runs=kind.runs if runs is None else runs, seed=options.seed, scenarios=options.scenario,
        overrides=tuple(flat(options.set)), controllers=tuple(dict.fromkeys(options.controller)),
        jitter=not options.no_jitter,
    )  # fmt: skip
    effort = CampaignEffort(
        workers=workers, cluster=options.cluster, recorded=recorded,
        ticks="all" if options.every_tick else "scans", picture=not options.no_picture,
        quiet=options.quiet,
    )  # fmt: skip
    folder = options.out or Path("out") / f"campaign-{options.kind}"
    summary = run_campaign(options.kind, kind, request, folder, command, effort)
    report = write_report(folder)
    print_campaign(kind, summary, folder)
    print(report)
    failed = summary["failed"] or any("error" in entry for entry in summary["worst"])
    return 1 if failed else 0


def _recorded(options: CampaignOptions) -> int:
    """How many of the worst are recorded. Raises: ConfigError: also for the other options."""
    problems = []
    form, _, kept = options.keep.partition(":")
    if options.keep != "none" and not (form == "worst" and kept.isdecimal()):
        problems.append(f"--keep {options.keep}: must be worst:N, such as worst:5, or none")
    problems += [
        f"--{name} {count}: must be 1 or more"
        for name, count in (("runs", options.runs), ("subjects", options.subjects))
        if count is not None and count < 1
    ]
    if options.kind != "hri":
        own = {
            "subjects": options.subjects, "controller": options.controller,
            "no-jitter": options.no_jitter,
        }  # fmt: skip
        problems += [
            f"--{name}: goes with campaign hri, not with {options.kind}"
            for name, value in own.items()
            if value
        ]
    elif options.runs is not None and options.subjects is not None:
        problems.append("--runs and --subjects say the same: give one of them")
    if options.seed < 0:
        problems.append(f"--seed {options.seed}: must be 0 or more")
    if problems:
        raise ConfigError("\n".join(problems))
    return int(kept or 0)
