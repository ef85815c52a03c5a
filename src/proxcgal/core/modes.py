"""Modes of the monitor, as recordings and tables number them."""

from proxcgal._core import Mode

RUN, DEGRADED, HOLD, STOP = (
    int(mode.value) for mode in (Mode.RUN, Mode.DEGRADED, Mode.HOLD, Mode.STOP)
)
NAMES = ("RUN", "DEGRADED", "HOLD", "STOP")  #: by number
