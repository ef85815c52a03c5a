#pragma once
#include <memory>

#include "proxcgal/guiding/admittance.hpp"
#include "proxcgal/pipeline/limit.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal {

struct HandGuideConfig {
  AdmittanceConfig admittance;
  SolverConfig solver;
  JointVector qd_max, qdd_max;
  double period = 0.001;
};

template <>
inline constexpr auto fields<HandGuideConfig> = field_table(
    "HandGuideConfig", "Set-up of hand guiding.",
    field(&HandGuideConfig::admittance, "admittance", "Mass and damping that the hand feels."),
    field(&HandGuideConfig::solver, "solver", "Constants of the pseudo-inverse."),
    field(&HandGuideConfig::qd_max, "qd_max", "rad/s or m/s", above(0).or_infinite(),
          "Speed limits of the commands, one a joint; empty: the robot's own."),
    field(&HandGuideConfig::qdd_max, "qdd_max", "rad/s^2 or m/s^2", above(0).or_infinite(),
          "Acceleration limits of the commands, one a joint; empty: the robot's own."),
    field(&HandGuideConfig::period, "period", "s", above(0).at_most(0.1), "Period of the cycle."));

/// What one cycle gave. Twists: linear first, of the tool's origin, in world.
struct HandGuideOutput {
  JointVector qd;                      ///< (n,) admissible command
  Vector6 wanted = Vector6::Zero();    ///< by the admittance
  Vector6 achieved = Vector6::Zero();  ///< by the command
  Pose T_WT = Pose::Identity();        ///< at the posture given
};

/// From the force at the handle to joint velocities: admittance, then the task-priority solver with
/// the wanted twist as its one task, then the joints' limits. Velocity and posture come back to the
/// admittance as they were achieved, so that it never pushes against a limit it does not feel.
/// A step never throws, allocates, locks, or reads a clock.
class HandGuide {
 public:
  /// @throws ConfigError
  HandGuide(std::shared_ptr<const Robot> robot, HandGuideConfig config);

  /// @param q      (n,) measured, finite
  /// @param force  at the handle, in world [N], [N m]
  const HandGuideOutput& step(const JointVector& q, const Vector6& force, bool engaged);
  /// The torque was cut: whatever follows starts at rest.
  void halt();

  const HandGuideOutput& output() const { return output_; }
  const Admittance& admittance() const { return admittance_; }
  const Robot& robot() const { return *robot_; }

 private:
  std::shared_ptr<const Robot> robot_;
  HandGuideConfig config_;
  Admittance admittance_;
  JointVector qd_max_;  // [rad/s] or [m/s]
  Limiter limiter_;
  Posture posture_;
  Task task_;
  Solution solution_;
  HandGuideOutput output_;
};

}  // namespace proxcgal
