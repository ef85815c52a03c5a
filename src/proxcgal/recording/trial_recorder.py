"""Records a simulated run: every tick, and at the sensors' rate what pictures and Foxglove draw."""

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.sim.assembly import Assembly
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.tick import Tick


class TrialRecorder:
    """Writes one run into a recorder that its caller closes."""

    def __init__(self, recorder: Recorder, run: Assembly) -> None:
        """Writes what the run is made with."""
        self._recorder, self._ctrl = recorder, run.ctrl
        self._robot, self._scene = run.setup.robot, run.setup.scenario.drawn()
        self._hz = run.setup.scenario.simulation.sensor_hz
        self._beats = -1
        known = run.known
        recorder.start(
            Settings(
                scenario=run.setup.scenario.model_copy(update={"seed": run.seed}),
                controller=run.controller, seed=run.seed, meshes=run.setup.mesh_hashes(),
                known_points_W=known(0.0) if known is not None and known.still else None,
                ticks=recorder.ticks,
            )
        )  # fmt: skip

    def write(self, tick: Tick, elapsed: float, q: Array) -> None:
        """The tick that was made last.

        Args:
            tick: inputs, answer and truth.
            elapsed: of the run [s].
            q: (n_q,) where the arm is drawn: where it really is, whatever a fault reports.
        """
        beats = int(np.floor(elapsed * self._hz + 1e-9))  # those of the scans
        beat = beats > self._beats
        if beat:
            self._beats = beats
            time = tick.inputs.time
            if beats == 0 or not self._scene.still:
                self._recorder.show_scene(time, self._scene, elapsed)
            self._recorder.show(
                time, Clouds.of(self._ctrl), self._robot.link_names,
                np.asarray(self._robot.link_poses(q)),
                (tick.result.control_W, tick.result.obstacle_W),
            )  # fmt: skip
        if beat or tick.inputs.scans or self._recorder.ticks == "all":
            self._recorder.write(tick)
