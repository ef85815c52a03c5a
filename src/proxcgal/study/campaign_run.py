"""A campaign from its request to its folder: plan, perform, analyse, record the worst, write."""

import shlex
import sys
import time as clock
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from proxcgal.core.files import write_bytes, write_json, write_text
from proxcgal.core.progress import ProgressBar, announce
from proxcgal.core.provenance import origin, versions
from proxcgal.evaluation.metrics import Summary
from proxcgal.recording.writer import RecordedTicks
from proxcgal.study.campaign import Campaign, CampaignKind, CampaignRequest, Ended, Trial
from proxcgal.study.campaign_store import CampaignStore, Outcome
from proxcgal.study.execution import parquet_bytes, perform_trials, trials_table, unfinished
from proxcgal.study.motion_picture import draw_moving
from proxcgal.study.plotting import png
from proxcgal.study.runs.preparation import check_setup
from proxcgal.study.trial_simulation import robot_of
from proxcgal.study.workers import Pool, default_workers
from proxcgal.study.worst_recordings import record_worst


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignEffort:
    """How a campaign is run, which changes no number of it."""

    workers: int | None  # processes on this machine; None: one a processor
    cluster: str | None  # address of a scheduler whose workers simulate instead
    recorded: int  # so many of the worst trials are recorded
    ticks: RecordedTicks  # of these recordings
    picture: bool  # draw the moving picture, where the kind has one
    quiet: bool  # no progress on stderr


def run_campaign(
    name: str,
    kind: CampaignKind,
    request: CampaignRequest,
    folder: Path,
    command: str,
    effort: CampaignEffort,
) -> Summary:
    """Runs what is unfinished, and fills the folder, the report apart.

    Args:
        name: of the kind.
        kind: of the campaign.
        request: what to run.
        folder: of this campaign and no other.
        command: as typed; for `run.json`.
        effort: how to run it.

    Returns:
        The numbers of `summary.json`.

    Raises:
        ProxError: a request that does not fit, a folder of something else, a cluster that was lost.
        KeyboardInterrupt: with a message of what was kept.
    """
    begin = clock.monotonic()
    quiet = effort.quiet
    announce("drawing scenes (a robot's first time takes a while)", quiet=quiet)
    campaign = kind.plan(request)
    _check(campaign)
    workers = effort.workers or default_workers(len(campaign.trials))
    # Trials of other versions are not mixed with these.
    packages = {key: v for key, v in versions().items() if key not in ("python", "machine")}
    with (
        Pool(workers, effort.cluster) as pool,
        CampaignStore(folder, {**campaign.description, "made_with": packages}) as store,
    ):
        ended = _perform(campaign, store, pool, folder, quiet=quiet)
        table = trials_table(ended, campaign.columns)
        by_key = {each.trial.key: each for each in ended}
        worst = [by_key[key] for key in kind.worst(table)[: effort.recorded]]
        shown = kind.side_by_side(campaign) if kind.side_by_side else []
        with nullcontext(pool) if effort.cluster is None else Pool(workers) as near:
            recorded = record_worst(worst, folder, effort.ticks, near, quiet=quiet)
            if effort.picture:
                draw_moving(shown, folder, near, quiet=quiet)
        summary = {
            "campaign": name, "seed": request.seed, "runs": request.runs, "trials": len(ended),
            "failed": [
                {"name": e.trial.name, "error": e.outcome.error, "command": e.trial.command}
                for e in ended if e.outcome.error is not None
            ],
            **kind.analyse(table, campaign), "worst": recorded,
        }  # fmt: skip
        if kind.side_by_side is not None:
            summary["moving"] = [{**trial.tags, "controller": trial.controller} for trial in shown]
        for file, figure in kind.figures(table, summary).items():
            write_bytes(folder / file, png(figure))
        for file, text in kind.pages(summary).items():
            write_text(folder / file, text)
        write_bytes(folder / "trials.parquet", parquet_bytes(table))
        times = {  # of this process alone, and of all trials whenever they ran
            "wall_s": clock.monotonic() - begin,
            "trials_wall_s": sum(e.outcome.wall_s for e in ended),
            "simulated_s": sum(e.trial.scenario.duration for e in ended),
        }
        write_json(folder / "run.json", origin(command) | times)
        write_json(folder / "summary.json", summary)
    return summary


def _check(campaign: Campaign) -> None:
    """Sets one trial of each scene up, so that nothing is written where something does not fit."""
    firsts = {trial.scenario.name: trial for trial in reversed(campaign.trials)}
    controllers = tuple(dict.fromkeys(trial.controller for trial in campaign.trials))
    for trial in firsts.values():
        check_setup(trial.scenario, controllers, robot_of(trial.scenario), quiet=True)


def _perform(
    campaign: Campaign, store: CampaignStore, pool: Pool, folder: Path, *, quiet: bool
) -> list[Ended]:
    """Runs the unfinished trials under a progress bar."""
    todo, count = unfinished(campaign, store), len(campaign.trials)
    ended = count - len(todo)
    if ended:
        announce(f"{ended} of {count} trials are there already", quiet=quiet)
    sizes = [trial.scenario.duration for trial in todo]
    with ProgressBar("simulating", sizes, "s", quiet=quiet) as progress:

        def done(trial: Trial, outcome: Outcome) -> None:
            nonlocal ended
            ended += 1
            text = f"failed: {outcome.error}" if outcome.error else f"{outcome.wall_s:.1f} s"
            progress.finished(f"{ended} of {count}: {trial.name}: {text}")

        try:
            return perform_trials(campaign, store, pool, progress.shares, done)
        except KeyboardInterrupt:
            kept = count - len(unfinished(campaign, store))
            raise KeyboardInterrupt(
                f"{kept} of {count} trials are kept in {folder}; the same command goes on from "
                "there"
            ) from None


def print_campaign(kind: CampaignKind, summary: dict[str, Any], folder: Path) -> None:
    """Prints tables and verdicts, commands that repeat the worst trials, and what failed."""
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
