"""The faults that a campaign puts in, row by row, and what must happen then."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from proxcgal.core.modes import DEGRADED, HOLD, RUN, STOP

SENSORS = 10  # of the array that a fault hits
TICK_MS = 10  # a fault is answered at the next tick

Fault = dict[str, object]  # a `[[fault]]` table, but for its times


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One fault and the required behaviour."""

    name: str
    faults: Callable[[int], Sequence[Fault]]  # of the sensor that is hit
    least: int  # mode that must be reached
    most: int  # mode that must not be exceeded
    within: float  # [s] from the fault's onset
    finding: str = ""  # that must be reported
    same_commands: bool = False  # as without the fault, to the bit
    duration: float = 0.6  # [s] of the fault
    settings: Sequence[str] = ()  # of the scenario, beside the campaign's own
    no_flight: bool = False  # the arm never avoids itself
    refused: bool = False  # the run must not begin, for that very sensor


def _fault(kind: str, sensor: int | str, value: float | None = None) -> Fault:
    return {"kind": kind, "sensor": sensor} | ({} if value is None else {"value": value})


def one(kind: str, value: float | None = None) -> Callable[[int], Sequence[Fault]]:
    """A fault of one sensor."""
    return lambda sensor: [_fault(kind, sensor, value)]


def array(kind: str) -> Callable[[int], Sequence[Fault]]:
    """The same fault of every sensor of the array that the sensor belongs to."""
    return lambda sensor: [
        _fault(kind, sensor - sensor % SENSORS + place) for place in range(SENSORS)
    ]


def every(kind: str, value: float | None = None) -> Callable[[int], Sequence[Fault]]:
    """The fault of all sensors, or of an input that has none."""
    return lambda _: [_fault(kind, "all", value)]


#: A silent sensor degrades; where the arm moves into what it covered, it holds.
_BLIND = {"least": DEGRADED, "most": HOLD, "within": 0.15, "finding": "sensor_silent"}

_FAST = ("controller.max_linear=1.0", "controller.max_angular=2.0", "controller.reach_gain=4.0")

ROWS: tuple[Row, ...] = (
    Row(name="sensor silent", faults=one("silent"), **_BLIND),  # type: ignore[arg-type]
    Row(name="array silent", faults=array("silent"), least=HOLD, most=HOLD, within=0.2,
        finding="array_silent"),
    Row(name="all silent", faults=every("silent"), least=HOLD, most=HOLD, within=0.2,
        finding="all_sensors_silent"),
    Row(name="frozen frames", faults=one("frozen"), **_BLIND),  # type: ignore[arg-type]
    # Five scans of 15 Hz, and the one that is repeated.
    Row(name="same payload", faults=one("stuck_payload"), least=DEGRADED, most=HOLD, within=0.45,
        finding="sensor_suspect"),
    *(
        Row(name=f"range {kind}", faults=one(kind), **_BLIND)  # type: ignore[arg-type]
        for kind in ("nan", "infinite", "negative", "zero")
    ),
    Row(name="status 4", faults=one("status", 4.0), **_BLIND),  # type: ignore[arg-type]
    Row(name="status 200 (unknown)", faults=one("status", 200.0), **_BLIND),  # type: ignore[arg-type]
    Row(name="status 6", faults=one("status", 6.0), least=RUN, most=RUN, within=0.0),
    Row(name="status 9", faults=one("status", 9.0), least=RUN, most=RUN, within=0.0),
    Row(name="status 255 (no target)", faults=one("status", 255.0), least=RUN, most=RUN,
        within=0.0),
    Row(name="half of the zones lost", faults=one("dropout", 0.5), least=RUN, most=RUN,
        within=0.0),
    Row(name="empty cloud", faults=every("status", 255.0), least=RUN, most=RUN, within=0.0),
    Row(name="scans out of order", faults=one("swapped"), least=RUN, most=DEGRADED, within=0.0,
        finding="scan_refused"),
    Row(name="scans twice", faults=one("duplicate"), least=RUN, most=RUN, within=0.0,
        finding="scan_refused", same_commands=True),
    Row(name="stamps of the future", faults=one("stamp_offset", 1.0), **_BLIND),  # type: ignore[arg-type]
    Row(name="stamps of long ago", faults=one("stamp_offset", -1.0), **_BLIND),  # type: ignore[arg-type]
    Row(name="stamps 30 ms late", faults=one("stamp_offset", -0.03), least=RUN, most=RUN,
        within=0.0, no_flight=True),
    Row(name="all stamps 30 ms late, fast", faults=every("stamp_offset", -0.03), least=RUN,
        most=RUN, within=0.0, no_flight=True, settings=_FAST),
    # From the future: refused, so that the array is silent.
    Row(name="stamps 30 ms early", faults=one("stamp_offset", 0.03), **_BLIND),  # type: ignore[arg-type]
    Row(name="all stamps 30 ms early, fast", faults=every("stamp_offset", 0.03), least=HOLD,
        most=HOLD, within=0.2, finding="all_sensors_silent", settings=_FAST),
    Row(name="scans arrive 0.3 s late", faults=one("delay", 0.3), **_BLIND),  # type: ignore[arg-type]
    Row(name="clock an hour ahead", faults=every("clock_jump", 3600.0), least=RUN, most=RUN,
        within=0.0, finding="time_invalid", same_commands=True),
    Row(name="clock an hour back", faults=every("clock_jump", -3600.0), least=RUN, most=RUN,
        within=0.0, finding="time_invalid", same_commands=True),
    Row(name="joint state 50 ms old", faults=every("joints_old", 0.05), least=HOLD, most=HOLD,
        within=0.02, finding="joint_state_stale"),
    Row(name="joint state 150 ms old", faults=every("joints_old", 0.15), least=STOP, most=STOP,
        within=0.02, finding="joint_state_lost"),
    Row(name="joint state not a number", faults=every("joints_nan"), least=STOP, most=STOP,
        within=0.0, finding="joint_state_invalid", duration=0.01),
    Row(name="one deadline missed", faults=every("late"), least=RUN, most=RUN, within=0.0,
        finding="deadline_missed", duration=0.01),
    Row(name="deadlines missed", faults=every("late"), least=HOLD, most=HOLD, within=0.04,
        finding="deadlines_missed"),
    Row(name="mount 5 mm off", faults=one("mount_offset"), least=RUN, most=RUN, within=0.0,
        refused=True),
    Row(name="mount 2 degrees off", faults=one("mount_turn"), least=RUN, most=RUN, within=0.0,
        refused=True),
)  # fmt: skip
ROW_OF = {row.name: row for row in ROWS}
