"""What holds of every kind of campaign: nothing that its trials do may cost its folder."""

import pytest

from proxcgal.study.campaign import CampaignRequest, Ended
from proxcgal.study.campaign_store import Outcome
from proxcgal.study.execution import parquet_bytes, trials_table
from proxcgal.study.kinds import KINDS
from proxcgal.study.plotting import png

FEWEST = {
    "static": CampaignRequest(runs=1, seed=0, scenarios=("front_plane",)),
    "faults": CampaignRequest(runs=1, seed=0, scenarios=("timing_ur10e",)),
    "walkthrough": CampaignRequest(runs=1, seed=0),
    "joint": CampaignRequest(runs=1, seed=0, scenarios=("joint_free",)),
    "hri": CampaignRequest(runs=1, seed=0, jitter=False),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_campaign_of_which_every_trial_fails_is_summed_up_all_the_same(name: str) -> None:
    kind = KINDS[name]
    campaign = kind.plan(FEWEST[name])
    failed = [
        Ended(trial=trial, outcome=Outcome(key=trial.key, error="MuJoCo warned"))
        for trial in campaign.trials
    ]
    table = trials_table(failed, campaign.columns)
    summary = {"failed": failed, "seed": 0, "runs": 1, **kind.analyse(table, campaign)}
    assert parquet_bytes(table)
    assert kind.worst(table) == []
    for listing in kind.listings(summary):
        assert str(listing)
    assert not any("none violated" in sentence for sentence in kind.verdicts(summary))
    for figure in kind.figures(table, summary).values():
        assert png(figure)
    assert isinstance(kind.captions(summary), dict)
    for page in kind.pages(summary).values():
        assert f"{len(failed)} more runs did not come to their end" in page
