"""`proxcgal campaign`: many trials, on this machine or on a cluster."""

from __future__ import annotations

import shlex
import sys
import time as clock
from contextlib import nullcontext
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
import tyro.extras

from proxcgal.cli.options import (
    ControllerName,
    Flag,
    Number,
    Settings,
    checked_workers,
    flat,
)
from proxcgal.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from proxcgal.recording.writer import RecordedTicks
    from proxcgal.study.campaign import Campaign, Ended, Trial
    from proxcgal.study.kind import Kind
    from proxcgal.study.store import Outcome, Store
    from proxcgal.study.workers import Pool

#: Module that holds each kind as its `KIND`.
KINDS = {
    "static": "proxcgal.study.static.campaign",
    "faults": "proxcgal.study.faults.campaign",
    "walkthrough": "proxcgal.study.walkthrough.campaign",
    "joint": "proxcgal.study.joint.campaign",
    "hri": "proxcgal.study.hri.campaign",
}
if TYPE_CHECKING:
    KindName = str
else:
    KindName = tyro.extras.literal_type_from_choices(KINDS)


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

    kind: Annotated[KindName, tyro.conf.Positional, tyro.conf.arg(metavar="|".join(KINDS))]
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
    from proxcgal.core.files import write_bytes, write_json, write_text
    from proxcgal.core.progress import announce
    from proxcgal.core.provenance import origin
    from proxcgal.report.report import write_report
    from proxcgal.study.campaign_picture import show_moving
    from proxcgal.study.figures import png
    from proxcgal.study.kind import CampaignRequest
    from proxcgal.study.store import Store
    from proxcgal.study.table import parquet, tidy
    from proxcgal.study.workers import Pool, default_workers
    from proxcgal.study.worst_recordings import keep_worst

    begin = clock.monotonic()
    workers, kept = checked_workers(options.workers), _kept(options)
    kind: Kind = import_module(KINDS[options.kind]).KIND
    inputs = options.runs if options.subjects is None else options.subjects
    runs = kind.runs if inputs is None else inputs
    request = CampaignRequest(
        runs=runs, seed=options.seed, scenarios=options.scenario,
        overrides=tuple(flat(options.set)), controllers=tuple(dict.fromkeys(options.controller)),
        jitter=not options.no_jitter,
    )  # fmt: skip
    announce("drawing scenes (a robot's first time takes a while)", quiet=options.quiet)
    campaign = kind.plan(request)
    _check(campaign)
    workers = workers or default_workers(len(campaign.trials))
    folder = options.out or Path("out") / f"campaign-{options.kind}"
    with (
        Pool(workers, options.cluster) as pool,
        Store(folder, {**campaign.description, "made_with": _packages()}) as store,
    ):
        ended = _perform(campaign, store, pool, folder, options.quiet)
        table = tidy(ended, campaign.columns)
        worst = kind.worst(table)[:kept]
        chosen = [next(e for e in ended if e.trial.key == key) for key in worst]
        ticks: RecordedTicks = "all" if options.every_tick else "scans"
        with nullcontext(pool) if options.cluster is None else Pool(workers) as near:
            recorded = keep_worst(chosen, folder, ticks, near, quiet=options.quiet)
            if kind.shown is not None and not options.no_picture:
                show_moving(kind.shown(campaign), folder, near, quiet=options.quiet)
        failed = [e for e in ended if e.outcome.error is not None]
        summary = {
            "campaign": options.kind, "seed": options.seed, "runs": runs,
            "trials": len(ended), "failed": [_failure(e) for e in failed],
            **kind.analyse(table, campaign), "worst": recorded,
        }  # fmt: skip
        if kind.shown is not None:
            summary["moving"] = [
                {**trial.tags, "controller": trial.controller} for trial in kind.shown(campaign)
            ]
        for name, figure in kind.figures(table, summary).items():
            write_bytes(folder / name, png(figure))
        for name, text in (kind.pages(summary) if kind.pages else {}).items():
            write_text(folder / name, text)
        write_bytes(folder / "trials.parquet", parquet(table))
        write_json(folder / "run.json", origin(command) | _times(ended, begin))
        write_json(folder / "summary.json", summary)
        report = write_report(folder)
    _print(kind, summary, folder)
    print(report)
    return 1 if failed or any("error" in entry for entry in recorded) else 0


def _kept(options: CampaignOptions) -> int:
    """How many of the worst are recorded. Raises: ConfigError: also for the other options."""
    problems = []
    form, _, kept = options.keep.partition(":")
    if options.keep != "none" and not (form == "worst" and kept.isdecimal()):
        problems.append(f"--keep {options.keep}: must be worst:N, such as worst:5, or none")
    for name in ("runs", "subjects"):
        count = getattr(options, name)
        if count is not None and count < 1:
            problems.append(f"--{name} {count}: must be 1 or more")
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


def _packages() -> dict[str, str]:
    """What a trial's numbers depend on: those of other versions are not put beside them."""
    from proxcgal.core.provenance import versions

    return {name: v for name, v in versions().items() if name not in ("python", "machine")}


def _check(campaign: Campaign) -> None:
    """Sets one trial of each scene up, so that nothing is written where something does not fit."""
    from proxcgal.study.runs.results import check
    from proxcgal.study.trials import robot_of

    firsts = {trial.scenario.name: trial for trial in reversed(campaign.trials)}
    controllers = tuple(dict.fromkeys(trial.controller for trial in campaign.trials))
    for trial in firsts.values():
        check(trial.scenario, controllers, robot_of(trial.scenario), quiet=True)


def _perform(
    campaign: Campaign, store: Store, pool: Pool, folder: Path, quiet: bool
) -> list[Ended]:
    """Runs the unfinished trials under a progress bar."""
    from proxcgal.core.progress import ProgressBar, announce
    from proxcgal.study.campaign import run_campaign, unfinished

    todo = unfinished(campaign, store)
    there = len(campaign.trials) - len(todo)
    if there:
        announce(f"{there} of {len(campaign.trials)} trials are there already", quiet=quiet)
    ended = there
    sizes = [trial.scenario.duration for trial in todo]
    with ProgressBar("simulating", sizes, "s", quiet=quiet) as progress:

        def done(trial: Trial, outcome: Outcome) -> None:
            nonlocal ended
            ended += 1
            text = f"failed: {outcome.error}" if outcome.error else f"{outcome.wall_s:.1f} s"
            progress.finished(f"{ended} of {len(campaign.trials)}: {trial.name}: {text}")

        try:
            return run_campaign(campaign, store, pool, progress.shares, done)
        except KeyboardInterrupt:
            kept = len(campaign.trials) - len(unfinished(campaign, store))
            raise KeyboardInterrupt(
                f"{kept} of {len(campaign.trials)} trials are kept in {folder}; the same command "
                "goes on from there"
            ) from None


def _failure(ended: Ended) -> dict[str, Any]:
    return {
        "name": ended.trial.name, "error": ended.outcome.error, "command": ended.trial.command
    }  # fmt: skip


def _times(ended: Sequence[Ended], begin: float) -> dict[str, float]:
    """What it took: the last process alone, and all trials whenever they ran."""
    return {
        "wall_s": clock.monotonic() - begin,
        "trials_wall_s": sum(e.outcome.wall_s for e in ended),
        "simulated_s": sum(e.trial.scenario.duration for e in ended),
    }


def _print(kind: Kind, summary: dict[str, Any], folder: Path) -> None:
    for listing in kind.listings(summary):
        print(f"{listing}\n")
    for sentence in kind.verdicts(summary):
        print(sentence)
    if summary["worst"]:
        print(
            f"\nThe worst of {kind.worst_of}, recorded; what steps through each, and what runs it "
            "again:"
        )
    for entry in summary["worst"]:
        if "error" in entry:
            print(f"proxcgal: {entry['name']}: not recorded: {entry['error']}", file=sys.stderr)
            continue
        print(f"  {shlex.join(('proxcgal', 'replay', str(folder / entry['recording'])))}")
        print(f"    {entry['command']}")
    for entry in summary["failed"]:
        print(f"proxcgal: {entry['name']}: failed: {entry['error']}", file=sys.stderr)
        print(f"proxcgal:   {entry['command']}", file=sys.stderr)
