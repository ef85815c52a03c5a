"""docs/reliability.md, written from a campaign's summary: every row and what showed it."""

from dataclasses import dataclass
from typing import Any

from proxcgal.core.modes import RUN
from proxcgal.core.tables import counted
from proxcgal.study.faults.cases import Row

_CONTROLLER = "cpp/tests/control/test_controller.cpp"
_STALENESS = "cpp/tests/perception/test_staleness.cpp"
_CONTACT = "cpp/tests/control/test_contact.cpp"
_CLOCK = "cpp/tests/perception/test_clock.cpp"
_REMEMBERING = "cpp/tests/perception/test_remembering.cpp"
_MISBEHAVIOUR = "cpp/tests/control/test_misbehaviour.cpp"
_LIMIT_ROWS = "cpp/tests/pipeline/test_limit_rows.cpp"
_MESH = "cpp/tests/geometry/test_mesh_tree.cpp"
_PIPELINE = "cpp/tests/pipeline/test_pipeline.cpp"
_FUZZ = "cpp/tests/test_fuzz.cpp"
_SERVER = "tests/server/test_joint_server.py"
_RECORDING = "tests/recording/test_recording.py"
_PAGE = "tests/viewer/test_interactive.py"
_GATE = "tests/viewer/test_access.py"
_SOLVE_PY = "tests/pipeline/test_solve.py"
_SERVE = "tests/server/test_serve.py"


@dataclass(frozen=True, slots=True)
class Shown:
    """One thing that goes wrong, what must happen, and which tests show it."""

    fault: str
    required: str
    tests: tuple[tuple[str, str], ...]  # file, name


@dataclass(frozen=True, slots=True)
class Aim:
    """One of the goals, with its short form and what runs the long one."""

    goal: str
    tests: tuple[tuple[str, str], ...]
    long: str  # command
    gave: str = ""  # by the long form, the last time that it ran


SHOWN: tuple[Shown, ...] = (
    Shown("a silent sensor's sector", "at most 0.25 m/s into it, none from 0.19 s on, then HOLD",
          ((_STALENESS, "MotionIntoWhatASilentSensorSawIsHeld"),)),
    Shown("every status code and range that is none", "invalid, counted; neither contact nor free",
          ((_PIPELINE, "OnlyTrustedZonesInRangeBecomePoints"),
           ("tests/study/test_faults.py", "test_every_status_code_is_judged_as_the_table_has_it"),
           (_CONTROLLER, "WhatNoZoneTellsIsUnknownNotFree"))),
    Shown("duplicate, older, future and very old scans", "refused and told",
          ((_STALENESS, "ARepeatedOrOlderScanIsRefused"),
           (_STALENESS, "AScanOfLongAgoIsRefused"))),
    Shown("clock jump of an hour either way", "the same commands",
          ((_CLOCK, "AClockThatJumpsAnHourChangesNoCommand"),)),
    Shown("mount 5 mm or 2 degrees wrong", "found where enough of the body is in view, in those "
          "directions that show; the run is refused",
          (("tests/models/test_mount_check.py",
            "test_5_mm_or_2_degrees_are_found_wherever_the_check_says_that_it_can"),
           ("tests/models/test_mount_check.py", "test_noise_alone_makes_no_mount_wrong"),
           ("tests/models/test_mount_check.py", "test_a_sensor_that_sees_no_body_is_not_judged"),
           ("tests/models/test_mount_check.py",
            "test_the_command_refuses_with_exit_code_2_and_writes_nothing"),
           (_MISBEHAVIOUR, "WhereMountsAreAwaitedTheArmHoldsUntilTheyAreAccepted"))),
    Shown("cloud 100 times as large, or at a link's middle", "bounded steps; then a lower bound, "
          "marked, DEGRADED",
          ((_PIPELINE, "WithFewStepsTheDistanceIsALowerBoundAndMarked"),
           (_PIPELINE, "TheCentreOfASphereTakesNoMoreThanItsSteps"))),
    Shown("mesh with NaN, no faces, bad indices, no area, 10^7 faces", "an error with file and "
          "face; faces without area left out and counted; the limit names itself",
          ((_MESH, "RefusesWhatNoIndexCanBeBuiltFrom"),
           (_MESH, "FacesWithoutAreaAreLeftOutAndCounted"),
           ("tests/models/test_mesh_files.py", "huge.stl"))),
    Shown("URDF with a cycle, two parents, orphans, no such mesh, paths outside, entities, "
          "depth 200 000", "refused with the names, under 1 s and 256 MB",
          (("tests/models/test_urdf.py", "test_refused_with_the_file_and_the_names"),
           ("tests/models/test_urdf.py", "test_mesh_paths_stay_within_their_folders"),
           ("tests/models/test_urdf.py",
            "test_hostile_depth_and_size_are_refused_at_little_cost"))),
    Shown("joint state not a number", "STOP within the tick, latched",
          ((_STALENESS, "ANanJointStateStopsWithinOneCycleAndStaysStopped"),)),
    Shown("joint state old", "HOLD after 20 ms, STOP after 100 ms",
          ((_STALENESS, "AnOldJointStateHoldsAndAtLastStops"),)),
    Shown("avoidance not executed inside d_min, or pinched between two things",
          "reported; lower levels yield, what can be executed is; never a stop",
          ((_MISBEHAVIOUR,
            "AnArmBetweenTwoPointsOfOneLinkIsReportedAsPinchedAndStuckAndNeverHeld"),
           (_LIMIT_ROWS, "BetweenTwoPlatesTheArmStandsWithoutALimitCycle"))),
    Shown("late ticks: jitter, always 1.5 or 2 times the period", "no joint passes a limit",
          ((_LIMIT_ROWS, "KeepsEveryJointInsideItsLimitsUnderLateTicks"),)),
    Shown("goal that is no pose, with an obstacle near",
          "HOLD: the nominal motion stops, retreat goes on",
          ((_CONTACT, "AGoalThatIsNoPoseStopsTheNominalMotionAndNeverTheRetreat"),)),
    Shown("start outside joint limits", "only inward",
          ((_MISBEHAVIOUR, "OutsideItsLimitsAJointOnlyMovesInward"),
           (_LIMIT_ROWS, "LetsAJointOutsideItsLimitsMoveInwardsOnly"))),
    Shown("singularity", "joint speed bounded and continuous",
          ((_MISBEHAVIOUR, "ASingularPostureKeepsJointSpeedsBoundedAndContinuous"),)),
    Shown("conflicting tasks", "the safety level's residual stays best, the others' are told",
          ((_MISBEHAVIOUR,
            "AgainstAConflictingGoalTheSafetyLevelKeepsItsBestAndBothTellWhatIsMissing"),
           ("cpp/tests/pipeline/test_solve.cpp", "TheFirstLevelKeepsItsOptimumAboveAnyOther"))),
    Shown("obstacle at the surface, inside it, or taken for body", "kept until seen outside; every "
          "command leads out",
          ((_CONTACT, "AnObstacleThatTouchesIsNotTakenForBody"),
           (_CONTACT, "FromContactAndFromInsideEveryCommandLeadsOut"),
           (_CONTACT, "InsideTheLeastDistanceNothingComesNearer"))),
    Shown("a stuck payload", "suspect however far it sees; what it shows inside d_min ends with "
          "its fault, what is remembered from before stays, and it clears nothing",
          ((_STALENESS, "TheSamePayloadAgainAndAgainIsSuspect"),
           (_MISBEHAVIOUR, "AStuckPayloadDoesNotOutliveItsFaultAsAContact"),
           (_REMEMBERING, "AStuckPayloadClearsNothingAndIsNotRememberedOnceItEnds"),
           (_REMEMBERING,
            "WhatIsRememberedInsideTheLeastDistanceStaysThoughItsSensorIsStuckSince"))),
    Shown("closest point jumps between links", "acceleration limits hold; a switch at once only by "
          "10 mm or inside d_min, else one per 100 ms",
          ((_MISBEHAVIOUR, "CommandsStayContinuousWhereTheClosestPointJumps"),)),
    Shown("killed while recording", "every acknowledged record is read",
          ((_RECORDING, "test_20_killed_writers_lose_no_acknowledged_tick"),)),
    Shown("disk full", "control as it was; told at that tick",
          (("tests/trial/test_trial.py", "test_a_full_disk_changes_no_command_and_is_told"),
           (_RECORDING,
            "test_no_more_room_on_the_way_is_told_at_that_tick_and_what_was_written_is_read"))),
    Shown("file cut or flipped anywhere", "all up to the damage is read, and where it is told",
          ((_RECORDING, "test_a_file_cut_anywhere_gives_all_ticks_before_the_cut"),
           (_RECORDING,
            "test_a_flipped_byte_anywhere_is_told_and_costs_nothing_before_it"))),
    Shown("simulator warns or diverges", "the run fails",
          (("tests/sim/test_world.py", "test_a_warning_of_mujoco_fails_the_run"),
           ("tests/sim/test_world.py", "test_an_arm_without_finite_pose_is_an_error"))),
    Shown("hostile bytes in any input", "errors with a name only; no command outside the limits",
          ((_FUZZ, "TwentyThousandRandomTicksKeepEveryPromise"),
           ("tests/test_fuzz.py", "test_broken_files_raise_errors_of_ours_only"))),
    Shown("hostile client of the live page", "loopback by default, a token beyond; sizes, counts, "
          "rates and values bounded; no message leads out of a STOP",
          ((_GATE,
            "test_without_the_token_neither_page_nor_connection_is_given"),
           (_GATE, "test_pages_of_other_sites_are_refused"),
           (_GATE, "test_a_message_that_no_page_needs_is_dropped"),
           (_GATE, "test_a_value_outside_of_its_control_is_dropped"),
           (_GATE, "test_a_flood_ends_its_connection_and_no_other"),
           (_GATE, "test_a_viewer_that_vanishes_leaves_nothing_behind"),
           (_PAGE, "test_nothing_that_a_page_says_leads_out_of_a_stop"))),
    Shown("goal of the 12-joint server preempted, cancelled, held off, or two at once",
          "exactly one end: succeeded, aborted or cancelled, with its reason",
          ((_SERVER, "test_a_goal_is_reached_and_its_feedback_says_how_it_goes"),
           (_SERVER, "test_a_goal_held_off_by_an_obstacle_is_aborted_with_what_holds_it"),
           (_SERVER, "test_cancel_brakes_within_the_acceleration_limits"),
           (_SERVER, "test_a_second_goal_preempts_or_is_refused_as_set"),
           (_SERVER, "test_a_goal_ends_when_the_thread_that_makes_the_ticks_fails"),
           (_SERVE, "test_a_goal_ends_when_its_client_is_gone"))),
    Shown("hostile client of the 12-joint server", "loopback by default; sizes, counts and rates "
          "bounded; nonsense is answered and moves nothing; no message leads out of a STOP",
          ((_SERVE, "test_only_loopback_is_listened_on_unless_asked_for"),
           (_SERVE, "test_nonsense_is_answered_and_moves_nothing"),
           (_SERVE, "test_a_message_without_end_is_cut_off"),
           (_SERVE, "test_a_flood_is_cut_off_and_the_others_go_on"),
           (_SERVE, "test_clients_beyond_the_bound_are_turned_away"),
           (_SERVER,
            "test_a_stop_outlives_a_change_of_tasks_and_a_goal_that_waits_to_begin"))),
)  # fmt: skip

GOAL_RUNS = 200  # of each row: with fewer a page says nothing of the goals
_LONG_CPP = "`./run test --long`"
GOALS: tuple[Aim, ...] = (
    Aim("1. 10^6 fuzzed frames", ((_FUZZ, "TwentyThousandRandomTicksKeepEveryPromise"),),
        f"{_LONG_CPP}; `./run fuzz MINUTES tick`", "no promise broken"),
    Aim("2. every row, 200 seeds, two robots",
        (("tests/study/test_faults.py", "test_the_mode_is_right_in_time_and_the_arm_recovers"),),
        "`proxcgal campaign faults --runs 200`",
        "as many seeds as the table above has"),
    Aim("3. no allocation in 10^6 ticks; p99.9; adversarial clouds",
        ((_CONTROLLER, "TickAllocatesNothing"),), f"{_LONG_CPP}; `./run bench`",
        "no allocation; times: benchmarks.md"),
    Aim("4. solver against an independent one, 10^5 stacks",
        ((_SOLVE_PY, "test_agrees_with_the_formulas_on_random_stacks"),), _LONG_CPP,
        "as the formulas, within rounding; the first level at its optimum"),
    Aim("5. 10^6 point and ray queries", ((_MESH, "NearestAgreesWithCgal"),
                                           (_MESH, "FirstHitAgreesWithCgal")), _LONG_CPP,
        "within 1e-9 m"),
    Aim("6. 1000 kills; a log cut at every byte",
        ((_RECORDING, "test_20_killed_writers_lose_no_acknowledged_tick"),
          (_RECORDING, "test_a_file_cut_anywhere_gives_all_ticks_before_the_cut")),
        _LONG_CPP,
        "1000 kills: no acknowledged tick lost; cut at every byte: all ticks before it read"),
    Aim("7. replays bit-identical",
        (("tests/trial/test_trial.py",
           "test_a_replay_gives_every_recorded_answer_again_bit_for_bit"),), _LONG_CPP,
        "every answer, to the bit"),
    Aim("8. ASan, UBSan, TSan clean, with and without NDEBUG",
        ((_FUZZ, "TwentyThousandRandomTicksKeepEveryPromise"),),
        "`./run check --asan-ubsan`, `--tsan`; CI: `./run check --asan-ubsan --short`",
        "clean, with and without assertions"),
    Aim("9. outward recovery", ((_CONTACT, "FromContactAndFromInsideEveryCommandLeadsOut"),),
        _LONG_CPP,
        "each of 16118 commands leads out; after 1 ms 16 were nearer, by up to 0.1 mm, to another "
        "face of the mesh"),
)  # fmt: skip

_HEAD = """\
# Reliability: what goes wrong, what happens then, and how it was shown

These are engineering figures from tests and simulation, not a certificate: no performance level and
no SIL is claimed anywhere.

Modes: RUN, DEGRADED (slower), HOLD (brakes within limits and stays), STOP (latched until a
deliberate reset). What is not seen is unknown, never free. Findings and their modes:
docs/conventions.md. `proxcgal campaign faults` writes this page into its
folder, with the figures of that campaign.

## Faults in running trials

Every fault is put in while the arm moves among panel, walls and cabinet, at a random moment and a
random sensor; the `[[fault]]` tables of docs/scenarios.md do the same in any scenario.
A run is right when the required mode comes in time and no farther one, the finding is
told, the arm is free again 0.7 s after the fault, and, where no command may change, the
commands are those of the run without the fault, to the bit. Latency is from the fault's onset, told
at the next tick: it may pass its bound by a tick of 10 ms. Robots meet the same draws, run by run:
where the onset and the sensors' rate alone decide, their latencies are the same.
"""


def reliability_page(
    rows: tuple[Row, ...], summary: dict[str, Any], required: dict[str, str]
) -> str:
    """The whole page.

    Args:
        rows: of the campaign, in order.
        summary: of a faults campaign.
        required: mode that each row asks for, by name.
    """
    robots, runs_a_row = summary["robots"], summary.get("runs", 0)
    runs = sum(found["runs"] for own in robots.values() for found in own.values())
    lines = [
        _HEAD,
        f"{summary['right']} of {runs} runs were right: "
        + "; ".join(f"{len(own)} rows on {robot}" for robot, own in robots.items())
        + f", seeds from {summary.get('seed', 0)} on, {counted(runs_a_row, 'run')} a row.\n",
    ]
    if failed := len(summary.get("failed", ())):
        lines.append(f"{failed} more runs did not come to their end and are not counted.\n")
    lines += [
        "| fault | required | bound ms | robot | right | median ms | worst ms | farthest |",
        "|---|---|---|---|---|---|---|---|",
        *(
            _line(row, required[row.name], robot, own[row.name])
            for row in rows
            for robot, own in robots.items()
            if row.name in own
        ),
        "", _LIMITS, "## Shown by tests", "", "| what goes wrong | what happens | shown by |",
        "|---|---|---|",
        *(f"| {s.fault} | {s.required} | {_tests(s.tests)} |" for s in SHOWN),
        "",
    ]  # fmt: skip
    if runs_a_row < GOAL_RUNS:
        lines.append(
            "What the long tests gave on the state that is published is in docs/reliability.md, "
            f"which takes {GOAL_RUNS} runs a row; here: {runs_a_row}.\n"
        )
    else:
        lines += [
            "## Goals", "", "| goal | short form, in the tests | long form | it gave |",
            "|---|---|---|---|",
            *(f"| {g.goal} | {_tests(g.tests)} | {g.long} | {g.gave or '-'} |" for g in GOALS),
            _END,
        ]  # fmt: skip
    return "\n".join(lines)


def _line(row: Row, required: str, robot: str, found: dict[str, Any]) -> str:
    bound = f"{1000 * row.within:.0f}" if row.least > RUN and not row.refused else "-"
    modes = ", ".join(f"{mode} {n}" for mode, n in found["worst_modes"].items())
    return (
        f"| {row.name} | {required} | {bound} | {robot} | {found['right']} of {found['runs']} | "
        f"{whole_ms(found['latency_median_ms'])} | {whole_ms(found['latency_max_ms'])} | {modes} |"
    )


_LIMITS = """\
A mount can be judged only by a sensor that sees enough of the arm, and only in directions that
change what it sees: a shift along a flat shell shows nothing. The rows above hit sensors and
directions that the check itself calls visible at the scene's start; on the UR10e's forearm rings
that is 4 or 5 of 30 sensors. An offset of a sensor's ranges counts as a shift along its view, and
what is held within 60 mm before the body may be taken for a wrong mount.

Where stamps are off, a run is wrong too if a point of the arm itself leaks while avoidance acts. A
noisy self-hit beyond 4 sigma does so in one of some hundred runs, fault or none: drop `fault=` from
the printed command to see it. `filter.confirmation` ends it, for a scan of delay.
"""
_END = """
Where a goal's last column is empty, its long form did not run to its end on this state of the
code. Times of ticks and clouds: docs/benchmarks.md.
"""


def _tests(tests: tuple[tuple[str, str], ...]) -> str:
    return ", ".join(f"`{file}` {name}" for file, name in tests)


def whole_ms(value: float | None) -> str:
    """A time for people [ms]; a dash where there is none."""
    return "-" if value is None else f"{value:.0f}"
