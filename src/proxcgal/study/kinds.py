"""The kinds of campaign that there are."""

from proxcgal.study.campaign import CampaignKind
from proxcgal.study.faults import campaign as faults
from proxcgal.study.hri import campaign as hri
from proxcgal.study.joint import campaign as joint
from proxcgal.study.static import campaign as static
from proxcgal.study.walkthrough import campaign as walkthrough

#: By the name that `proxcgal campaign` takes.
KINDS: dict[str, CampaignKind] = {
    "static": static.KIND,
    "faults": faults.KIND,
    "walkthrough": walkthrough.KIND,
    "joint": joint.KIND,
    "hri": hri.KIND,
}
