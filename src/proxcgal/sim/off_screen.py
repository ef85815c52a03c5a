"""What MuJoCo draws with where there is no display."""

import ctypes
import sys

TOO_LATE = "mujoco" in sys.modules  #: MuJoCo has chosen already


def drawing_backend() -> str:
    """The first that this machine has; "disable" where nothing can draw."""
    for backend, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return backend
    return "disable"
