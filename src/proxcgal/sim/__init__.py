"""The simulated world, sensors and arm, and the loop through the tick.

MuJoCo reads once, when it is imported, what it draws with off screen: that is chosen here, before
any module of this package imports it.
"""

from __future__ import annotations

import ctypes
import os
import sys


def _off_screen_library() -> str:
    """What to draw with where there is no display; "disable" where nothing can."""
    for backend, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return backend
    return "disable"


MUJOCO_CAME_FIRST = "mujoco" in sys.modules
if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("MUJOCO_GL")):
    os.environ["MUJOCO_GL"] = _off_screen_library()
