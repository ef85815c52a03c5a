#pragma once
#include <string>
#include <variant>

#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Keep the robot away from the nearest obstacle: [WA] eqs. (4) to (7).
struct Avoidance {
  double d_min = 0.20;   ///< [m] distance to keep
  double buffer = 0.10;  ///< [m] Delta: the activation rises from 0 to 1 inside it
  double gain = 2.0;     ///< [1/s] lambda
  int nearest = 1;       ///< this many nearest links, one row each
  void validate() const;
};

/// Bring the tool to the goal: [WA] eqs. (8) to (10), both rates saturated.
struct Reach {
  double gain = 1.0;         ///< [1/s] lambda
  double max_linear = 0.25;  ///< [m/s]
  double max_angular = 0.5;  ///< [rad/s]
  void validate() const;
};

/// Keep every joint off its position limits.
struct JointLimits {
  double gain = 0.2;    ///< [1/s] towards the middle
  double margin = 0.3;  ///< [rad] or [m] where the activation begins
  void validate() const;
};

/// Keep the tool above a height.
struct MinimumAltitude {
  double height = 0.30;  ///< [m]
  double buffer = 0.10;  ///< [m]
  double gain = 0.5;     ///< [1/s]
  void validate() const;
};

/// Keep one arm's manipulability up: sqrt(det(J J')) of the tool's linear and angular rows.
struct Manipulability {
  double target = 0.12;  ///< [-] the rate pulls towards it
  double low = 0.02;     ///< [-] active below
  double high = 0.05;    ///< [-] inactive above
  double gain = 0.1;     ///< [1/s]
  void validate() const;
};

using TaskSpec = std::variant<Avoidance, Reach, JointLimits, MinimumAltitude, Manipulability>;
const char* task_name(const TaskSpec& spec);
void validate(const TaskSpec& spec);

/// One (control point, obstacle point) pair that avoidance acts on.
struct ControlPair {
  int link = -1;
  Vector3 control_W = Vector3::Zero();   ///< surface point, or sensor mounting point (SM)
  Vector3 obstacle_W = Vector3::Zero();
  Vector3 obstacle_velocity_W = Vector3::Zero();  ///< the x_o term of eq. (4) [m/s]
  double distance = kInfinity;
};

/// A task whose rows were built, with what the monitor wants to know of them.
struct BuiltTask {
  Task task;
  double smallest_row_norm = kInfinity;  ///< of scalar rows, before scaling
};

/// @name Rows for one tick; scalar rows are scaled to unit norm (facts, section 2)
/// @{
void build_avoidance(const Avoidance& spec, const Robot& robot, const Posture& posture,
                     std::span<const ControlPair> pairs, BuiltTask& out);
void build_reach(const Reach& spec, const Robot& robot, const Posture& posture,
                 const Pose& goal_WT, BuiltTask& out);
void build_joint_limits(const JointLimits& spec, const Robot& robot, const Posture& posture,
                        BuiltTask& out);
void build_minimum_altitude(const MinimumAltitude& spec, const Robot& robot,
                            const Posture& posture, BuiltTask& out);
void build_manipulability(const Manipulability& spec, const Robot& robot, const Posture& posture,
                          BuiltTask& out);
/// @}

/// The norm of the avoidance row n'J of a pair: how well joints can open it.
double row_norm(const Robot& robot, const Posture& posture, const ControlPair& pair);

/// Angle-axis vector that turns `from` into `to`, in world [rad].
Vector3 rotation_error(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to);

}  // namespace proxcgal
