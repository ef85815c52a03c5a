"""A run as a 3D scene that plays by itself: viser's own format, for a page without a server."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import viser

from proxcgal.sim.moment import Moment
from proxcgal.viewer.client_messages import ClientBounds
from proxcgal.viewer.drawing import Drawing, add_surroundings
from proxcgal.viewer.page_server import served_page
from proxcgal.viewer.scene_model import SceneModel


@dataclass(frozen=True, slots=True, eq=False)
class ArmMotion:
    """One arm's moments, in the order of their time."""

    model: SceneModel
    moments: Sequence[Moment]


def exported_scene(first: ArmMotion, ghosts: Sequence[ArmMotion] = ()) -> bytes:
    """The scene and how it moves, in real time.

    Args:
        first: drawn whole.
        ghosts: other arms in the same scene, see-through; their moments are as many, at the same
            times.

    Returns:
        What viser's client plays (zstd inside).
    """
    alone = ClientBounds(viewers=0)  # no page looks on
    with served_page("127.0.0.1", 0, label="", bounds=alone) as (server, _):
        add_surroundings(server, first.model)
        drawings = [Drawing(server.scene, first.model)]
        drawings += [
            Drawing(server.scene, ghost.model, name=f"/ghost{row}", ghost=True)
            for row, ghost in enumerate(ghosts)
        ]
        played = list(zip(*(each.moments for each in (first, *ghosts)), strict=True))
        for drawing, moment in zip(drawings, played[0], strict=True):
            drawing.show(moment)
        recorded = server.get_scene_serializer()
        for before, now in pairwise(played):
            recorded.insert_sleep(now[0].elapsed - before[0].elapsed)
            for drawing, moment in zip(drawings, now, strict=True):
                drawing.show(moment)
        return recorded.serialize()


def viser_client() -> str:
    """Viser's client: one HTML file that fetches nothing."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text()
