"""The controller as a node: joint states and scans in, joint velocities out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from proxcgal_msgs.msg import Proximity
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from proxcgal.core.errors import ConfigError
from proxcgal.core.modes import HOLD, NAMES, STOP
from proxcgal.models.mount_check import check_mounts
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.scenario.loading import change_scenario, load_scenario
from proxcgal.scenario.scenario import CONTROLLERS
from proxcgal.scenario.setup import Setup
from proxcgal.sim.assembly import MOUNT_CHECK_SCANS
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.tick import UNKNOWN, Tick, TickInput, TickResult
from proxcgal_ros import parameters, topics
from proxcgal_ros.action import MoveRobotAction
from proxcgal_ros.clocks import Clocks
from proxcgal_ros.convert import cloud_message, header, pose_message, proximity_message
from proxcgal_ros.display import Views, diagnostics, markers, pair_marker
from proxcgal_ros.live_goals import LiveGoals, Rules
from proxcgal_ros.pacing import CloudPace, Pace
from proxcgal_ros.source import RosSource

LIVE_CONTROLLERS = tuple(name for name in CONTROLLERS if name != "wb_known")
VIEWS_HZ = 2.0  # fields of view are many lines


class ControllerNode(Node):
    """One controller between the topics. Raises: ProxError, a line for all that does not fit."""

    def __init__(self, executor: Executor, running: Callable[[], bool]) -> None:
        """Reads the parameters, loads robot and skin, subscribes and publishes.

        Args:
            executor: that it will be spun by.
            running: false once it is to end.
        """
        super().__init__("proxcgal")
        name = parameters.fixed_text(
            self, "scenario", "front_plane",
            "robot, skin and controller: a built-in scenario's name or a path",
        )  # fmt: skip
        changes = parameters.fixed_texts(self, "set", "KEY=VALUE on the scenario")
        controller = parameters.fixed_text(self, "controller", "wb", " or ".join(LIVE_CONTROLLERS))
        if controller not in LIVE_CONTROLLERS:
            raise ConfigError(
                f"parameter controller = {controller!r}: must be {' or '.join(LIVE_CONTROLLERS)}"
            )
        self._name = controller
        limit = parameters.fixed_text(
            self, "limit", "full",
            "full, or papers: no approach caps and no retreat after the solver, for simulations",
        )  # fmt: skip
        if limit not in ("full", "papers"):
            raise ConfigError(f"parameter limit = {limit!r}: must be full or papers")
        if limit == "papers":
            self.get_logger().warning(
                "limit:=papers: only the joints' limits hold; next to people or a real arm: full"
            )
        # Whatever the scene says: its own is for the papers' figures.
        setup = Setup.of(load_scenario(name, [*changes, f"controller.limit={limit}"]))
        values = setup.scenario.controller.model_dump()
        numbers = parameters.declare_numbers(self, values)
        second = parameters.declare_second_goal(self)
        self.setup = self._tuned(setup, numbers)
        self.ctrl = self.setup.make_controller(controller)
        frame = parameters.fixed_text(self, "frame_id", "", "of the robot's base; empty: its name")
        self._frame = frame or topics.base_frame(setup.robot)
        self._clouds, self._told = CloudPace(numbers["cloud_hz"]), Pace(numbers["diagnostics_hz"])
        self._viewed = Pace(VIEWS_HZ)
        self._rules = Rules(
            numbers["position_tolerance"], numbers["angle_tolerance"], numbers["goal_timeout"],
            second == "preempt",
        )  # fmt: skip
        self._clocks = Clocks(self)
        self.goals = LiveGoals(setup.robot, self._frame, self._rules, self.ctrl.config.period)
        self.source = RosSource(self, executor, self.setup, self._clocks, self.goals, running)
        self._views = Views(setup.robot, setup.skin)
        self._sensors = [mount.name for mount in setup.skin.mounts]
        self._goal_told: object = None
        out = topics.RELIABLE_QOS
        keep = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._proximity = self.create_publisher(Proximity, topics.PROXIMITY, out)
        self._cloud = self.create_publisher(PointCloud2, topics.CLOUD, out)
        self._markers = self.create_publisher(MarkerArray, topics.MARKERS, out)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, out)
        self._goal = self.create_publisher(PoseStamped, topics.GOAL, keep)
        self.create_timer(0.5, self._tell_waiting)
        self._last: TickResult | None = None
        self._action = MoveRobotAction(self, self.goals)
        if parameters.fixed_switch(self, "reset_service", "offer ~/reset, which leaves a STOP"):
            self.create_service(Trigger, "~/reset", self._reset)
            self._rules.way_out = "call ~/reset once its cause is gone"
        else:
            self._rules.way_out = (
                "start the node anew; with reset_service:=true it offers ~/reset too"
            )
        self._look = parameters.fixed_switch(
            self, "check_mounts",
            "compare what sensors see of the arm itself with their mounts, standing still, before "
            "the first command; wrong ones end the node",
        )  # fmt: skip
        record = parameters.fixed_text(self, "record", "", "MCAP file for every tick; empty: none")
        self._recorder = Recorder(Path(record)) if record else None
        parameters.on_change(self, self._change)
        parameters.warn_unknown(self)
        self.get_logger().info(
            f"{setup.robot.name}, {len(setup.skin)} sensors, controller {controller}; waiting for "
            f"{', '.join(self.setup.robot.joint_names)} on {topics.JOINT_STATES}"
        )

    def run(self) -> None:
        """Tick after tick until the node is to end; then the arm is told to rest.

        Raises: ConfigError: sensors that do not sit where the skin says, before any tick.
        """
        if self._look:
            self._require_mounts()
        if self._recorder is not None:
            self._recorder.start(
                Settings(
                    scenario=self.setup.scenario, controller=self._name,
                    seed=self.setup.scenario.seed, meshes=self.setup.mesh_hashes(),
                )
            )  # fmt: skip
        mode = 0
        try:
            for inputs, result in run_ticks(self.source, self.ctrl):
                self._last = result
                self.goals.after(inputs, result)
                self._show(inputs, result)
                if self._recorder is not None:
                    self._recorder.write(Tick(inputs, result, UNKNOWN))
                if result.mode != mode:
                    self._tell_mode(mode, result)
                    mode = result.mode
        finally:
            self.goals.close()
            self._action.poll()
            if self._recorder is not None:
                self._recorder.close()

    def _require_mounts(self) -> None:
        q, scans = self.source.standing(MOUNT_CHECK_SCANS)
        if q is None:
            return
        checks = check_mounts(self.setup.robot, self.setup.skin, q, scans)
        if not checks:
            raise ConfigError(
                "\n".join(f"skin: {check}" for check in checks.wrong)
                + "\nsensors do not sit where the skin says, by what they see of the arm itself; "
                "mend their mounts, or leave the check out with check_mounts:=false"
            )
        self.get_logger().info(
            f"mounts: {checks.judged} of {len(checks.sensors)} sensors could be judged, none wrong"
        )

    def _show(self, inputs: TickInput, result: TickResult) -> None:
        """After the command has gone out: what others look at."""
        head = header(self.source.q_stamp_ns, self._frame)
        self._proximity.publish(proximity_message(result, head))
        if self._clouds.due_with(inputs.time, self.source.scan_stamps_ns):
            seen = header(self._clouds.newest_ns, self._frame)
            origins = np.asarray(self.ctrl.cloud_origins())
            self._cloud.publish(cloud_message(np.asarray(self.ctrl.cloud_W()), origins, seen))
            if self._markers.get_subscription_count():
                shown = [pair_marker(result, head)]
                if self._viewed.due(inputs.time):
                    shown.append(self._views.marker(inputs.q, head))
                self._markers.publish(markers(*shown))
        if self._told.due(inputs.time):
            self._diagnose(inputs.time)
        if inputs.goal is not self._goal_told:
            self._goal_told = inputs.goal
            self._goal.publish(pose_message(inputs.goal, head))

    def _diagnose(self, time: float) -> None:
        monitor = self.setup.scenario.controller.monitor
        self._diagnostics.publish(
            diagnostics(
                self.get_name(), self.setup.robot.name, self._last, self._sensors,
                self.ctrl.scan_ages(time), monitor.degraded_after, monitor.hold_after,
                header(self._clocks.now_ns(), ""),
            )
        )  # fmt: skip

    def _tell_waiting(self) -> None:
        """Diagnostics before the first joint state."""
        if self._last is None:
            self._diagnose(self._clocks.now())

    def _tell_mode(self, before: int, result: TickResult) -> None:
        reasons = ", ".join(sorted({found.reason for found in result.findings}))
        told = f"{NAMES[before]} -> {NAMES[result.mode]}" + (f": {reasons}" if reasons else "")
        log = self.get_logger()
        if result.mode >= HOLD:
            log.warning(told)
        else:
            log.info(told)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        response.success = bool(self.ctrl.reset())
        if response.success:
            response.message = "left STOP"
        elif self._last is None or self._last.mode != STOP:
            response.message = "not stopped"
        else:
            reasons = ", ".join(sorted({found.reason for found in self._last.findings}))
            response.message = f"still stopped, as the cause lasts: {reasons or 'unknown'}"
        return response

    def _tuned(self, setup: Setup, numbers: dict[str, float]) -> Setup:
        """The set-up with the tuning parameters as its scenario's own."""
        changes = [
            f"controller.{key}={value!r}" for key, value in numbers.items()
            if key in parameters.TUNING
        ]  # fmt: skip
        return replace(setup, scenario=change_scenario(setup.scenario, "parameters", changes))

    def _change(self, changed: dict[str, object]) -> None:
        """Takes on parameters. Raises: ConfigError, and nothing is changed then."""
        numbers = {key: value for key, value in changed.items() if isinstance(value, float)}
        tuning = {key: value for key, value in numbers.items() if key in parameters.TUNING}
        if tuning:
            setup = self._tuned(self.setup, tuning)
            self.ctrl.retune(setup.make_tasks())
            self.setup = setup
        for key, pace in (("cloud_hz", self._clouds), ("diagnostics_hz", self._told)):
            if key in numbers:
                pace.set(numbers[key])
        rules = self._rules
        rules.position_tolerance = numbers.get("position_tolerance", rules.position_tolerance)
        rules.angle_tolerance = numbers.get("angle_tolerance", rules.angle_tolerance)
        rules.timeout = numbers.get("goal_timeout", rules.timeout)
        if "second_goal" in changed:
            rules.preempt = changed["second_goal"] == "preempt"
