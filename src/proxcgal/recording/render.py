"""Pictures of a recorded run: the arm, what it senses, and the closest pair as an arrow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.recording.reader import Recording
from proxcgal.recording.replay import Replay
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.tick import Tick
from proxcgal.sim.world import Arrow, Camera, Color, Spheres, World

Picture = NDArray[np.uint8]

_FILTERED: Color = (0.80, 0.05, 0.10, 1.0)
_RAW: Color = (0.25, 0.45, 0.95, 0.55)
_PAIR: Color = (0.05, 0.60, 0.20, 1.0)
_AXES: tuple[Color, ...] = ((0.9, 0.1, 0.1, 1.0), (0.1, 0.7, 0.1, 1.0), (0.1, 0.2, 0.9, 1.0))
_GIF_COLORS = 128


@dataclass(frozen=True)
class RecordedMoment:
    """What one tick looked like from inside the controller."""

    tick: Tick
    clouds: Clouds
    elapsed: float  #: [s] of the run
    q: Array  #: (n_q,) where the arm was


def recorded_moments(
    recording: Recording, times: Sequence[float], controller: str | None = None
) -> list[RecordedMoment]:
    """What the controller held at each of these times.

    Args:
        recording: of a run.
        times: [s] in ascending order; each takes the first tick at or after it, or the last.
        controller: another one, given the same inputs: its pairs on the same postures.
    """
    if not recording.ticks:
        raise ConfigError(f"recording {recording.path}: has no ticks to draw")
    rows = np.searchsorted([tick.inputs.time for tick in recording.ticks], times)
    wanted = np.minimum(rows, len(recording.ticks) - 1).tolist()
    elapsed, postures = _elapsed(recording), list(recording.postures())
    taken = {
        row: RecordedMoment(tick, clouds, float(elapsed[row]), postures[row])
        for row, tick, clouds in _with_clouds(recording, controller, wanted)
    }
    return [taken[row] for row in wanted]


def _elapsed(recording: Recording) -> Array:
    """(n,) [s] of each tick in the run's own time, which a faulty clock does not change."""
    if recording.settings.ticks != "all":
        return recording.elapsed()
    hz = recording.settings.scenario.simulation.control_hz
    return np.arange(len(recording.ticks), dtype=np.float64) * (1.0 / hz)


def _with_clouds(
    recording: Recording, controller: str | None, rows: Sequence[int]
) -> Iterator[tuple[int, Tick, Clouds]]:
    """The ticks of these rows, as recorded, or computed again where the clouds are not recorded."""
    if controller is None and recording.has_clouds:
        for row in rows:
            clouds = recording.clouds(row)
            assert clouds is not None
            yield row, recording.ticks[row], clouds
        return
    replay = Replay(recording, controller)
    for row, tick in enumerate(replay):
        if row in rows:
            yield row, tick, Clouds.of(replay.ctrl)
        if row >= max(rows, default=-1):
            return


def draw(
    world: World,
    snapshot: RecordedMoment,
    size: tuple[int, int] = (640, 480),
    camera: Camera | None = None,
) -> Picture:
    """(height, width, 3) of one snapshot. Raises: SimulationError where nothing can draw."""
    world.place(snapshot.q, snapshot.elapsed)
    return world.picture(list(_marks(snapshot)), size, camera)


def write_gif(frames: Sequence[Image.Image], path: Path, fps: float) -> None:
    """One palette for all frames, no dithering: still pixels stay still, and the file small.

    Raises:
        ConfigError: the file cannot be written.
    """
    samples = [frames[round(at)] for at in np.linspace(0, len(frames) - 1, 6)]
    width, height = frames[0].size
    sheet = Image.new("RGB", (width, 7 * height))
    for place, sample in enumerate(samples):
        sheet.paste(sample, (0, place * height))
    # The marks are small: without a field of their own they would get no colour of the palette.
    for place, color in enumerate((_FILTERED, _RAW, _PAIR, *_AXES)):
        for shade in range(4):
            swatch = tuple(round((0.45 + 0.18 * shade) * 255.0 * part) for part in color[:3])
            box = (place * width // 6, 6 * height + shade * height // 4)
            sheet.paste(swatch, (*box, box[0] + width // 6, box[1] + height // 4))
    palette = sheet.quantize(_GIF_COLORS)
    plain = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    try:
        plain[0].save(
            path, save_all=True, append_images=plain[1:], duration=round(1000.0 / fps), loop=0,
            optimize=False,
        )  # fmt: skip
    except OSError as error:
        raise ConfigError(f"picture {path}: cannot be written: {error.strerror or error}") from None


def _marks(snapshot: RecordedMoment) -> Iterator[Spheres | Arrow]:
    result, goal = snapshot.tick.result, snapshot.tick.inputs.goal
    yield Spheres(snapshot.clouds.removed_W.astype(np.float64), 0.005, _RAW)
    yield Spheres(snapshot.clouds.kept_W.astype(np.float64), 0.008, _FILTERED)
    if result.control_W is not None and result.obstacle_W is not None:
        yield Arrow(np.array(result.control_W), np.array(result.obstacle_W), 0.012, _PAIR)
    for axis, color in enumerate(_AXES):
        yield Arrow(goal[:3, 3], goal[:3, 3] + 0.15 * goal[:3, axis], 0.008, color)
