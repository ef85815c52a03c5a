#pragma once
#include <span>

#include "proxcgal/pipeline/task_config.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Decreasing bell of [iCAT]: 1 for x <= a, 0 for x >= b, a cosine between. Needs a <= b.
double decreasing(double x, double a, double b);
/// 1 - decreasing.
double increasing(double x, double a, double b);

/// Checks that need a robot: manipulability needs six joints within the robot's own;
/// self-collision needs links that exist.
/// @throws ConfigError, ModelError
void validate(const TaskSpec& spec, const Robot& robot);

/// One (control point, obstacle point) pair that avoidance acts on.
struct ControlPair {
  int link = -1;
  Vector3 control_W = Vector3::Zero();  ///< surface point, or sensor mounting point (SM)
  Vector3 obstacle_W = Vector3::Zero();
  Vector3 obstacle_velocity_W = Vector3::Zero();  ///< the x_o term of eq. (4) [m/s]
  double distance = kInfinity;  ///< [m] negative where the obstacle is inside: turns the normal
  /// Unit, from obstacle to robot: taken where the points coincide and leave none; zero for none.
  Vector3 fallback_normal_W = Vector3::Zero();
};

/// Two links of the robot and where they are nearest.
struct LinkPair {
  int a = -1, b = -1;
  Vector3 on_a_W = Vector3::Zero(), on_b_W = Vector3::Zero();
  double distance = kInfinity;                  ///< [m] 0 where they cross
  Vector3 fallback_normal_W = Vector3::Zero();  ///< unit, from b to a: taken where they cross
};

/// A scalar row of a smaller norm is left as it is: scaling would blow up its rate, and the
/// solver's damping lets it fade out. The monitor is told (facts, section 2).
inline constexpr double kSmallRowNorm = 0.01;

/// A task whose rows were built, with what the monitor wants to know of them.
struct BuiltTask {
  Task task;
  double smallest_row_norm = kInfinity;  ///< of scalar rows, before scaling
};

/// @name Rows for one tick
/// Rows, rates and activations are finite for finite input. Scalar rows are scaled to unit norm,
/// their rates alike. Nothing allocates.
/// @{

/// Row n'J_lin at each control point, n from the obstacle to the robot; rate n'v_obstacle +
/// gain (d_min + buffer - d). Where the two points coincide and there is no fallback normal the
/// row is zero, and its norm is told.
/// @param pairs  the most important first; one row each, at most kMaxRows
void build_avoidance(const Avoidance& spec, const Robot& robot, const Posture& posture,
                     std::span<const ControlPair> pairs, BuiltTask& out);
/// Six rows, or three of them: gain (x_goal - x_ee) and gain n theta, each shortened to its bound.
void build_reach(const Reach& spec, const Robot& robot, const Posture& posture, const Pose& goal_WT,
                 BuiltTask& out);
/// J = I, towards the middle of the joint's range. A joint with one limit only is pulled back to
/// `margin` inside it, one with none is left alone.
void build_joint_limits(const JointLimits& spec, const Robot& robot, const Posture& posture,
                        BuiltTask& out);
/// The tool's height; rate gain (height + buffer - z).
void build_minimum_altitude(const MinimumAltitude& spec, const Robot& robot, const Posture& posture,
                            BuiltTask& out);
/// The gradient of mu; rate gain (target - mu). At a singular posture, where mu has an edge, the
/// slope of one of its sides.
void build_manipulability(const Manipulability& spec, const Robot& robot, const Posture& posture,
                          BuiltTask& out);
/// Row n'(J_a - J_b) at each pair's nearest points, n from link b to link a; rate
/// gain (d_min + buffer - d).
/// @param pairs  the nearest first; one row each, at most kMaxRows
void build_self_collision(const SelfCollision& spec, const Robot& robot, const Posture& posture,
                          std::span<const LinkPair> pairs, BuiltTask& out);
/// @}

/// n of [WA] eq. (6): unit, from the obstacle to the robot; turned where the distance is negative.
Vector3 normal_W(const ControlPair& pair);
/// n'(J_a - J_b) of two links, (n,): the rate at which they part, by the joints' velocities.
JointVector parting_row(const Robot& robot, const Posture& posture, const LinkPair& pair);
/// n'J_lin of a pair, (n,): the rate at which its distance opens, by the joints' velocities.
JointVector opening_row(const Robot& robot, const Posture& posture, const ControlPair& pair);
/// Its norm: how well joints can open it.
double row_norm(const Robot& robot, const Posture& posture, const ControlPair& pair);

/// Angle-axis vector that turns `from` into `to`, in world [rad]: at most pi long. At a half turn
/// one of the two equal axes.
Vector3 rotation_error(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to);

}  // namespace proxcgal
