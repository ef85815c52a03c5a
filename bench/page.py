"""What the live page costs, and how fluent it is: `./run bench --page`.

A UR10e (7 links) with 40 sensors in a room, about 2000 points at 15 Hz, in a real Chromium that
renders in software into 640 x 400 pixels, and the same simulation with nobody looking on. The two
take turns, so that a busy machine burdens both alike.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time as clock
from pathlib import Path

import numpy as np
import viser

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browser import chromium, until

from proxcgal.core.provenance import machine
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.viewer.live_page import LivePage
from proxcgal.viewer.messages import Update
from proxcgal.viewer.page_server import close, serve
from proxcgal.viewer.simulation import FRAME_HZ, run_simulation

CANVAS = (640, 400)  # [px]
PANEL = 340  # [px] that the controls take beside it
LEAST_FPS = 8.0
MOST_CPU = 0.05  # share that a tick may take more with the page
RINGS = (0.2, 0.4, 0.6, 0.8)


def scenario() -> Scenario:
    room = load_scenario("timing_ur10e", ["vertices_per_link=1000"])
    ring = room.skin.rings[0].model_copy(update={"at": RINGS, "sensors": 10})
    return room.model_copy(update={"skin": room.skin.model_copy(update={"rings": (ring,)})})


def alone(scene: Scenario, seconds: float) -> Update:
    """The simulation in its process, asked once, at the end."""
    context = multiprocessing.get_context("spawn")
    link, theirs = context.Pipe()
    process = context.Process(target=run_simulation, args=(theirs, scene, "wb", 1.0), daemon=True)
    process.start()
    theirs.close()
    while (update := link.recv()).model is None:
        assert not update.failed, update.failed
    clock.sleep(seconds)
    while link.poll():
        link.recv()
    link.send(None)
    update = link.recv()
    link.close()
    process.join()
    return update


def served(scene: Scenario, seconds: float) -> Update:
    """The same with the page drawn, and nobody looking on."""
    server, access = serve("127.0.0.1", 0, label="bench")
    page = LivePage(server, access, scene, "wb")
    try:
        assert until(lambda: page.last.moment is not None, 120.0)
        clock.sleep(seconds)
        return page.last
    finally:
        page.close()
        close(server)


def looked_at(scene: Scenario, seconds: float) -> tuple[Update, dict[str, float]]:
    """The same with the page open in a browser on the same machine."""
    server, access = serve("127.0.0.1", 0, label="bench")
    page = LivePage(server, access, scene, "wb")
    try:
        with chromium(CANVAS[0] + PANEL, CANVAS[1]) as open_tab:
            tab = open_tab()
            tab.open(f"http://127.0.0.1:{server.get_port()}/")
            assert until(lambda: len(server.get_clients()) == 1, 120.0)
            assert until(lambda: page.last.moment is not None, 120.0)
            box = tab.page.locator("canvas").first.bounding_box()
            clock.sleep(0.5 * seconds)
            drawn, since = page.drawn, clock.monotonic()
            fps = tab.frames_per_second(0.5 * seconds)
            moments = (page.drawn - drawn) / (clock.monotonic() - since)
        assert page.last.moment is not None
        points = len(page.last.moment.kept_W) + len(page.last.moment.removed_W)
        return page.last, {
            "fps": fps, "moments_per_s": moments, "points": points,
            "links": len(page.last.moment.links_W), "width": box["width"], "height": box["height"],
        }  # fmt: skip
    finally:
        page.close()
        close(server)


def figures(update: Update) -> dict[str, float]:
    return {
        "tick_cpu_us": update.cpu_us, "late_median_us": update.late_us[0],
        "late_p99_us": update.late_us[1], "real_time": update.real_time,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=12.0, help="of each measurement")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("out/bench/page.json"))
    options = parser.parse_args()
    scene = scenario()
    without, unseen, beside, seen = [], [], [], []
    for _ in range(options.repeats):
        without.append(figures(alone(scene, options.seconds)))
        unseen.append(figures(served(scene, options.seconds)))
        update, page = looked_at(scene, options.seconds)
        beside.append(figures(update))
        seen.append(page)
    middle = {
        name: {key: float(np.median([row[key] for row in rows])) for key in rows[0]}
        for name, rows in (
            ("without", without),
            ("served", unseen),
            ("with", beside),
            ("page", seen),
        )
    }
    more = middle["with"]["tick_cpu_us"] / middle["without"]["tick_cpu_us"] - 1.0
    only_served = middle["served"]["tick_cpu_us"] / middle["without"]["tick_cpu_us"] - 1.0
    result = {
        "machine": machine(), "viser": viser.__version__, "offered_hz": FRAME_HZ,
        "tick_cpu_more": more, "tick_cpu_more_served": only_served, **middle,
        "repeats": {"without": without, "served": unseen, "with": beside, "page": seen},
    }  # fmt: skip
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(result, indent=1) + "\n")
    page = middle["page"]
    print(f"{result['machine']}; medians of {options.repeats} runs of {options.seconds:g} s each")
    print(
        f"page: {page['fps']:.1f} frames a second (at least {LEAST_FPS:g}) at "
        f"{page['width']:.0f} x {page['height']:.0f}, {page['links']:.0f} links, "
        f"{page['points']:.0f} points; {page['moments_per_s']:.1f} of {FRAME_HZ:g} moments a "
        "second drawn"
    )
    for name, label in (
        ("without", "no page"),
        ("served", "served, nobody looks on"),
        ("with", "in a browser on the same machine"),
    ):
        row = middle[name]
        print(
            f"{label}: tick {row['tick_cpu_us']:.1f} us of thread CPU, wake-up late by "
            f"{row['late_median_us']:.0f} us (median), {row['late_p99_us']:.0f} us (p99), "
            f"{100 * row['real_time']:.0f} % of real time"
        )
    print(
        f"a tick takes {100 * more:+.1f} % with the page open (at most {100 * MOST_CPU:+.0f} %), "
        f"{100 * only_served:+.1f} % where it is served alone"
    )
    print(options.out)
    return int(page["fps"] < LEAST_FPS or more > MOST_CPU)


if __name__ == "__main__":
    sys.exit(main())
