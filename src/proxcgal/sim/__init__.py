"""The simulated world, sensors and arm, and the loop through the tick."""

import os
import sys

from proxcgal.sim.off_screen import drawing_backend

if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("MUJOCO_GL")):
    os.environ["MUJOCO_GL"] = drawing_backend()  # read once, by the import of MuJoCo
