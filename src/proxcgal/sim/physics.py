"""An arm with weight, drives and brakes: MuJoCo steps it, so that a stop is simulated, not assumed.

The drives follow velocity commands by computed torque, with a model that is a little wrong; once
the torque is off, brakes close as dry friction in the joints, after the time that theirs take.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from proxcgal.core.errors import ConfigError, SimulationError
from proxcgal.core.typing import Array
from proxcgal.models.formats.capsule_robot import CapsuleRobot
from proxcgal.scenario.walkthrough_keys import HumanKeys

#: Stiff, so that a held arm does not creep: MuJoCo's own friction gives way by a hundredth of the
#: load's acceleration, which would be 0.3 deg/s here.
_FRICTION_SOLREF = (0.004, 1.0)
_FRICTION_SOLIMP = (0.999, 0.9999, 0.001, 0.5, 2.0)
#: How the drives follow their commands. Ours: what industrial drives do.
_DRIVE_FREQUENCY = 30.0  # [rad/s] of position errors, critically damped
_MODEL_MASS, _MODEL_WEIGHT = 0.95, 0.97  # of the true ones, in the model of the drives
_HUMAN = "human"
_FAR = 10.0  # [m] distances are looked for up to here


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardTruth:
    """What holds at one moment."""

    tcp_speed: float  #: [m/s]
    distance: float  #: [m] least over the pairs
    velocity: float  #: [m/s] relative, most over the ends


class Physics:
    """One arm of capsules with masses."""

    def __init__(
        self,
        robot: CapsuleRobot,
        q0: Array,
        *,
        period: float = 0.001,
        payload: float = 0.0,
        brake_scale: float = 1.0,
        human: HumanKeys | None = None,
    ) -> None:
        """The arm at rest, its brakes closed.

        Args:
            robot: every link with a mass, every joint with a brake.
            q0: (n_q,) [rad].
            period: [s] of one step.
            payload: [kg] more, at the tool's origin.
            brake_scale: of the brakes' torques.
            human: the operator's capsule; left out: the defaults.

        Raises:
            ConfigError: a link without mass, a joint without brake.
            SimulationError: MuJoCo refuses the arm.
        """
        without = [link.name for link in robot.links if link.mass is None]
        without += [f"{link.joint} (brake)" for link in robot.moving if link.brake is None]
        if without:
            raise ConfigError(
                f"robot {robot.name}: physics needs mass and brake of {', '.join(without)}"
            )
        self._warnings: list[str] = []
        mujoco.set_mju_user_warning(self._warnings.append)
        human = human or HumanKeys()
        self._human_offset = np.array(human.offset)
        self._model = _compile(robot, period, payload, human)
        self._data = mujoco.MjData(self._model)
        self._tool = self._model.site(robot.tool.name).id
        self._body = int(self._model.site_bodyid[self._tool])
        self._brake = brake_scale * np.array([float(link.brake or 0.0) for link in robot.moving])
        self._timing = robot.brakes
        self._period = period
        self._off_for = np.inf  # [s] since the torque was cut
        self._target = np.array(q0, np.float64)  # where the drives want to be
        self._command = np.zeros_like(self._target)
        self._inertia = np.zeros_like(self._target)
        self._data.qpos[:] = q0
        self._close_brakes()
        mujoco.mj_forward(self._model, self._data)
        #: Views: what encoders measure, (n_q,) each.
        self.q: Array = self._data.qpos
        self.qd: Array = self._data.qvel

    @property
    def time(self) -> float:
        """[s] simulated."""
        return float(self._data.time)

    @property
    def tool_W(self) -> Array:  # noqa: N802  a frame's suffix
        """(3,) origin of the tool [m]; a view."""
        return np.asarray(self._data.site_xpos[self._tool])

    @property
    def tool_R(self) -> Array:  # noqa: N802  a rotation
        """(3, 3) R_WT; a view."""
        return np.asarray(self._data.site_xmat[self._tool].reshape(3, 3))

    @property
    def acceleration(self) -> Array:
        """(n_q,) of the last step [rad/s^2]; a view."""
        return np.asarray(self._data.qacc)

    def tool_twist(self) -> Array:
        """(6,) of the tool's origin, linear first, in world [m/s], [rad/s]."""
        twist = np.empty(6)
        mujoco.mj_objectVelocity(
            self._model, self._data, mujoco.mjtObj.mjOBJ_SITE, self._tool, twist, 0
        )
        return np.concatenate([twist[3:], twist[:3]])

    def human_velocity(self) -> Array:
        """(3,) of the middle of the operator's capsule, which rides on the tool [m/s]."""
        twist = self.tool_twist()
        return twist[:3] + np.cross(twist[3:], self.tool_R @ self._human_offset)

    def truth(self, pairs: tuple[str, ...], ends: Sequence[tuple[str, Array]]) -> GuardTruth:
        """What the guard should find, by MuJoCo's own kinematics and distances: an oracle.

        Args:
            pairs: links whose distance to the operator's capsule counts.
            ends: links whose far end's velocity counts, and that end in the link's frame [m].
        """
        model, data = self._model, self._data
        human_W = self.tool_W + self.tool_R @ self._human_offset
        data.mocap_pos[0] = human_W
        mujoco.mj_kinematics(model, data)
        between = np.empty(6)
        human = model.geom(_HUMAN).id
        distance = min(
            (
                mujoco.mj_geomDistance(model, data, model.geom(name).id, human, _FAR, between)
                for name in pairs
            ),
            default=np.inf,
        )
        jacobian = np.empty((3, model.nv))
        fastest = -np.inf
        half = float(model.geom_size[human, 1])
        for name, end_L in ends:
            body = model.body(name).id
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ end_L
            mujoco.mj_jac(model, data, jacobian, None, point, body)
            way = human_W - point
            way[2] += min(max(point[2] - human_W[2], -half), half)
            fastest = max(fastest, float(way @ (jacobian @ data.qvel)) / math.sqrt(way @ way))
        mujoco.mj_jacSite(model, data, jacobian, None, self._tool)
        return GuardTruth(
            tcp_speed=float(np.linalg.norm(jacobian @ data.qvel)), distance=float(distance),
            velocity=fastest,
        )  # fmt: skip

    def step(self, command: Array, torque: bool, force: Array | None = None) -> None:
        """One period.

        Args:
            command: (n_q,) velocity [rad/s]; says nothing without torque.
            torque: the STO signal.
            force: (6,) that the hand puts on the tool, in world [N], [N m].

        Raises:
            SimulationError: MuJoCo warned.
        """
        model, data = self._model, self._data
        if torque:
            if self._off_for > 0.0:  # brakes open, the drives take over where the arm stands
                self._off_for = 0.0
                model.dof_frictionloss[:] = 0.0
                self._target[:] = data.qpos
                self._command[:] = 0.0
            self._drive(command)
        else:
            self._off_for += self._period
            data.qfrc_applied[:] = 0.0
            self._close_brakes()
        data.xfrc_applied[self._body] = 0.0
        if force is not None:
            data.xfrc_applied[self._body, :3] = force[:3]
            arm = data.site_xpos[self._tool] - data.xipos[self._body]
            data.xfrc_applied[self._body, 3:] = force[3:] + _cross(arm, force)
        mujoco.set_mju_user_warning(self._warnings.append)  # one for all: another arm may have it
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        if self._warnings:
            raise SimulationError(f"MuJoCo warned at {self.time:.3f} s: {self._warnings[0]}")

    def _drive(self, command: Array) -> None:
        """Computed torque: a = ramp of the command + 2 w (qd error) + w^2 (q error)."""
        model, data = self._model, self._data
        self._target += self._period * command
        wanted = (command - self._command) / self._period
        wanted += 2.0 * _DRIVE_FREQUENCY * (command - data.qvel)
        wanted += _DRIVE_FREQUENCY**2 * (self._target - data.qpos)
        self._command[:] = command
        mujoco.mj_mulM(model, data, self._inertia, wanted)
        data.qfrc_applied[:] = _MODEL_MASS * self._inertia
        data.qfrc_applied += _MODEL_WEIGHT * data.qfrc_bias
        data.qfrc_applied -= data.qfrc_passive

    def _close_brakes(self) -> None:
        since = self._off_for - self._timing.delay
        rise = self._timing.rise
        share = 0.0 if since < 0.0 else (min(since / rise, 1.0) if rise > 0.0 else 1.0)
        self._model.dof_frictionloss[:] = share * self._brake


def _cross(a: Array, b: Array) -> tuple[float, float, float]:
    return (
        float(a[1] * b[2] - a[2] * b[1]),
        float(a[2] * b[0] - a[0] * b[2]),
        float(a[0] * b[1] - a[1] * b[0]),
    )


def _compile(
    robot: CapsuleRobot, period: float, payload: float, operator: HumanKeys
) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.timestep = period
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    # Explicit in the damping: a step's change of velocity is then its acceleration, exactly.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    human = spec.worldbody.add_body(name=_HUMAN, mocap=True)
    human.add_geom(
        name=_HUMAN, type=mujoco.mjtGeom.mjGEOM_CAPSULE, contype=0, conaffinity=0,
        size=(operator.radius, 0.5 * operator.height - operator.radius, 0.0),
    )  # fmt: skip
    body = spec.worldbody
    for link in robot.links:
        body = body.add_body(name=link.name, pos=link.origin, quat=_quaternion(link.rpy))
        body.add_geom(
            name=link.name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=(*link.start, *link.end),
            size=(link.radius, 0.0, 0.0), mass=link.mass, contype=0, conaffinity=0,
        )  # fmt: skip
        if link.joint is not None:
            body.add_joint(
                name=link.joint, type=mujoco.mjtJoint.mjJNT_HINGE, axis=link.axis,
                armature=link.armature, damping=(link.damping, 0.0, 0.0),
                solref_friction=_FRICTION_SOLREF, solimp_friction=_FRICTION_SOLIMP,
            )  # fmt: skip
        if link.name == robot.tool.link:
            body.add_site(
                name=robot.tool.name, pos=robot.tool.position, quat=_quaternion(robot.tool.rpy)
            )
            if payload > 0.0:
                body.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.05, 0.0, 0.0),
                    pos=robot.tool.position, mass=payload, contype=0, conaffinity=0,
                )  # fmt: skip
    try:
        return spec.compile()
    except ValueError as error:
        raise SimulationError(f"MuJoCo refuses the robot {robot.name}: {error}") from None


def _quaternion(rpy: tuple[float, ...]) -> Array:
    quaternion = np.empty(4)
    mujoco.mju_euler2Quat(quaternion, np.array(rpy, np.float64), "XYZ")
    return quaternion
