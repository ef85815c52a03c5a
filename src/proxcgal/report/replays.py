"""The 3D replays of a report: inside the page, started by a click, fetched from nowhere."""

import base64
import json
from collections.abc import Callable, Iterator, Sequence
from html import escape
from pathlib import Path

from proxcgal.core.errors import ProxError
from proxcgal.viewer.report_scene import replay_scene, still_scene, viser_client

REPLAY_BYTES = 6_000_000  # of the page, at most, for the scenes and their player
ORDER = ("wb", "wb_memory", "sm", "wb_known")  # the first that is there is drawn whole
_SHOWN = 2  # arms in one scene
#: Hands the scene to viser's client, in a frame of its own.
_SCRIPT = """
for (const button of document.querySelectorAll("button[data-scene]")) {
  button.addEventListener("click", () => {
    const player = JSON.parse(document.getElementById("player").textContent);
    const scene = document.getElementById(button.dataset.scene).textContent.trim();
    const data = "<script>window.__VISER_EMBED_DATA__=" + JSON.stringify(scene) +
      ";window.__VISER_EMBED_CONFIG__={darkMode:false};</" + "script>";
    const frame = document.createElement("iframe");
    frame.title = button.textContent;
    const end = player.indexOf("</head>");
    frame.srcdoc = player.slice(0, end) + data + player.slice(end);
    button.replaceWith(frame);
  });
}
"""


class Replays:
    """Collects the scenes of one page, as far as its bytes go."""

    def __init__(self) -> None:
        """None yet."""
        self._scenes: list[str] = []
        self._player = ""

    @property
    def used(self) -> int:
        """Bytes that the scenes and their player take of the page."""
        return sum(map(len, self._scenes)) + len(self._player)

    def of_runs(self, folder: Path, files: Sequence[Path] | None = None) -> str:
        """The figure of the recordings in a folder; a line that says why there is none.

        Args:
            folder: of a run.
            files: these recordings instead.
        """
        if files is None:
            there = [folder / f"{name}.mcap" for name in ORDER]
            files = [path for path in there if path.is_file()][:_SHOWN]
        if not files:
            return ""
        place, names = self._add(lambda: replay_scene(files))
        if not place.startswith("scene"):
            return f'<p class="soft">No 3D replay: {escape(place)}</p>'
        others = f" The see-through arm: {escape(', '.join(names[1:]))}." if names[1:] else ""
        return _figure(
            place,
            "play the run in 3D",
            f"The run as it was recorded ({escape(names[0])}), in real time; turn it with the "
            f"mouse. Red: the filtered cloud. Blue: points that were taken for the arm itself. "
            f"Yellow: sensors and their fields of view. Arrow: the pair that the avoidance acts "
            f"on.{others}",
        )

    def of_scene(self, name: str) -> str:
        """The figure of a built-in scene that stands still; nothing where there is none."""
        place, _ = self._add(lambda: (still_scene(name), ()))
        if not place.startswith("scene"):
            return ""
        return _figure(
            place,
            f"show {name} in 3D",
            f"{escape(name)}: the posture and the cloud that are timed. Red: the filtered cloud. "
            "Blue: points that were taken for the arm itself. Arrow: the closest pair.",
        )

    def parts(self) -> Iterator[str]:
        """What goes to the end of the page: player, scenes, and what brings them together."""
        if not self._scenes:
            return
        yield f'<script type="application/json" id="player">{self._player}</script>'
        for row, scene in enumerate(self._scenes):
            yield f'<script type="text/plain" id="scene{row}">{scene}</script>'
        yield f"<script>{_SCRIPT}</script>"

    def _add(
        self, make: Callable[[], tuple[bytes, tuple[str, ...]]]
    ) -> tuple[str, tuple[str, ...]]:
        """The scene's place in the page, `scene` and a number, or why it has none; its names."""
        try:
            scene, names = make()
        except ProxError as error:
            return str(error), ()
        data = base64.b64encode(scene).decode()
        if not self._player:
            # Nothing in it may end the element that it stands in.
            self._player = json.dumps(viser_client()).replace("<", "\\u003c")
        if self.used + len(data) > REPLAY_BYTES:
            return f"it would take {len(data) / 1e6:.1f} MB more than the page may have", ()
        self._scenes.append(data)
        return f"scene{len(self._scenes) - 1}", names


def _figure(place: str, label: str, caption: str) -> str:
    return (
        f'<figure class="replay"><button type="button" data-scene="{place}">{escape(label)}'
        f"</button><figcaption>{caption}</figcaption></figure>"
    )
